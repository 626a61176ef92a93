// SPDX-License-Identifier: LGPL-2.1-or-later
#include "freespace/learn/window_teacher.hpp"

#include <gtest/gtest.h>

namespace terrainseg {
namespace {

class Guard : public testing::Test {
 protected:
  static constexpr int width = 20, height = 10;
  // Colour bin 0 is terrain, bin 1 is not.
  Guard() {
    tables_.color[0] = 26;
    tables_.color[1] = -26;
  }
  bool refuses(int inside, int beside) {
    bins_.color.assign(width * height, static_cast<std::uint16_t>(beside));
    bins_.texture.assign(width * height, 0);
    for (int i = window_.y; i < window_.y + window_.height; ++i)
      for (int j = window_.x; j < window_.x + window_.width; ++j)
        bins_.color[static_cast<std::size_t>(i * width + j)] = static_cast<std::uint16_t>(inside);
    return guard_.refuses(bins_, tables_, width, window_);
  }
  Rectangle window_{7, 7, 6, 2};
  CellBins bins_;
  LikelihoodTables tables_;
  WindowGuard guard_;
};

TEST_F(Guard, RefusesWhatStandsInFront) {
  EXPECT_TRUE(refuses(1, 0));
}

TEST_F(Guard, LearnsTerrainThatChangesOnBothSides) {
  EXPECT_FALSE(refuses(1, 1));
}

TEST_F(Guard, LearnsTheTerrainItself) {
  EXPECT_FALSE(refuses(0, 0));
  EXPECT_FALSE(refuses(0, 1));
}

TEST_F(Guard, AWindowAsWideAsTheFrameHasNoSides) {
  window_ = {0, 7, width, 2};
  EXPECT_FALSE(refuses(1, 0));
}

TEST_F(Guard, KeepsOutWithLessThanItTakesToEnter) {
  tables_.color[2] = 10; // neither like the terrain (26) nor clearly unlike it
  EXPECT_FALSE(refuses(2, 0));
  EXPECT_TRUE(refuses(1, 0));
  EXPECT_TRUE(refuses(2, 0));
  EXPECT_FALSE(refuses(0, 0)); // gone
  for (int i = 0; i < 8; ++i)
    EXPECT_FALSE(refuses(0, 0));
  EXPECT_FALSE(refuses(2, 0));
}

TEST_F(Guard, GivesInWithoutFlapping) {
  int held = 0;
  while (refuses(1, 0))
    ASSERT_LE(++held, 64);
  EXPECT_EQ(held, 64);
  int refused = 0;
  for (int i = 0; i < 100; ++i)
    refused += refuses(1, 0);
  EXPECT_LE(refused, 85);
  guard_ = {};
  EXPECT_TRUE(refuses(1, 0));
}

} // namespace
} // namespace terrainseg
