// SPDX-License-Identifier: LGPL-2.1-or-later
#include "freespace/score/cell_scorer.hpp"

#include <gtest/gtest.h>

#include "support/grids.hpp"

namespace terrainseg {
namespace {

using test::gray_grid;

const std::array<int, 3> gray_100{1600, 2048, 2048};

TEST(LocalReference, TheSameColourCostsNothing) {
  const test::OwnedGrid g = gray_grid(20, 15, 100);
  CellPenalties penalty;
  LocalReference().climb(g, gray_100, 256, penalty);
  for (const int p : penalty)
    EXPECT_EQ(p, 0);
}

TEST(LocalReference, FollowsAGentleSlopeAndNotABreak) {
  test::OwnedGrid slope = gray_grid(20, 30, 100), step = slope;
  for (int i = 0; i < 30; ++i)
    for (int j = 0; j < 20; ++j) {
      slope.y[slope.at(i, j)] = static_cast<std::uint8_t>(100 + 4 * (29 - i)); // to 216 at the top
      step.y[step.at(i, j)] = static_cast<std::uint8_t>(i < 15 ? 216 : 100);
    }
  CellPenalties a, b;
  LocalReference().climb(slope, gray_100, 256, a);
  LocalReference().climb(step, gray_100, 256, b);
  for (const int p : a)
    EXPECT_EQ(p, 0);
  EXPECT_EQ(b[step.at(14, 10)], 24);
  EXPECT_EQ(b[step.at(0, 10)], 24);
  EXPECT_EQ(b[step.at(15, 10)], 0);
}

TEST(LocalReference, ColourBreaksCountDouble) {
  test::OwnedGrid g = gray_grid(20, 10, 100);
  for (int j = 0; j < 20; ++j) {
    g.u[g.at(4, j)] = 128 + 25; // 2 * 25 = 50: (50 - 34) / 2
    g.y[g.at(3, j)] = 100 + 50;
  }
  CellPenalties penalty;
  LocalReference().climb(g, gray_100, 256, penalty);
  EXPECT_EQ(penalty[g.at(4, 10)], 8);
  EXPECT_EQ(penalty[g.at(3, 10)], 8);
}

TEST(LocalReference, TheGainScalesItAndIgnoredCellsDoNotLead) {
  test::OwnedGrid g = gray_grid(20, 20, 100);
  for (int i = 0; i < 10; ++i)
    for (int j = 0; j < 20; ++j)
      g.y[g.at(i, j)] = 130;
  CellPenalties dark, plain;
  LocalReference().climb(g, gray_100, 512, dark);
  LocalReference().climb(g, gray_100, 256, plain);
  EXPECT_GT(dark[g.at(9, 5)], plain[g.at(9, 5)]);
  // A way of many small steps that is ignored does not lead the reference on.
  test::OwnedGrid led = gray_grid(20, 20, 100);
  for (int i = 0; i < 20; ++i)
    for (int j = 0; j < 20; ++j)
      led.y[led.at(i, j)] = static_cast<std::uint8_t>(i < 5 ? 172 : 100 + 7 * (19 - i));
  CellPenalties free, blocked;
  LocalReference().climb(led, gray_100, 256, free);
  for (int i = 5; i < 20; ++i)
    for (int j = 0; j < 20; ++j)
      led.ignored[led.at(i, j)] = 1;
  LocalReference().climb(led, gray_100, 256, blocked);
  EXPECT_EQ(free[led.at(2, 10)], 0);
  EXPECT_EQ(blocked[led.at(2, 10)], 19);
}

} // namespace
} // namespace terrainseg
