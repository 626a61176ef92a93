// SPDX-License-Identifier: LGPL-2.1-or-later
#include "freespace/score/cell_scorer.hpp"

#include <algorithm>
#include <cmath>
#include <random>

#include <gtest/gtest.h>

#include "support/grids.hpp"

namespace terrainseg {
namespace {

using test::gray_grid;

std::vector<Cell> bottom_row(const test::OwnedGrid& g, int first, int end) {
  std::vector<Cell> cells;
  for (int j = first; j < end; ++j)
    cells.push_back({static_cast<std::int16_t>(j), static_cast<std::int16_t>(g.height - 1)});
  return cells;
}

CellPenalties raised(const test::OwnedGrid& g, const std::vector<Cell>& seeds, int gain = 256) {
  CellPenalties penalty(g.size(), 0);
  GeodesicPenalty().raise(g, test::color_steps_of(g, gain), seeds, penalty);
  return penalty;
}

// The definition by relaxation until nothing changes: any order of any ways gives the same distances.
CellPenalties by_definition(const test::OwnedGrid& g, const std::vector<Cell>& seeds, int gain) {
  const auto step = [&](std::size_t a, std::size_t b) {
    return ((std::abs(g.y[a] - g.y[b]) + 2 * std::abs(g.u[a] - g.u[b]) + 2 * std::abs(g.v[a] - g.v[b])) *
            gain) /
           256;
  };
  double own = 0;
  int count = 0, lowest = 0;
  for (const Cell& s : seeds) {
    lowest = std::max(lowest, int{s.y});
    if (s.x > 0)
      own += step(g.at(s.y, s.x), g.at(s.y, s.x - 1)), ++count;
    if (s.y > 0)
      own += step(g.at(s.y, s.x), g.at(s.y - 1, s.x)), ++count;
  }
  const int free = std::min(8, 1 + (count ? static_cast<int>(std::floor(1.75 * own / count)) : 0));
  const auto cost = [&](std::size_t a, std::size_t b) {
    return g.ignored[a] || g.ignored[b] ? 0 : std::max(step(a, b) - free, 0);
  };
  constexpr int unreached = 1 << 20;
  std::vector<int> row, below(static_cast<std::size_t>(g.width), unreached);
  CellPenalties penalty(g.size(), 0);
  for (int i = lowest; i >= 0; --i) {
    row.assign(static_cast<std::size_t>(g.width), unreached);
    for (const Cell& s : seeds)
      if (s.y == i)
        row[static_cast<std::size_t>(s.x)] = 0;
    for (bool changed = true; changed;) {
      changed = false;
      for (int j = 0; j < g.width; ++j)
        for (const auto& [di, dj] : {std::pair{0, -1}, {0, 1}, {1, -1}, {1, 0}, {1, 1}}) {
          const int k = j + dj;
          if (k < 0 || k >= g.width || i + di > lowest)
            continue;
          const int from = di ? below[static_cast<std::size_t>(k)] : row[static_cast<std::size_t>(k)];
          if (from >= unreached)
            continue;
          const int way = from + cost(g.at(i, j), g.at(i + di, k));
          if (way < row[static_cast<std::size_t>(j)]) {
            row[static_cast<std::size_t>(j)] = way;
            changed = true;
          }
        }
    }
    for (int j = 0; j < g.width; ++j) {
      int& d = row[static_cast<std::size_t>(j)];
      penalty[g.at(i, j)] = static_cast<std::int8_t>(std::clamp(d - 10, 0, 40));
      d = d >= unreached ? unreached : d - d / 8;
    }
    below = row;
  }
  return penalty;
}

TEST(Geodesic, IsTheCheapestWay) {
  std::mt19937 dice(11);
  for (int round = 0; round < 40; ++round) {
    const int width = round < 3 ? 1 + round : 2 + static_cast<int>(dice() % 30);
    test::OwnedGrid g = gray_grid(width, 1 + static_cast<int>(dice() % 20));
    const unsigned range = 1 + dice() % 60;
    for (auto* plane : {&g.y, &g.u, &g.v})
      for (auto& sample : *plane)
        sample = static_cast<std::uint8_t>(90 + dice() % range);
    for (auto& ignored : g.ignored)
      ignored = dice() % 12 == 0;
    std::vector<Cell> seeds;
    for (int k = 0; k < 1 + static_cast<int>(dice() % 12); ++k)
      seeds.push_back({static_cast<std::int16_t>(dice() % static_cast<unsigned>(g.width)),
                       static_cast<std::int16_t>(dice() % static_cast<unsigned>(g.height))});
    const int gain = 128 + static_cast<int>(dice() % 600);
    EXPECT_EQ(raised(g, seeds, gain), by_definition(g, seeds, gain)) << round;
  }
}

TEST(Geodesic, AnEnclosedThingIsFarAndTheGroundAroundItIsNot) {
  test::OwnedGrid g = gray_grid(30, 20);
  for (int i = 4; i < 12; ++i) // a box of the ground's colour inside a dark outline: a car's smooth flank
    for (int j = 10; j < 20; ++j)
      g.y[g.at(i, j)] = i == 4 || i == 11 || j == 10 || j == 19 ? 40 : 100;
  const auto penalty = raised(g, bottom_row(g, 8, 22));
  EXPECT_EQ(penalty[g.at(9, 15)], 40);
  EXPECT_EQ(penalty[g.at(9, 5)], 0);
  EXPECT_EQ(penalty[g.at(2, 15)], 0); // there are ways around it
}

TEST(Geodesic, AGentleSlopeAndTheGroundsOwnGrainCostNothing) {
  test::OwnedGrid g = gray_grid(30, 30);
  for (int i = 0; i < 30; ++i)
    for (int j = 0; j < 30; ++j)
      g.y[g.at(i, j)] = static_cast<std::uint8_t>(60 + 4 * (29 - i) + 4 * ((i + j) % 2));
  for (const int p : raised(g, bottom_row(g, 5, 25)))
    EXPECT_EQ(p, 0);
}

// A ramp to the right of the ground: each step costs what it has beyond the free one.
TEST(Geodesic, AStepIsFreeUpToOneAndTheGroundsOwnAndThreeQuartersMore) {
  for (const auto& [grain, free] : {std::pair{0, 1}, {1, 2}, {2, 4}, {3, 6}, {4, 8}, {5, 8}})
    for (const int beyond : {0, 1, 2}) {
      test::OwnedGrid g = gray_grid(34, 1);
      for (int j = 0; j < 34; ++j)
        g.y[g.at(0, j)] =
            static_cast<std::uint8_t>(j < 10 ? 6 + grain * (j % 2) : 6 + grain + (j - 9) * (free + beyond));
      const auto penalty = raised(g, bottom_row(g, 0, 10));
      EXPECT_EQ(penalty[g.at(0, 27)], std::clamp(18 * beyond - 10, 0, 40)) << grain << ' ' << beyond;
      EXPECT_EQ(penalty, by_definition(g, bottom_row(g, 0, 10), 256)) << grain << ' ' << beyond;
    }
}

TEST(Geodesic, ALineAcrossTheRoadIsForgiven) {
  test::OwnedGrid g = gray_grid(30, 40);
  for (int j = 0; j < 30; ++j)
    g.y[g.at(33, j)] = 140;
  const auto penalty = raised(g, bottom_row(g, 10, 20));
  EXPECT_GT(penalty[g.at(32, 15)], 20);
  EXPECT_EQ(penalty[g.at(10, 15)], 0);
}

TEST(Geodesic, LeavesAloneWhatLiesBelowTheWindowAndWhatIsWorseAlready) {
  test::OwnedGrid g = gray_grid(20, 20);
  for (int j = 0; j < 20; ++j)
    g.y[g.at(18, j)] = 250; // a bonnet
  CellPenalties penalty(g.size(), 7);
  GeodesicPenalty().raise(g, test::color_steps_of(g), std::vector<Cell>{{10, 15}}, penalty);
  for (const int p : penalty)
    EXPECT_EQ(p, 7);
  GeodesicPenalty().raise(g, test::color_steps_of(g), {}, penalty); // nothing is trusted
  EXPECT_EQ(penalty, CellPenalties(g.size(), 7));
}

} // namespace
} // namespace terrainseg
