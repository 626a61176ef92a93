// SPDX-License-Identifier: LGPL-2.1-or-later
#include "coarse/grid.hpp"

#include <array>
#include <vector>

#include <gtest/gtest.h>

#include "terrainseg/estimate.hpp"

namespace terrainseg {
namespace {

TEST(MarkIgnored, CountsEachPixelOnce) {
  std::vector<std::uint8_t> mask(10 * 8, mask_traversable);
  const std::array<Rectangle, 3> ignored{{{0, 0, 8, 8}, {4, 4, 8, 8}, {-4, -4, 2, 2}}};
  // Level 1: pixels 0..7 are columns 0..3, 4..11 are 2..5.
  EXPECT_EQ(mark_ignored(ignored, 1, {mask.data(), 10}, 10, 8), 16u + 16 - 4);
  EXPECT_EQ(mask[0], mask_doubtful);
  EXPECT_EQ(mask[3], mask_doubtful);
  EXPECT_EQ(mask[4], mask_traversable);
  EXPECT_EQ(mask[5 * 10 + 5], mask_doubtful);
  EXPECT_EQ(mask[5 * 10 + 6], mask_traversable);
}

TEST(FillIgnored, TakesTheCellsWhoseCentresAreCovered) {
  // Level 2, 4 x 3 cells: the region's pixels 3..9 hold the centres 4 and 8, its rows 5..8 only 8.
  const std::array<Rectangle, 1> ignored{{{3, 5, 7, 4}}};
  std::vector<std::uint8_t> cells(12, 5);
  fill_ignored(ignored, 2, 4, 3, 1, cells.data());
  EXPECT_EQ(cells, (std::vector<std::uint8_t>{5, 5, 5, 5, 5, 5, 5, 5, 5, 1, 1, 5}));
}

} // namespace
} // namespace terrainseg
