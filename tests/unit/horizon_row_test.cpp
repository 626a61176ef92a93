// SPDX-License-Identifier: LGPL-2.1-or-later
#include "freespace/answer/answer_writer.hpp"

#include <gtest/gtest.h>

namespace terrainseg {
namespace {

HorizonRow of(const FrameCurve& boundary, std::uint8_t mask_confidence = 200) {
  std::vector<std::uint16_t> scratch;
  return horizon_of(boundary, 3, 0, 100, mask_confidence, scratch); // every second column counts
}

TEST(HorizonRow, IsTheUpperEndLessOutliers) {
  FrameCurve boundary(200, 40);
  EXPECT_EQ(of(boundary).row, 40);
  EXPECT_EQ(of(boundary).confidence, 200) << "all columns agree";
  std::fill_n(boundary.begin(), 8, std::uint16_t{10}); // 4 % of the columns
  EXPECT_EQ(of(boundary).row, 40);
  EXPECT_LT(of(boundary).confidence, 200);
  std::fill_n(boundary.begin(), 12, std::uint16_t{10});
  EXPECT_EQ(of(boundary).row, 10);
}

TEST(HorizonRow, NoneWhereTheCurveTellsNothing) {
  EXPECT_EQ(of(FrameCurve(200, 0)).row, -1);
  EXPECT_EQ(of(FrameCurve(200, 100)).row, -1);
  EXPECT_EQ(of(FrameCurve(200, 40), 15).row, -1);
  EXPECT_EQ(of(FrameCurve(200, 40), 16).row, 40);
}

TEST(HorizonHold, HoldsWithFallingConfidenceWhileFramesContinue) {
  HorizonHold hold;
  EXPECT_EQ(hold.follow({}, true).row, -1) << "nothing to hold yet";
  EXPECT_FALSE(hold.follow({70, 90}, true).held);
  int confidence = 90;
  for (;;) {
    const HorizonRow told = hold.follow({}, true);
    confidence /= 2;
    if (confidence == 0) {
      EXPECT_EQ(told.row, -1);
      EXPECT_FALSE(told.held);
      break;
    }
    ASSERT_EQ(told.row, 70);
    ASSERT_TRUE(told.held);
    ASSERT_EQ(told.confidence, confidence);
  }
  EXPECT_EQ(hold.follow({}, true).row, -1);
  EXPECT_EQ(hold.follow({50, 60}, true).row, 50);
  EXPECT_EQ(hold.follow({}, false).row, -1) << "another scene";
  EXPECT_EQ(hold.follow({}, true).row, -1) << "and the old one is forgotten";
  hold.follow({50, 60}, true);
  hold = {};
  EXPECT_EQ(hold.follow({}, true).row, -1);
}

} // namespace
} // namespace terrainseg
