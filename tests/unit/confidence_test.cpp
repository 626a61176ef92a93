// SPDX-License-Identifier: LGPL-2.1-or-later
#include "freespace/answer/evidence.hpp"

#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

#include <gtest/gtest.h>

#include "freespace/learn/window_teacher.hpp"
#include "support/grids.hpp"

namespace terrainseg {
namespace {

class Confidence : public testing::Test {
 protected:
  std::uint8_t of(int below, int above, const GridCurve& boundary) {
    CellScores score;
    for (int i = 0; i < 30; ++i)
      for (int j = 0; j < 40; ++j)
        score.push_back(static_cast<std::int16_t>(16 * (i >= boundary[j] ? below : above)));
    return mask_confidence(grid_, score, boundary, {});
  }
  test::OwnedGrid grid_ = test::gray_grid(40, 30);
  const GridCurve level_ = GridCurve(40, 12);
};

TEST_F(Confidence, GrowsWithTheSeparation) {
  EXPECT_EQ(of(48, -48, level_), 255);
  EXPECT_EQ(of(0, 0, level_), 0);
  EXPECT_EQ(of(-20, 20, level_), 0);
  int last = 0;
  for (int s = 16; s < 48; s += 5) { // ground from half a nat on is sure
    EXPECT_GT(of(s, 0, level_), last);
    last = of(s, 0, level_);
  }
}

// The mean score of the ground is 20 both times.
TEST_F(Confidence, FallsWithTheShareOfTheGroundThatIsNotSure) {
  const auto with_part = [this](int other, int rest) {
    CellScores score;
    for (int i = 0; i < 30; ++i)
      for (int j = 0; j < 40; ++j)
        score.push_back(static_cast<std::int16_t>(16 * (i < 12 ? -20 : i < 21 ? other : rest)));
    return mask_confidence(grid_, score, level_, {});
  };
  EXPECT_NEAR(with_part(20, 20), 2 * with_part(15, 25), 20);
  EXPECT_EQ(with_part(15, 15), 0);
}

// An oracle in floating point. The share is 1 for a smooth window of one luma, 0 from 9 octaves of roughness
// on, and half where lumas differ by 30 from their mean; 0.7 is usual.
TEST_F(Confidence, AWindowThatIsRoughOrVariedSaysLittle) {
  std::mt19937 random(17);
  for (int trial = 0; trial < 200; ++trial) {
    CellBins cells;
    cells.luma.resize(grid_.size());
    cells.roughness.resize(grid_.size());
    const int octaves = static_cast<int>(random() % 11), range = 1 + static_cast<int>(random() % 200);
    for (std::size_t i = 0; i < grid_.size(); ++i) {
      cells.luma[i] = static_cast<std::uint8_t>(random() % range);
      cells.roughness[i] = static_cast<std::int16_t>(256 * octaves + static_cast<int>(random() % 256));
    }
    std::vector<Cell> window;
    for (int j = 0; j < 1 + trial % 40; ++j)
      window.push_back({static_cast<std::int16_t>(j), static_cast<std::int16_t>(29 - trial % 7)});
    const auto mean_of = [&](auto value) {
      double sum = 0;
      for (const Cell& cell : window)
        sum += value(grid_.at(cell.y, cell.x));
      return sum / static_cast<double>(window.size());
    };
    const double rough = mean_of([&](std::size_t i) { return cells.roughness[i] / 256.0; }),
                 luma = mean_of([&](std::size_t i) { return cells.luma[i]; }),
                 away = mean_of([&](std::size_t i) { return std::abs(cells.luma[i] - luma); });
    const double expected = 256 / 0.7 * std::clamp((9 - rough) / 4, 0.0, 1.0) / (1 + away / 30);
    EXPECT_NEAR(clarity_of_window(grid_, cells, window), expected, 9) << trial;
    EXPECT_EQ(clarity_of_window(grid_, cells, {}), 256);
  }
}

TEST_F(Confidence, FallsWithTheJumpsOfTheCurve) {
  GridCurve jagged = level_;
  for (std::size_t j = 0; j < jagged.size(); j += 2)
    jagged[j] = 16;
  EXPECT_LT(of(40, -20, jagged), of(40, -20, level_) / 2);
}

TEST_F(Confidence, TheRowsNextToTheBoundaryCountMost) {
  // Half a picture's worth of sure scores far away, or the same next to the curve.
  CellScores far_off, near_by;
  for (int i = 0; i < 30; ++i)
    for (int j = 0; j < 40; ++j) {
      const int sign = i >= 12 ? 1 : -1;
      const bool near = i >= 9 && i < 15;
      far_off.push_back(static_cast<std::int16_t>(16 * sign * (near ? 0 : 30)));
      near_by.push_back(static_cast<std::int16_t>(16 * sign * (near ? 30 : 20)));
    }
  EXPECT_GT(mask_confidence(grid_, near_by, level_, {}), mask_confidence(grid_, far_off, level_, {}));
}

TEST_F(Confidence, GroundBehindCountsAsGround) {
  const GridCurve base(40, 20);
  GroundBehind behind{GridCurve(40, 6), GridCurve(40, 14), true};
  CellScores score;
  for (int i = 0; i < 30; ++i)
    for (int j = 0; j < 40; ++j)
      score.push_back(i >= 20 || (i >= 6 && i < 14) ? 300 : -300);
  EXPECT_GT(mask_confidence(grid_, score, base, behind), mask_confidence(grid_, score, base, {}) + 20);
}

TEST_F(Confidence, ACurveThatPartsNothingIsNone) {
  EXPECT_EQ(of(48, -48, GridCurve(40, 0)), 0);
  EXPECT_EQ(of(48, -48, GridCurve(40, 30)), 0);
}

TEST_F(Confidence, TheHorizonsFallsWithItsSpread) {
  EXPECT_EQ(horizon_confidence(200, 0, 480), 200);
  EXPECT_EQ(horizon_confidence(200, 30, 480), 100);
  EXPECT_EQ(horizon_confidence(0, 0, 480), 0);
}

} // namespace
} // namespace terrainseg
