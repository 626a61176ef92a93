// SPDX-License-Identifier: LGPL-2.1-or-later
#include "base/color_transform.hpp"

#include <algorithm>
#include <cmath>

#include <gtest/gtest.h>

namespace terrainseg {
namespace {

using Triple = std::array<double, 3>;

double red_weight(ColorMatrix m) {
  return m == ColorMatrix::bt709 ? 0.2126 : m == ColorMatrix::bt2020 ? 0.2627 : 0.299;
}
double blue_weight(ColorMatrix m) {
  return m == ColorMatrix::bt709 ? 0.0722 : m == ColorMatrix::bt2020 ? 0.0593 : 0.114;
}

// The textbook way there and back, in floating point.
Triple rgb_to_yuv(const Triple& rgb, ColorMatrix m) {
  const double kr = red_weight(m), kb = blue_weight(m);
  const double y = kr * rgb[0] + (1 - kr - kb) * rgb[1] + kb * rgb[2];
  return {y, (rgb[2] - y) / (2 * (1 - kb)), (rgb[0] - y) / (2 * (1 - kr))};
}

class Transform : public testing::TestWithParam<std::tuple<ColorMatrix, ColorRange>> {};

TEST_P(Transform, BringsEveryYuvToFullRangeBt601) {
  const auto [matrix, range] = GetParam();
  const bool limited = range == ColorRange::limited;
  const ColorTransform t = color_transform_of(false, {range, matrix});
  for (int r = 0; r < 256; r += 51)
    for (int g = 0; g < 256; g += 51)
      for (int b = 0; b < 256; b += 51) {
        const Triple rgb{double(r), double(g), double(b)};
        const Triple in = rgb_to_yuv(rgb, matrix), want = rgb_to_yuv(rgb, ColorMatrix::bt601);
        const std::array<std::uint8_t, 3> coded{
            static_cast<std::uint8_t>(std::lround(limited ? 16 + in[0] * 219 / 255 : in[0])),
            static_cast<std::uint8_t>(std::min(std::lround(128 + in[1] * (limited ? 224 : 255) / 255), 255L)),
            static_cast<std::uint8_t>(
                std::min(std::lround(128 + in[2] * (limited ? 224 : 255) / 255), 255L))};
        std::array<std::uint8_t, 3> out{};
        transform_row(t, {&coded[0], &coded[1], &coded[2]}, {&out[0], &out[1], &out[2]}, 1);
        // One step of the code is worth up to 2.3 after the matrix.
        EXPECT_NEAR(out[0], want[0], 2.0) << r << ' ' << g << ' ' << b;
        EXPECT_NEAR(out[1], std::min(128 + want[1], 255.0), 2.3);
        EXPECT_NEAR(out[2], std::min(128 + want[2], 255.0), 2.3);
        std::uint8_t luma = 0;
        transform_luma_row(t, {&coded[0], &coded[1], &coded[2]}, &luma, 1);
        EXPECT_EQ(luma, out[0]);
      }
}

INSTANTIATE_TEST_SUITE_P(Color, Transform,
                         testing::Combine(testing::Values(ColorMatrix::bt601, ColorMatrix::bt709,
                                                          ColorMatrix::bt2020),
                                          testing::Values(ColorRange::limited, ColorRange::full)));

TEST(ColorTransform, FullRangeBt601IsLeftAlone) {
  EXPECT_TRUE(color_transform_of(false, {ColorRange::full, ColorMatrix::bt601}).identity);
  EXPECT_FALSE(color_transform_of(false, {ColorRange::limited, ColorMatrix::bt601}).identity);
  EXPECT_FALSE(color_transform_of(true, {ColorRange::full, ColorMatrix::bt601}).identity);
}

TEST(ColorTransform, RgbByTheTextbook) {
  const ColorTransform t =
      color_transform_of(true, {ColorRange::full, ColorMatrix::bt709}); // the matrix means nothing
  for (int r = 0; r < 256; r += 17)
    for (int g = 0; g < 256; g += 17)
      for (int b = 0; b < 256; b += 17) {
        const std::array<std::uint8_t, 3> in{static_cast<std::uint8_t>(r), static_cast<std::uint8_t>(g),
                                             static_cast<std::uint8_t>(b)};
        std::array<std::uint8_t, 3> out{};
        transform_row(t, {&in[0], &in[1], &in[2]}, {&out[0], &out[1], &out[2]}, 1);
        const Triple want = rgb_to_yuv({double(r), double(g), double(b)}, ColorMatrix::bt601);
        ASSERT_NEAR(out[0], want[0], 0.6);
        ASSERT_NEAR(out[1], std::min(128 + want[1], 255.0), 0.6);
        ASSERT_NEAR(out[2], std::min(128 + want[2], 255.0), 0.6);
      }
}

} // namespace
} // namespace terrainseg
