// SPDX-License-Identifier: LGPL-2.1-or-later
// Stage B against a transcription of its equations in doubles.
#include "coarse/window.hpp"

#include <algorithm>
#include <cmath>
#include <random>

#include <gtest/gtest.h>

#include "support/grids.hpp"

namespace terrainseg {
namespace {

test::OwnedGrid noise(int width, int height, std::uint32_t seed, int spread) {
  test::OwnedGrid picture(width, height);
  std::mt19937 random(seed);
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x) {
      Color color{};
      for (int c = 0; c < 3; ++c)
        color[c] = static_cast<std::uint8_t>(
            std::clamp<int>(60 + 40 * c + static_cast<int>(random() % (2 * spread + 1)) - spread, 0, 255));
      picture.set({static_cast<std::int16_t>(x), static_cast<std::int16_t>(y)}, color);
    }
  return picture;
}

std::vector<Cell> all_cells(const Grid& grid) {
  std::vector<Cell> cells;
  for (int y = 0; y < grid.height; ++y)
    for (int x = 0; x < grid.width; ++x)
      cells.push_back({static_cast<std::int16_t>(x), static_cast<std::int16_t>(y)});
  return cells;
}

Settings paper() {
  return Settings::of(Preset::paper);
}

TEST(PlaceWindow, PaperRuleIsThePowerOfTwoNotAboveAFifthOfTheWidth) {
  EXPECT_EQ(place_window(paper(), 640, 480), (Rectangle{256, 416, 128, 64}));
  EXPECT_EQ(place_window(paper(), 639, 480), (Rectangle{287, 448, 64, 32}));
  EXPECT_EQ(place_window(paper(), 1920, 1080), (Rectangle{832, 952, 256, 128}));
}

TEST(PlaceWindow, DefaultRuleIsAShareOfTheFrame) {
  EXPECT_EQ(place_window(Settings{}, 1000, 200), (Rectangle{350, 170, 300, 30}));
}

TEST(PlaceWindow, BottomAndLeftMoveIt) {
  Settings s = paper();
  s.window_bottom = 30;
  s.window_x = 7;
  EXPECT_EQ(place_window(s, 640, 480), (Rectangle{7, 386, 128, 64}));
}

TEST(PlaceWindow, WhatWasSetIsKeptOrRefused) {
  Settings s = paper();
  s.window_width = 100;
  s.window_height = 50;
  EXPECT_EQ(place_window(s, 100, 50), (Rectangle{0, 0, 100, 50}));
  EXPECT_EQ(place_window(s, 99, 50), std::nullopt);
  EXPECT_EQ(place_window(s, 100, 49), std::nullopt);
  s.window_bottom = 1;
  EXPECT_EQ(place_window(s, 100, 50), std::nullopt);
  s = paper();
  s.window_bottom = 480;
  EXPECT_EQ(place_window(s, 640, 480), std::nullopt);
  s = paper();
  s.window_x = 640;
  EXPECT_EQ(place_window(s, 640, 480), std::nullopt);
}

TEST(PlaceWindow, AutomaticSidesFitEveryFrame) {
  for (const Settings& s : {paper(), Settings{}})
    for (int width : {1, 2, 3, 7, 16, 33, 640, 32767})
      for (int height : {1, 2, 5, 18, 480, 32767}) {
        const auto window = place_window(s, width, height);
        ASSERT_TRUE(window);
        EXPECT_FALSE(window->empty());
        EXPECT_GE(window->x, 0);
        EXPECT_LE(window->x + window->width, width);
        EXPECT_EQ(window->y + window->height, height);
      }
}

Rectangle of_rect(int x, int y, int width, int height, int frame_width, int frame_height) {
  Settings s;
  s.window_rect_q16 = {x, y, width, height};
  s.window_width = s.window_bottom = 30000; // not looked at
  return place_window(s, frame_width, frame_height).value_or(Rectangle{});
}

TEST(PlaceWindow, AShareOfTheFrameFollowsItsSize) {
  // 0.25, 0.5, 0.5, 0.25
  EXPECT_EQ(of_rect(16384, 32768, 32768, 16384, 640, 480), (Rectangle{160, 240, 320, 120}));
  EXPECT_EQ(of_rect(16384, 32768, 32768, 16384, 1920, 1080), (Rectangle{480, 540, 960, 270}));
  EXPECT_EQ(of_rect(16384, 32768, 32768, 16384, 32767, 32767), (Rectangle{8192, 16384, 16383, 8191}));
  EXPECT_EQ(of_rect(0, 0, 65536, 65536, 33, 7), (Rectangle{0, 0, 33, 7}));
  // At least a pixel, and inside.
  EXPECT_EQ(of_rect(65536, 65536, 1, 1, 33, 7), (Rectangle{32, 6, 1, 1}));
  EXPECT_EQ(of_rect(0, 0, 1, 1, 640, 480), (Rectangle{0, 0, 1, 1}));
}

TEST(FittingWindow, IsWhatWasSetWhereThatFits) {
  Settings s;
  s.window_x = 7;
  s.window_bottom = 30;
  s.window_height = 40;
  EXPECT_EQ(with_fitting_window(s, 640, 480), s);
}

TEST(FittingWindow, MovesAndCutsNoMoreThanItTakes) {
  const auto place = [](int width, int height, int bottom, int x, int frame_width, int frame_height) {
    Settings s;
    s.window_width = width;
    s.window_height = height;
    s.window_bottom = bottom;
    s.window_x = x;
    return place_window(with_fitting_window(s, frame_width, frame_height), frame_width, frame_height);
  };
  EXPECT_EQ(place(0, 0, 5000, -1, 640, 480), (Rectangle{224, 0, 192, 72}));    // to the top
  EXPECT_EQ(place(100, 181, 0, 20, 320, 180), (Rectangle{20, 0, 100, 180}));   // cut
  EXPECT_EQ(place(100, 100, 100, 20, 320, 180), (Rectangle{20, 0, 100, 100})); // moved down
  EXPECT_EQ(place(100, 50, 10, 900, 320, 180), (Rectangle{220, 120, 100, 50}));
  EXPECT_EQ(place(30000, 30000, 30000, 30000, 16, 9), (Rectangle{0, 0, 16, 9}));
  // An automatic side that a fitting offset makes narrow stays so when the other direction is wrong.
  EXPECT_EQ(place(0, 500, 0, 600, 640, 480), (Rectangle{600, 0, 40, 480}));
}

TEST(FittingWindow, FitsEveryFrame) {
  std::mt19937 random(3);
  for (int i = 0; i < 20000; ++i) {
    Settings s = i % 2 ? paper() : Settings{};
    s.window_width = random() % 3 ? static_cast<int>(random() % 400) : 0;
    s.window_height = random() % 3 ? static_cast<int>(random() % 400) : 0;
    s.window_bottom = static_cast<int>(random() % 400);
    s.window_x = static_cast<int>(random() % 400) - 1;
    const int width = 1 + static_cast<int>(random() % 300), height = 1 + static_cast<int>(random() % 300);
    const auto window = place_window(with_fitting_window(s, width, height), width, height);
    ASSERT_TRUE(window);
    EXPECT_FALSE(window->empty());
    EXPECT_GE(window->x, 0);
    EXPECT_GE(window->y, 0);
    EXPECT_LE(window->x + window->width, width);
    EXPECT_LE(window->y + window->height, height);
  }
}

TrainingArea area_of(Rectangle window, int width, int height) {
  return {window, {}, {}, width, height};
}

TEST(SelectCells, AreThoseWhoseCentreLiesInTheWindow) {
  std::vector<Cell> cells;
  for (int level = 0; level <= 6; ++level) {
    const Rectangle window{13, 50, 41, 37};
    select_cells(area_of(window, 101, 97), level, cells);
    std::vector<Cell> expected;
    for (int y = 0; y << level < 97; ++y)
      for (int x = 0; x << level < 101; ++x)
        if ((x << level) >= 13 && (x << level) < 54 && (y << level) >= 50 && (y << level) < 87)
          expected.push_back({static_cast<std::int16_t>(x), static_cast<std::int16_t>(y)});
    EXPECT_EQ(cells, expected) << "level " << level;
  }
}

TEST(SelectCells, IgnoredPixelsNeverTrain) {
  const std::array<Rectangle, 2> ignored{{{0, 0, 10, 100}, {20, 90, 100, 100}}};
  TrainingArea area = area_of({0, 80, 40, 20}, 100, 100);
  area.ignored = ignored;
  std::vector<Cell> cells;
  select_cells(area, 0, cells);
  EXPECT_EQ(cells.size(), 40u * 20 - 10 * 20 - 20 * 10);
  const std::array<Rectangle, 1> everything{{{-5, -5, 200, 200}}};
  area.ignored = everything;
  select_cells(area, 0, cells);
  EXPECT_TRUE(cells.empty());
}

TEST(SelectCells, CellsWithAVetoedPixelNeverTrain) {
  // Centres 0, 8, 16, ...; pixel 19 is nearest to the cell at 16, and pixel 20 to that at 24.
  const std::array<Rectangle, 2> vetoed{{{19, 40, 1, 1}, {1000, 1000, 10, 10}}};
  TrainingArea area = area_of({0, 32, 64, 16}, 100, 100);
  area.veto = VetoArea({vetoed, {}}, 100, 100);
  std::vector<Cell> cells;
  select_cells(area, 3, cells);
  EXPECT_EQ(cells.size(), 8u * 2 - 1);
  EXPECT_EQ(std::ranges::count(cells, Cell{2, 5}), 0);
  const std::array<Rectangle, 1> everything{{{-5, -5, 200, 200}}};
  area.veto = VetoArea({everything, {}}, 100, 100);
  select_cells(area, 3, cells);
  EXPECT_TRUE(cells.empty());
}

TEST(SelectCells, SupervisionStandsInForTheWindow) {
  const std::array<Rectangle, 3> rectangles{{{0, 0, 4, 4}, {2, 2, 4, 4}, {-10, -10, 3, 3}}};
  TrainingArea area = area_of({50, 50, 50, 50}, 100, 100);
  area.supervision.rectangles = rectangles;
  std::vector<Cell> cells;
  select_cells(area, 0, cells);
  EXPECT_EQ(cells.size(), 16u + 16 - 4); // the overlap trains once
  EXPECT_EQ(training_bounds(area, 0, cells), (Rectangle{0, 0, 6, 6}));
}

TEST(SelectCells, AMaskIsStretchedOverTheFrame) {
  const std::array<std::uint8_t, 4> mask{127, 0, 255, 128};
  TrainingArea area = area_of({0, 0, 1, 1}, 100, 60);
  area.supervision.mask = {{mask.data(), 2}, 2, 2};
  std::vector<Cell> cells;
  select_cells(area, 1, cells);
  EXPECT_EQ(cells.size(), 50u * 15);
  EXPECT_EQ(cells.front(), (Cell{0, 15}));
  EXPECT_EQ(training_bounds(area, 1, cells), (Rectangle{0, 30, 100, 30}));
}

TEST(SelectTrainingLevel, IsTheCoarsestWithEnoughCells) {
  std::vector<Cell> cells;
  const TrainingArea area = area_of({256, 416, 128, 64}, 640, 480);
  EXPECT_EQ(select_training_level(area, 5, 48, cells), 3); // 8 at level 5, 32 at 4, 128 at 3
  EXPECT_EQ(cells.size(), 128u);
  EXPECT_EQ(select_training_level(area, 5, 8, cells), 5);
  EXPECT_EQ(cells.size(), 8u);
  EXPECT_EQ(select_training_level(area, 5, 1 << 20, cells), 0);
  EXPECT_EQ(cells.size(), 128u * 64);
}

TEST(MomentsOf, AgreeWithDoubles) {
  for (int spread : {0, 1, 5, 60, 200}) {
    const test::OwnedGrid picture = noise(37, 11, 5, spread);
    const auto cells = all_cells(picture.view());
    const Gaussian moments = moments_of(picture.view(), cells);
    ASSERT_EQ(moments.mass, cells.size() << 8);
    for (int c = 0; c < 3; ++c) {
      double sum = 0, squares = 0;
      for (const Cell& cell : cells)
        sum += picture.view().color(cell)[c];
      const double mean = sum / cells.size();
      for (const Cell& cell : cells)
        squares += std::pow(picture.view().color(cell)[c] - mean, 2);
      EXPECT_NEAR(moments.mean[c] / 256.0, mean, 0.5 / 256 + 1e-9);
      EXPECT_NEAR(moments.variance[c] / 256.0, squares / cells.size(), 2.0 / 256);
    }
  }
}

TEST(MomentsOf, ExtremesDoNotOverflow) {
  MomentSums sums;
  for (int i = 0; i < 4096 * 2160; ++i)
    sums.add({255, static_cast<std::uint8_t>(i % 2 ? 255 : 0), 0});
  const Gaussian moments = sums.moments();
  EXPECT_EQ(moments.mean[0], 255 << 8);
  EXPECT_EQ(moments.variance[0], 0u);
  EXPECT_EQ(moments.mean[1], (255 << 8) / 2);
  EXPECT_NEAR(moments.variance[1], 255.0 * 255 / 4 * 256, 2);
  EXPECT_EQ(moments.variance[2], 0u);
}

TEST(MomentsOf, NothingIsZero) {
  const test::OwnedGrid picture(4, 4);
  EXPECT_EQ(moments_of(picture.view(), {}).mass, 0u);
}

std::vector<Cell> filtered_in_doubles(const Grid& grid, const std::vector<Cell>& cells, double sigma) {
  std::array<double, 3> mean{}, variance{};
  for (int c = 0; c < 3; ++c) {
    for (const Cell& cell : cells)
      mean[c] += grid.color(cell)[c] / static_cast<double>(cells.size());
    for (const Cell& cell : cells)
      variance[c] += std::pow(grid.color(cell)[c] - mean[c], 2) / static_cast<double>(cells.size());
  }
  std::vector<Cell> kept;
  for (const Cell& cell : cells) {
    bool inside = true;
    for (int c = 0; c < 3; ++c)
      inside &= std::abs(grid.color(cell)[c] - mean[c]) <= sigma * std::sqrt(variance[c]);
    if (inside)
      kept.push_back(cell);
  }
  return kept;
}

TEST(Prefilter, KeepsWhatLiesWithinSigmaOfTheMean) {
  for (int sigma_q8 : {256, 320, 384, 512}) {
    const test::OwnedGrid picture = noise(16, 8, 11, 40);
    const auto cells = all_cells(picture.view());
    const auto expected = filtered_in_doubles(picture.view(), cells, sigma_q8 / 256.0);
    PrefilterRule rule;
    rule.sigma_q8 = sigma_q8;
    Prefiltered kept;
    prefilter(picture.view(), cells, moments_of(picture.view(), cells), rule, kept);
    if (expected.size() * 2 >= cells.size())
      EXPECT_EQ(kept.cells, expected) << sigma_q8;
    else
      EXPECT_GE(kept.cells.size() * 2, cells.size()) << sigma_q8;
  }
}

TEST(Prefilter, NeverKeepsFewerThanTheNearestHalf) {
  test::OwnedGrid picture(10, 1);
  for (std::int16_t x = 0; x < 10; ++x)
    picture.set({x, 0}, {static_cast<std::uint8_t>(100 + 10 * x), 50, 50});
  const auto cells = all_cells(picture.view());
  PrefilterRule rule;
  rule.sigma_q8 = 0;
  Prefiltered kept;
  prefilter(picture.view(), cells, moments_of(picture.view(), cells), rule, kept);
  // The mean is 145: five are wanted, 120 and 170 are equally far, so six stay.
  EXPECT_EQ(kept.cells, (std::vector<Cell>{{2, 0}, {3, 0}, {4, 0}, {5, 0}, {6, 0}, {7, 0}}));
}

TEST(Prefilter, KeepsEverythingBelowAQuarterWhereAsked) {
  test::OwnedGrid picture(10, 1);
  for (std::int16_t x = 0; x < 10; ++x)
    picture.set({x, 0}, {static_cast<std::uint8_t>(100 + 10 * x), 50, 50});
  const auto cells = all_cells(picture.view());
  PrefilterRule rule{0, 0, PrefilterRule::Scarce::all_below_one_quarter};
  Prefiltered kept;
  prefilter(picture.view(), cells, moments_of(picture.view(), cells), rule, kept);
  EXPECT_EQ(kept.cells, cells);
  rule.sigma_q8 = 256; // seven within one sigma
  prefilter(picture.view(), cells, moments_of(picture.view(), cells), rule, kept);
  EXPECT_EQ(kept.cells.size(), 6u);
}

TEST(Prefilter, AConstantWindowStaysWhole) {
  const test::OwnedGrid picture(6, 6);
  const auto cells = all_cells(picture.view());
  Prefiltered kept;
  prefilter(picture.view(), cells, moments_of(picture.view(), cells), {}, kept);
  EXPECT_EQ(kept.cells, cells);
}

TEST(Prefilter, AnOutlierGoes) {
  test::OwnedGrid picture = noise(8, 8, 3, 4);
  picture.set({3, 3}, {250, 250, 250});
  const auto cells = all_cells(picture.view());
  PrefilterRule rule;
  rule.sigma_q8 = 512;
  Prefiltered kept;
  prefilter(picture.view(), cells, moments_of(picture.view(), cells), rule, kept);
  EXPECT_EQ(std::count(kept.cells.begin(), kept.cells.end(), (Cell{3, 3})), 0);
  EXPECT_EQ(kept.cells.size(), 63u);
}

TEST(Prefilter, NothingIn) {
  const test::OwnedGrid picture(2, 2);
  Prefiltered kept;
  prefilter(picture.view(), {}, {}, {}, kept);
  EXPECT_TRUE(kept.cells.empty());
}

} // namespace
} // namespace terrainseg
