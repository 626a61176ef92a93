// SPDX-License-Identifier: LGPL-2.1-or-later
#include "freespace/score/likelihood.hpp"

#include <cmath>

#include <gtest/gtest.h>

namespace terrainseg {
namespace {

TerrainModel model_of(double y, double u, double v) {
  TerrainModel m;
  m.mean = {static_cast<std::uint16_t>(y * 256), static_cast<std::uint16_t>(u * 256),
            static_cast<std::uint16_t>(v * 256)};
  m.variance = {300 << 8, 180 << 8, 190 << 8};
  m.mass = 1000;
  return m;
}

TEST(ColumnsAhead, AreThoseOfTheWindow) {
  EXPECT_EQ(columns_ahead({21, 50, 18, 8}, 60), (Columns{21, 39}));
  EXPECT_EQ(columns_ahead({3, 50, 4, 8}, 60), (Columns{3, 7})); // wherever it lies
  EXPECT_EQ(columns_ahead({0, 0, 1, 1}, 1), (Columns{0, 1}));
  EXPECT_EQ(columns_ahead({1, 0, 1, 1}, 2), (Columns{1, 2}));
}

TEST(ColumnsAhead, AreAThirdOfTheWidthAtMost) {
  EXPECT_EQ(columns_ahead({0, 50, 60, 8}, 60), (Columns{20, 40}));
  EXPECT_EQ(columns_ahead({30, 50, 30, 8}, 60), (Columns{35, 55})); // around the window's middle
  for (int width = 1; width < 97; ++width)
    for (int x = 0; x < width; ++x) {
      const Columns c = columns_ahead({x, 0, width - x, 1}, width);
      ASSERT_GE(c.first, x) << width;
      ASSERT_GT(c.end, c.first) << width;
      ASSERT_LE(c.end, width) << x;
      ASSERT_LE(3 * (c.end - c.first), std::max(width, 3)) << x;
    }
}

// Against the photometry in words: half or twice the light on the same surface; chroma that is normalised by
// brightness stays.
TEST(InOtherLight, HalvesOrDoublesTheLight) {
  for (double y = 0; y < 256; y += 0.5)
    for (const double u : {0.0, 90.0, 128.0, 255.0})
      for (const double v : {0.0, 1.0, 128.0, 170.0, 255.0}) {
        const TerrainModel m = model_of(y, u, v), other = in_other_light(m);
        EXPECT_NEAR(other.mean[0] / 256.0, std::min(y >= 128 ? y / 2 : 2 * y, 255.0), 1.0 / 256) << y;
        EXPECT_EQ(other.mean[1], m.mean[1]);
        EXPECT_EQ(other.mean[2], m.mean[2]);
        EXPECT_EQ(other.variance[0], 2 * m.variance[0]);
        EXPECT_EQ(other.variance[1], m.variance[1]);
        EXPECT_EQ(other.variance[2], m.variance[2]);
        EXPECT_EQ(other.mass, m.mass);
      }
}

TEST(InOtherLight, ThereAndBackIsTheSameSurface) {
  for (int y = 64; y < 256; ++y) {
    const TerrainModel m = model_of(y, 120, 140), back = in_other_light(in_other_light(m));
    EXPECT_NEAR(back.mean[0], m.mean[0], 1) << y;
    EXPECT_EQ(back.mean[1], m.mean[1]) << y;
    EXPECT_EQ(back.mean[2], m.mean[2]) << y;
  }
}

} // namespace
} // namespace terrainseg
