// SPDX-License-Identifier: LGPL-2.1-or-later
#include "freespace/curve/refinement.hpp"

#include <gtest/gtest.h>

#include "support/grids.hpp"

namespace terrainseg {
namespace {

class Doubtful : public testing::Test {
 protected:
  void set(int row, int first, int last, int score) {
    for (int j = first; j <= last; ++j)
      score_[grid_.at(row, j)] = static_cast<std::int16_t>(16 * score);
  }
  GridCurve walk(int limit, int boundary) {
    GridCurve safe;
    walk_doubtful(grid_, score_, limit, GridCurve(9, static_cast<std::uint16_t>(boundary)), safe);
    return safe;
  }
  test::OwnedGrid grid_ = test::gray_grid(9, 12);
  CellScores score_ = CellScores(108, 480);
};

TEST_F(Doubtful, GoodGroundIsSafeFromTheBoundaryOn) {
  EXPECT_EQ(walk(-24, 5), GridCurve(9, 5));
}

TEST_F(Doubtful, WalksDownWhileTheGroundIsBad) {
  for (int i = 3; i < 8; ++i)
    set(i, 2, 6, -48);
  const auto safe = walk(-24, 5);
  EXPECT_EQ(safe[0], 5);
  EXPECT_GE(safe[4], 7); // the mean takes in good ground at the obstacle's rim
  EXPECT_LE(safe[4], 8);
}

TEST_F(Doubtful, WhatIsNotNextToTheBoundaryIsNotItsBusiness) {
  for (int i = 9; i < 11; ++i)
    set(i, 0, 8, -48);
  EXPECT_EQ(walk(-24, 5), GridCurve(9, 5));
}

TEST_F(Doubtful, OffAndEverything) {
  score_.assign(108, -768);
  for (const int off : {-96, -97, -100})
    EXPECT_EQ(walk(off, 5), GridCurve(9, 5)) << off;
  EXPECT_EQ(walk(-95, 5), GridCurve(9, 5)) << "the lowest score is -48";
  EXPECT_EQ(walk(-24, 5), GridCurve(9, 12));
  EXPECT_EQ(walk(-24, 12), GridCurve(9, 12));
  EXPECT_EQ(walk(-24, 0), GridCurve(9, 12));
}

TEST_F(Doubtful, ALowerLimitDoubtsLess) {
  for (int i = 5; i < 9; ++i)
    set(i, 0, 8, -10 * (i - 4));
  int last = 12;
  for (const int limit : {20, 0, -10, -20, -40}) {
    const auto safe = walk(limit, 5);
    EXPECT_LE(safe[4], last);
    last = safe[4];
  }
}

} // namespace
} // namespace terrainseg
