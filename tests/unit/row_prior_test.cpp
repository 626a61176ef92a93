// SPDX-License-Identifier: LGPL-2.1-or-later
#include "freespace/curve/boundary.hpp"

#include <gtest/gtest.h>

namespace terrainseg {
namespace {

TEST(RowPrior, SpeaksForTheBottomAndAgainstTheTop) {
  RowPriors prior;
  row_prior(40, 0, true, 0, prior);
  ASSERT_EQ(prior.size(), 40u);
  for (int i = 1; i < 40; ++i)
    EXPECT_GE(prior[i], prior[i - 1]);
  EXPECT_LT(prior.front(), 0);
  EXPECT_GT(prior.back(), 0);
  EXPECT_NEAR(prior[19] + prior[20], 0, 2); // the middle, while nothing is known
  for (const std::int16_t p : prior)
    EXPECT_LE(std::abs(p), 32);
}

TEST(RowPrior, FollowsTheHorizon) {
  RowPriors high, low;
  row_prior(60, 60, true, 0, high);
  row_prior(60, 140, true, 0, low);
  for (int i = 0; i < 60; ++i)
    EXPECT_GE(high[i], low[i]);
}

TEST(RowPrior, CautionIsTakenOffEverywhere) {
  RowPriors plain, careful, off;
  row_prior(30, 100, true, 0, plain);
  row_prior(30, 100, true, 12, careful);
  row_prior(30, 100, false, -7, off);
  for (int i = 0; i < 30; ++i) {
    EXPECT_EQ(careful[i], plain[i] - 12);
    EXPECT_EQ(off[i], 7);
  }
}

TEST(RowPrior, TheHorizonIsNotFarBelowWhereTheGroundVanishes) {
  for (const int slow : {0, 1, 90, 124, 125, 200, 255}) {
    EXPECT_EQ(horizon_of_prior(slow, -1), slow) << "the line is not known";
    EXPECT_EQ(horizon_of_prior(slow, 100), std::min(slow, 124)) << slow;
    EXPECT_EQ(horizon_of_prior(slow, 0), std::min(slow, 24)) << slow;
    EXPECT_EQ(horizon_of_prior(slow, 255), slow) << slow;
  }
}

TEST(RowPrior, DeniesTheRowsBefore) {
  RowPriors plain, denied;
  row_prior(30, 100, true, 5, plain);
  for (const int first : {-3, 0, 1, 17, 30, 99}) {
    denied = plain;
    deny_rows_before(first, denied);
    for (int i = 0; i < 30; ++i)
      EXPECT_EQ(denied[i], i < first ? plain[i] - 256 : plain[i]) << first << ' ' << i;
  }
}

TEST(RowPrior, TheSlowHorizonJumpsFirstThenFollowsByAQuarter) {
  std::vector<std::uint16_t> scratch;
  const GridCurve at_20(60, 20), at_40(60, 40);
  std::uint32_t h = follow_horizon(0, at_20, 80, scratch);
  EXPECT_EQ(h, 64u);
  h = follow_horizon(h, at_40, 80, scratch);
  EXPECT_EQ(h, 80u);
  for (int i = 0; i < 50; ++i)
    h = follow_horizon(h, at_40, 80, scratch);
  EXPECT_NEAR(h, 128, 4);
  const GridCurve top(60, 0);
  for (int i = 0; i < 90; ++i)
    h = follow_horizon(h, top, 80, scratch);
  EXPECT_GE(h, 1u); // 0 would mean that none is known
}

} // namespace
} // namespace terrainseg
