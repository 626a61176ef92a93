// SPDX-License-Identifier: LGPL-2.1-or-later
#include "reach.hpp"

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
  reach(free_cells, static_cast<int>(drawing[0].size()), window, top);
  return top;
}

using Top = std::vector<std::int16_t>;

TEST(Reach, ClimbsUntilTheFirstBreak) {
  EXPECT_EQ(reached({"#.#....", ".......", "..#....", "....#..", "......."}, {2, 4, 3, 1}),
            (Top{1, 0, 3, 0, 4, 0, 0}));
}

TEST(Reach, SpreadsAlongTheWindowsRowsButNotThroughABreak) {
  EXPECT_EQ(reached({".......", ".......", "#...#.."}, {2, 2, 1, 1}), (Top{-1, 0, 0, 0, -1, -1, -1}));
}

TEST(Reach, AnUpperRowOfTheWindowLeadsPastALowerBreak) {
  EXPECT_EQ(reached({"....", "....", "#.#."}, {0, 1, 2, 2}), (Top{0, 0, 0, 0}));
}

TEST(Reach, NothingFromABlockedWindow) {
  EXPECT_EQ(reached({"....", ".##."}, {1, 1, 2, 1}), (Top{-1, -1, -1, -1}));
}

TEST(CellsOfWindow, AreNeverEmpty) {
  EXPECT_EQ(cells_of_window({64, 64, 64, 32}, 4, 20, 12), (Rectangle{4, 4, 4, 2}));
  EXPECT_EQ(cells_of_window({33, 33, 5, 3}, 5, 4, 4), (Rectangle{1, 1, 1, 1}));
  EXPECT_EQ(cells_of_window({127, 127, 1, 1}, 5, 4, 4), (Rectangle{3, 3, 1, 1}));
  EXPECT_EQ(cells_of_window({0, 0, 1, 1}, 6, 1, 1), (Rectangle{0, 0, 1, 1}));
}

struct Mask {
  int width, height;
  std::vector<std::uint8_t> pixels;
  Mask(int w, int h) : width(w), height(h), pixels(static_cast<std::size_t>(w) * h, 0) {}
  GrayView view() const { return {{pixels.data(), width}, width, height}; }
};

TEST(RefineReach, FindsTheEdgeInsideTheCell) {
  for (int edge = 17; edge <= 32; ++edge) {
    Mask mask(64, 64);
    std::fill(mask.pixels.begin() + edge * 64, mask.pixels.end(), 255);
    Grid grid;
    grid.width = grid.height = 4;
    grid.level = 4;
    std::vector<std::uint16_t> boundary(64);
    refine_reach(grid, Top{2, 2, 2, -1}, mask.view(), 0, 64, boundary);
    EXPECT_EQ(boundary[0], edge);
    EXPECT_EQ(boundary[39], edge);
    EXPECT_EQ(boundary[40], 64); // nearest cell of pixel 40 is the fourth
    EXPECT_EQ(boundary[63], 64);
  }
}

TEST(RefineReach, SinglePixelsDoNotMoveIt) {
  Mask mask(64, 64);
  std::fill(mask.pixels.begin() + 24 * 64, mask.pixels.end(), 255);
  mask.pixels[27 * 64 + 5] = 0;
  mask.pixels[20 * 64 + 5] = 255;
  Grid grid;
  grid.width = grid.height = 4;
  grid.level = 4;
  std::vector<std::uint16_t> boundary(64);
  refine_reach(grid, Top{2, 2, 2, 2}, mask.view(), 0, 64, boundary);
  EXPECT_EQ(boundary[5], 24);
}

TEST(RefineReach, SpeaksInRowsOfTheFrameAtEveryMaskLevel) {
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
    refine_reach(grid, Top(static_cast<std::size_t>(grid.width), 4), mask.view(), level, 70, boundary);
    for (auto row : boundary)
      EXPECT_EQ(row, 32) << level;
  }
}

TEST(FreePermilleAhead, CountsTheWindowsColumns) {
  const std::vector<std::uint16_t> boundary{0, 0, 50, 40, 41, 100, 0, 0};
  EXPECT_EQ(free_permille_ahead(boundary, 0, {2, 56, 4, 8}, 16), 250); // of 50, 40, 41, 100 only 40 is free
  EXPECT_EQ(free_permille_ahead(boundary, 0, {2, 66, 4, 8}, 16), 750);
  EXPECT_EQ(free_permille_ahead(boundary, 1, {12, 66, 4, 8}, 16), 1000);
  EXPECT_EQ(free_permille_ahead(boundary, 3, {9, 66, 1, 8}, 16), 1000); // narrower than a mask column
}

} // namespace
} // namespace terrainseg
