// SPDX-License-Identifier: LGPL-2.1-or-later
#include "freespace/look/connected_ground.hpp"

#include <cmath>
#include <random>

#include <gtest/gtest.h>

#include "support/grids.hpp"

namespace terrainseg {
namespace {

TEST(ColorSteps, LeadFromEveryCellToItsNeighbours) {
  std::mt19937 dice(5);
  for (int round = 0; round < 60; ++round) {
    test::OwnedGrid g = test::gray_grid(1 + static_cast<int>(dice() % 40), 1 + static_cast<int>(dice() % 9));
    for (auto* plane : {&g.y, &g.u, &g.v})
      for (auto& sample : *plane)
        sample = static_cast<std::uint8_t>(dice() % 256);
    const int gain = 100 + static_cast<int>(dice() % 900);
    const ColorSteps steps = test::color_steps_of(g, gain);
    const auto expect = [&](const std::vector<std::uint16_t>& found, int i, int j, int k, int l) {
      if (k >= g.height || l < 0 || l >= g.width)
        return;
      const auto difference = [&](const std::vector<std::uint8_t>& plane) {
        return std::abs(double{1} * plane[g.at(i, j)] - plane[g.at(k, l)]);
      };
      const double far = (difference(g.y) + 2 * difference(g.u) + 2 * difference(g.v)) * gain / 256;
      ASSERT_EQ(found[g.at(i, j)], std::min(std::floor(far), 1023.0))
          << i << ' ' << j << " to " << k << ' ' << l;
    };
    for (int i = 0; i < g.height; ++i)
      for (int j = 0; j < g.width; ++j) {
        expect(steps.right, i, j, i, j + 1);
        expect(steps.down, i, j, i + 1, j);
        expect(steps.down_left, i, j, i + 1, j - 1);
        expect(steps.down_right, i, j, i + 1, j + 1);
      }
  }
}

TEST(ColorSteps, SlantingOnesAreLeftOutWhereNobodyAsks) {
  ColorSteps steps;
  measure_color_steps(test::gray_grid(8, 6), 256, false, steps);
  EXPECT_EQ(steps.right.size(), 48u);
  EXPECT_EQ(steps.down.size(), 48u);
  EXPECT_TRUE(steps.down_left.empty());
  EXPECT_TRUE(steps.down_right.empty());
}

} // namespace
} // namespace terrainseg
