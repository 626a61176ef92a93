// SPDX-License-Identifier: LGPL-2.1-or-later
#include "freespace/learn/window_teacher.hpp"

#include <gtest/gtest.h>

#include "support/frames.hpp"
#include "support/grids.hpp"

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

// Two columns of the window's six.
TEST_F(Guard, RefusesAThingThatFillsAThirdOfTheWindow) {
  for (const int first : {7, 9, 11}) {
    guard_ = {};
    refuses(0, 0); // paints the ground
    for (int i = window_.y; i < window_.y + window_.height; ++i)
      for (int j = first; j < first + 2; ++j)
        bins_.color[static_cast<std::size_t>(i * width + j)] = 1;
    EXPECT_TRUE(guard_.refuses(bins_, tables_, width, window_)) << first;
  }
}

TEST_F(Guard, LearnsAWindowWithASmallThing) {
  refuses(0, 0);
  bins_.color[static_cast<std::size_t>(window_.y * width + 9)] = 1; // one cell of the four of a third
  EXPECT_FALSE(guard_.refuses(bins_, tables_, width, window_));
}

TEST_F(Guard, AWindowOfTwoColumns) {
  window_ = {9, 7, 2, 2};
  EXPECT_FALSE(refuses(0, 0));
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

// A picture of blocks of noise. Everything above the window moves by `step` cells a frame, the window by
// `inside`.
class Still : public testing::Test {
 protected:
  static constexpr int width = 60, height = 40;
  bool look(int step, int inside) {
    above_ += step;
    in_ += inside;
    for (int i = 0; i < height; ++i)
      for (int j = 0; j < width; ++j) {
        const int noise = test::noise_at(i < window_.y ? j + above_ : j + in_, i, 9, 5);
        grid_.y[grid_.at(i, j)] =
            static_cast<std::uint8_t>(128 + (i < window_.y ? noise : paint_(i, j, noise)));
      }
    return still_.look(grid_, window_);
  }
  // Number of frames until the window is still; 0 = never within 100.
  int frames_until_still(int step, int inside) {
    for (int frame = 1; frame <= 100; ++frame)
      if (look(step, inside))
        return frame;
    return 0;
  }
  Rectangle window_{20, 32, 20, 6};
  test::OwnedGrid grid_{width, height};
  StillWindow still_;
  int (*paint_)(int row, int column, int noise) = [](int, int, int noise) { return noise; };

 private:
  int above_ = 0, in_ = 0;
};

TEST_F(Still, ADashboardInTheWindowAfterEightChanges) {
  EXPECT_EQ(frames_until_still(5, 0), 9); // the first frame has none before it
  EXPECT_TRUE(look(0, 0));                // the vehicle stops: nothing more is known
}

TEST_F(Still, GroundMovesWithThePicture) {
  EXPECT_EQ(frames_until_still(5, 5), 0);
}

TEST_F(Still, AVehicleThatStandsShowsNothing) {
  EXPECT_EQ(frames_until_still(0, 0), 0);
}

// Another car drives past: less than three fifths of the picture change.
TEST_F(Still, AVehicleThatStandsBesideTraffic) {
  look(0, 0);
  for (int frame = 0; frame < 100; ++frame) {
    for (int i = 0; i < window_.y / 2; ++i)
      for (int j = 0; j < width; ++j)
        grid_.y[grid_.at(i, j)] = static_cast<std::uint8_t>(128 + test::noise_at(j + 7 * frame, i, 9, 5));
    EXPECT_FALSE(still_.look(grid_, window_)) << frame;
  }
}

TEST_F(Still, AWindowWithoutContrastIsUnknown) {
  paint_ = [](int, int, int) { return 0; };
  EXPECT_EQ(frames_until_still(5, 0), 0);
}

// The markings beside a lane do not change while the vehicle follows them.
TEST_F(Still, MarkingsAlongTheWayAreNoDashboard) {
  paint_ = [](int, int column, int) { return column == 22 || column == 37 ? 80 : 0; };
  EXPECT_EQ(frames_until_still(5, 0), 0);
}

// The edge of a bonnet crosses all columns of the window.
TEST_F(Still, TheEdgeOfABonnet) {
  paint_ = [](int row, int, int) { return row >= 35 ? 80 : 0; };
  EXPECT_EQ(frames_until_still(5, 0), 9);
}

TEST_F(Still, ASlowVehicleNeedsMoreFrames) {
  look(0, 0);
  int frames = 0;
  for (int frame = 1; frame <= 100 && frames == 0; ++frame)
    if (look(frame % 4 == 0 ? 3 : 0, 0))
      frames = frame;
  EXPECT_EQ(frames, 32);
}

TEST_F(Still, EndsWhenTheWindowIsMovedOntoTheGround) {
  ASSERT_GT(frames_until_still(5, 0), 0);
  EXPECT_FALSE(look(5, 5));
}

TEST_F(Still, WhatIsIgnoredDoesNotCount) {
  std::fill(grid_.ignored.begin() + static_cast<std::ptrdiff_t>(grid_.at(window_.y, 0)), grid_.ignored.end(),
            std::uint8_t{1});
  EXPECT_EQ(frames_until_still(5, 0), 0);
}

TEST_F(Still, AnotherSizeOfTheGridStartsAgain) {
  ASSERT_GT(frames_until_still(5, 0), 0);
  const test::OwnedGrid other(30, 20);
  EXPECT_FALSE(still_.look(other, {10, 16, 10, 3}));
}

TEST_F(Still, AWindowAtTheEdgesOfTheGrid) {
  window_ = {0, 38, width, 2};
  EXPECT_EQ(frames_until_still(5, 0), 9);
  still_ = {};
  window_ = {0, 0, width, height};
  EXPECT_EQ(frames_until_still(5, 0), 0); // no picture above it
}

} // namespace
} // namespace terrainseg
