// SPDX-License-Identifier: LGPL-2.1-or-later
// What was told to stand, against rules written here: a cell appears above 17/256 of evidence and stays above
// 8/256, in doubles; it stands when two of those around it do; what stood moves with the ground.
#include "motion/standing_map.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <random>
#include <set>
#include <utility>

namespace terrainseg {
namespace {

constexpr int columns = 24, rows = 18;
/// The ground fills the picture: its line lies above it.
constexpr GroundCamera view{4 * columns, 4 * rows, 80, -8 * 256};
constexpr int nothing_kept = 0; ///< of earlier frames' evidence
constexpr int unit = 32;        ///< of a frame's quality, Q12, for 1/256 of evidence: one frame counts half

using Place = std::pair<int, int>; ///< row, column
using Places = std::set<Place>;

struct Map {
  explicit Map() { map.reset(columns, rows); }
  StandingMap map;
  std::vector<CellParallax> cells{static_cast<std::size_t>(columns * rows)};
  std::vector<std::uint8_t> judged = std::vector<std::uint8_t>(cells.size(), 1);
  std::vector<std::int16_t> told;

  CellParallax& cell(Place place) {
    return cells[static_cast<std::size_t>(place.first * columns + place.second)];
  }
  void say(const Places& places, int quality) {
    cells.assign(cells.size(), {});
    for (const Place& place : places)
      cell(place).quality = static_cast<std::int16_t>(quality);
  }
  Places show(int keep = nothing_kept, const PlaneMotion& step = {}) {
    map.move(step, view, keep);
    map.add(cells, judged);
    map.read(view, told);
    Places standing;
    for (int i = 0; i < rows; ++i)
      for (int j = 0; j < columns; ++j)
        if (told[static_cast<std::size_t>(i * columns + j)] > least_standing)
          standing.insert({i, j});
    return standing;
  }
};

Places block(int first_row, int first_column, int height, int width) {
  Places places;
  for (int i = 0; i < height; ++i)
    for (int j = 0; j < width; ++j)
      places.insert({first_row + i, first_column + j});
  return places;
}

bool touch(const Place& a, const Place& b) {
  return a != b && std::max(std::abs(a.first - b.first), std::abs(a.second - b.second)) == 1;
}

/// Those that two others touch.
Places with_company(const Places& places) {
  Places kept;
  for (const Place& place : places)
    if (std::count_if(places.begin(), places.end(),
                      [&](const Place& other) { return touch(place, other); }) >= 2)
      kept.insert(place);
  return kept;
}

TEST(StandingMap, AppearsAboveSeventeenAndStaysAboveEight) {
  const Places stone = block(5, 7, 2, 3), none;
  Map m;
  const auto told = [&](int evidence_q8) {
    m.say(stone, evidence_q8 * unit);
    return m.show();
  };
  EXPECT_EQ(told(9), none);
  EXPECT_EQ(told(17), none);
  EXPECT_EQ(told(18), stone);
  EXPECT_EQ(told(12), stone);
  EXPECT_EQ(told(9), stone);
  EXPECT_EQ(told(8), none);
  EXPECT_EQ(told(17), none) << "gone is gone";
  EXPECT_EQ(told(18), stone);
  EXPECT_EQ(told(-40), none);
  EXPECT_EQ(told(17), none);
  told(60);
  m.map.reset(columns, rows);
  EXPECT_EQ(told(17), none) << "nothing stands after a reset";
}

// Evidence as a running mean in doubles, of at least two frames and at most eight.
TEST(StandingMap, FollowsTheRuleThroughALongSeries) {
  const Places stone = block(4, 3, 3, 3);
  for (const int keep : {224, 252}) {
    Map m;
    std::mt19937 random(7);
    std::normal_distribution<double> step(0, 160);
    double sum = 0, count = 0, level = 12 * unit;
    bool stands = false;
    int compared = 0, changes = 0, held_between = 0;
    for (int frame = 0; frame < 600; ++frame) {
      level = std::clamp(level * 0.95 + step(random) + 0.05 * 10 * unit, -1500.0, 1500.0);
      const int quality = static_cast<int>(level);
      const double kept = std::min(keep / 256.0, count > 0 ? 7 / count : 1);
      sum = sum * kept + quality / 4096.0;
      count = count * kept + 1;
      const double evidence = 256 * sum / std::max(count, 2.0);
      const bool before = stands;
      m.say(stone, quality);
      const Places told = m.show(keep);
      // The map counts in whole 256ths: what is above 17 is 18. Between two the answer is the map's.
      const double limit = before ? 9 : 18;
      if (std::abs(evidence - limit) < 0.3) {
        stands = !told.empty();
        continue;
      }
      stands = evidence > limit;
      ASSERT_EQ(told, stands ? stone : Places{}) << "frame " << frame << ", evidence " << evidence;
      ++compared;
      changes += stands != before;
      held_between += evidence > 9.5 && evidence < 17.5 && stands;
    }
    EXPECT_GT(compared, 500) << keep;
    EXPECT_GE(changes, 6) << keep;
    EXPECT_GE(held_between, 20) << keep;
  }
}

// While the camera stands the same evidence comes again and again: it does not add up.
TEST(StandingMap, WeakEvidenceStaysWeakHoweverOftenItComes) {
  const Places stone = block(4, 3, 3, 3);
  Map m;
  m.say(stone, 6 * unit); // 12 of 256, once more than one frame says so
  for (int frame = 0; frame < 200; ++frame)
    ASSERT_TRUE(m.show(252).empty()) << frame;
  EXPECT_NEAR(m.told[4 * columns + 3], 12, 1);
}

TEST(StandingMap, TellsNoLoneCellAndNoPair) {
  const auto told = [](const Places& places) {
    Map m;
    m.say(places, 100 * unit);
    return m.show();
  };
  const Places none;
  EXPECT_EQ(told({{8, 9}}), none);
  EXPECT_EQ(told({{8, 9}, {8, 10}}), none);
  EXPECT_EQ(told({{8, 9}, {9, 10}}), none);
  EXPECT_EQ(told({{8, 9}, {8, 10}, {8, 12}}), none) << "a gap is no company";
  EXPECT_EQ(told({{8, 9}, {8, 10}, {8, 11}}), (Places{{8, 10}})) << "the ends have one neighbour";
  EXPECT_EQ(told({{8, 9}, {9, 9}, {9, 10}}), (Places{{8, 9}, {9, 9}, {9, 10}}));
  // No company is found around the picture's edges.
  EXPECT_EQ(told({{8, columns - 1}, {9, 0}, {10, 0}}), none);
  EXPECT_EQ(told({{0, 0}, {0, 1}, {rows - 1, 0}, {rows - 1, columns - 1}}), none);
  EXPECT_EQ(told(block(rows - 2, columns - 2, 2, 2)).size(), 4u);
}

TEST(StandingMap, TellsWhatTwoOthersTouch) {
  std::mt19937 random(3);
  int told_in_all = 0, lone = 0;
  for (int trial = 0; trial < 50; ++trial) {
    std::bernoulli_distribution stands(0.06 + 0.008 * trial);
    Places places;
    for (const Place& place : block(0, 0, rows, columns))
      if (stands(random))
        places.insert(place);
    Map m;
    m.say(places, 100 * unit);
    const Places wanted = with_company(places);
    ASSERT_EQ(m.show(), wanted) << trial;
    told_in_all += static_cast<int>(wanted.size());
    lone += static_cast<int>(places.size() - wanted.size());
  }
  EXPECT_GT(told_in_all, 1000);
  EXPECT_GT(lone, 500);
}

TEST(StandingMap, ALoneCellIsRememberedUntilItHasCompany) {
  Map m;
  m.say({{8, 9}}, 40 * unit);
  EXPECT_TRUE(m.show().empty());
  // It falls between the limits while its neighbours appear: all of them stand.
  m.say({{8, 10}, {9, 9}}, 40 * unit);
  m.cell({8, 9}).quality = 12 * unit;
  EXPECT_EQ(m.show(), (Places{{8, 9}, {8, 10}, {9, 9}}));
}

// The ground comes nearer: between the limits only what stood before stands, where it is now.
TEST(StandingMap, WhatStoodMovesWithTheGround) {
  PlaneMotion step;
  const double forward = 0.4;
  step.g[7] = std::llround(forward * one_q24);
  const Places stone = block(6, 4, 4, 5), everywhere = block(0, 0, rows, columns);
  Map m;
  m.say(stone, 40 * unit);
  ASSERT_EQ(m.show(), stone);
  m.say(everywhere, 12 * unit);
  const Places told = m.show(nothing_kept, step);

  // Where the middle of a cell was, in cells: (x, y) / (1 + forward y), x and y over the focal length.
  int inside = 0, doubtful = 0;
  Places maybe, surely;
  for (const auto& [i, j] : everywhere) {
    const double x = (4 * j + 1.5 - (view.width - 1) / 2.0) / view.focal,
                 y = (4 * i + 1.5 - view.vanishing_row / 256.0) / view.focal, w = 1 + forward * y;
    const double column = (x / w * view.focal + (view.width - 1) / 2.0 - 1.5) / 4,
                 row = (y / w * view.focal + view.vanishing_row / 256.0 - 1.5) / 4;
    const auto stood = [&](double dv, double du) {
      return stone.count(
          {static_cast<int>(std::lround(row + dv)), static_cast<int>(std::lround(column + du))});
    };
    const auto hits = stood(.04, .04) + stood(.04, -.04) + stood(-.04, .04) + stood(-.04, -.04);
    inside += hits == 4;
    doubtful += hits > 0 && hits < 4;
    if (hits > 0)
      maybe.insert({i, j});
    if (hits == 4)
      surely.insert({i, j});
  }
  EXPECT_GT(inside, 25) << "it is larger now";
  EXPECT_LT(doubtful, 8);
  EXPECT_NE(surely, stone);
  for (const Place& place : with_company(surely))
    EXPECT_TRUE(told.count(place)) << place.first << ' ' << place.second;
  for (const Place& place : told)
    EXPECT_TRUE(maybe.count(place)) << place.first << ' ' << place.second;
}

} // namespace
} // namespace terrainseg
