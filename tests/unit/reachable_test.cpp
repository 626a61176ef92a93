// SPDX-License-Identifier: LGPL-2.1-or-later
#include "paper/pipeline.hpp"

#include <algorithm>
#include <string>

#include <gtest/gtest.h>

namespace terrainseg {
namespace {

using Drawing = std::vector<std::string>; // '.' is free

std::vector<std::int16_t> reached(const Drawing& drawing, const Rectangle& window) {
  std::vector<std::uint8_t> free_cells;
  for (const std::string& row : drawing)
    for (char c : row)
      free_cells.push_back(c == '.');
  std::vector<std::int16_t> top;
  find_reachable(free_cells, static_cast<int>(drawing[0].size()), window, top);
  return top;
}

using Top = std::vector<std::int16_t>;

TEST(Reachable, ClimbsUntilTheFirstBreak) {
  EXPECT_EQ(reached({"#.#....", ".......", "..#....", "....#..", "......."}, {2, 4, 3, 1}),
            (Top{1, 0, 3, 0, 4, 0, 0}));
}

TEST(Reachable, SpreadsAlongTheWindowsRowsButNotThroughABreak) {
  EXPECT_EQ(reached({".......", ".......", "#...#.."}, {2, 2, 1, 1}), (Top{-1, 0, 0, 0, -1, -1, -1}));
}

TEST(Reachable, AnUpperRowOfTheWindowLeadsPastALowerBreak) {
  EXPECT_EQ(reached({"....", "....", "#.#."}, {0, 1, 2, 2}), (Top{0, 0, 0, 0}));
}

TEST(Reachable, NothingFromABlockedWindow) {
  EXPECT_EQ(reached({"....", ".##."}, {1, 1, 2, 1}), (Top{-1, -1, -1, -1}));
}

struct Mask {
  int width, height;
  std::vector<std::uint8_t> pixels;
  Mask(int w, int h) : width(w), height(h), pixels(static_cast<std::size_t>(w) * h, 0) {}
  GrayView view() const { return {{pixels.data(), width}, width, height}; }
};

TEST(RefineReachable, FindsTheEdgeInsideTheCell) {
  for (int edge = 17; edge <= 32; ++edge) {
    Mask mask(64, 64);
    std::fill(mask.pixels.begin() + edge * 64, mask.pixels.end(), 255);
    Grid grid;
    grid.width = grid.height = 4;
    grid.level = 4;
    std::vector<std::uint16_t> boundary(64);
    refine_reachable(grid, Top{2, 2, 2, -1}, mask.view(), 0, 64, boundary);
    EXPECT_EQ(boundary[0], edge);
    EXPECT_EQ(boundary[39], edge);
    EXPECT_EQ(boundary[40], 64); // nearest cell of pixel 40 is the fourth
    EXPECT_EQ(boundary[63], 64);
  }
}

TEST(RefineReachable, SinglePixelsDoNotMoveIt) {
  Mask mask(64, 64);
  std::fill(mask.pixels.begin() + 24 * 64, mask.pixels.end(), 255);
  mask.pixels[27 * 64 + 5] = 0;
  mask.pixels[20 * 64 + 5] = 255;
  Grid grid;
  grid.width = grid.height = 4;
  grid.level = 4;
  std::vector<std::uint16_t> boundary(64);
  refine_reachable(grid, Top{2, 2, 2, 2}, mask.view(), 0, 64, boundary);
  EXPECT_EQ(boundary[5], 24);
}

TEST(RefineReachable, SpeaksInRowsOfTheFrameAtEveryMaskLevel) {
  for (int level = 0; level <= 5; ++level) {
    const int width = subsampled(100, level), height = subsampled(70, level);
    Mask mask(width, height);
    for (int y = 0; y < height; ++y)
      for (int x = 0; x < width; ++x)
        mask.pixels[static_cast<std::size_t>(y) * width + x] = (y << level) >= 32 ? 255 : 0;
    Grid grid;
    grid.width = subsampled(100, 3);
    grid.height = subsampled(70, 3);
    grid.level = 3;
    std::vector<std::uint16_t> boundary(static_cast<std::size_t>(width));
    refine_reachable(grid, Top(static_cast<std::size_t>(grid.width), 4), mask.view(), level, 70, boundary);
    for (auto row : boundary)
      EXPECT_EQ(row, 32) << level;
  }
}

} // namespace
} // namespace terrainseg
