// SPDX-License-Identifier: LGPL-2.1-or-later
#include "base/color_transform.hpp"

#include <algorithm>
#include <cmath>

#include <gtest/gtest.h>

namespace terrainseg {
namespace {

std::array<double, 3> in_doubles(const std::array<double, 3>& z, const ColorSpace& space) {
  const bool limited = space.colorimetry.range == ColorRange::limited;
  const auto level = [&](double v) { return limited ? (v - 16) * 255 / 219 : v; };
  if (space.rgb)
    return {level(z[0]), level(z[1]), level(z[2])};
  double kr = 0.299, kb = 0.114;
  if (space.colorimetry.matrix == ColorMatrix::bt709)
    kr = 0.2126, kb = 0.0722;
  if (space.colorimetry.matrix == ColorMatrix::bt2020)
    kr = 0.2627, kb = 0.0593;
  const double gain = limited ? 255.0 / 224 : 1, y = level(z[0]), u = (z[1] - 128) * gain,
               v = (z[2] - 128) * gain;
  const double r = y + 2 * (1 - kr) * v, b = y + 2 * (1 - kb) * u;
  return {r, (y - kr * r - kb * b) / (1 - kr - kb), b};
}

TEST(RgbOf, AgreesWithTheDefinitionOfEachMatrix) {
  for (bool rgb : {false, true})
    for (auto range : {ColorRange::limited, ColorRange::full})
      for (auto matrix : {ColorMatrix::bt601, ColorMatrix::bt709, ColorMatrix::bt2020}) {
        const ColorSpace space{rgb, {range, matrix}};
        for (int y = 0; y <= 255; y += 15)
          for (int u = 0; u <= 255; u += 17)
            for (int v = 0; v <= 255; v += 17) {
              const auto expected = in_doubles({y + 0.5, u + 0.25, v + 0.0}, space);
              const auto got =
                  rgb_of({static_cast<std::uint16_t>(y * 256 + 128), static_cast<std::uint16_t>(u * 256 + 64),
                          static_cast<std::uint16_t>(v * 256)},
                         space);
              for (int c = 0; c < 3; ++c)
                ASSERT_NEAR(got[c], std::clamp(expected[c], 0.0, 255.0), 0.52) << y << " " << u << " " << v;
            }
      }
}

} // namespace
} // namespace terrainseg
