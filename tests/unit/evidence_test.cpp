// SPDX-License-Identifier: LGPL-2.1-or-later
#include "freespace/answer/evidence.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "support/frames.hpp"
#include "support/grids.hpp"
#include "terrainseg/segmenter.hpp"

namespace terrainseg {
namespace {

TEST(ConfidenceOf, IsTwiceTheShareOfRightLabelsLessOne) {
  EXPECT_EQ(confidence_of(0), 0);
  EXPECT_EQ(confidence_of(-500), 0);
  EXPECT_EQ(confidence_of(32000), confidence_of(6 * 32 - 1));
  int last = 0;
  for (int e = 1; e < 6 * 32; ++e) {
    const double right = 1 / (1 + std::exp(-e / 32.0));
    EXPECT_NEAR(confidence_of(e), 255 * (2 * right - 1), 3) << e;
    EXPECT_GE(confidence_of(e), last) << e;
    last = confidence_of(e);
  }
}

/// 40 x 30 cells of 8 x 8 pixels, ground from row 12 on, nothing known of its looks.
class EvidenceOf : public testing::Test {
 protected:
  EvidenceOf() {
    grid_.level = 3;
    evidence_.start(grid_, CellScores(grid_.size()), boundary_, {});
  }
  int at(int row, int column) const { return evidence_.sums()[grid_.at(row, column)]; }
  /// Told of a mask that is ground from row `first` of the frame on, 2^level smaller than the frame.
  std::vector<std::uint8_t> told(int first, int mask_level, std::uint8_t frame_confidence = 150) {
    const int width = 320 >> mask_level, height = 240 >> mask_level;
    std::vector<std::uint8_t> mask, out(grid_.size(), 77);
    for (int y = 0; y < height; ++y)
      mask.insert(mask.end(), static_cast<std::size_t>(width),
                  y << mask_level >= first ? mask_traversable : mask_not_traversable);
    evidence_.tell(grid_, {{mask.data(), width}, width, height}, mask_level, frame_confidence,
                   {out.data(), 40});
    return out;
  }
  test::OwnedGrid grid_ = test::gray_grid(40, 30);
  const GridCurve boundary_ = GridCurve(40, 12);
  Evidence evidence_;
};

TEST_F(EvidenceOf, PlacesGrowsWithTheDistanceFromTheCurve) {
  for (int rows = 0; rows < 12; ++rows)
    EXPECT_EQ(at(12 + rows, 7), -at(11 - rows, 7)) << "as sure on both sides, " << rows;
  for (int row = 1; row < 30; ++row)
    EXPECT_GE(at(row, 7), at(row - 1, 7)) << row;
  EXPECT_GT(at(12, 7), 0);
  EXPECT_GT(at(16, 7), 2 * at(13, 7));
}

TEST_F(EvidenceOf, LooksAddsToThatOfPlaces) {
  CellScores score(grid_.size());
  score[grid_.at(20, 5)] = 16 * 32; // 1 nat
  score[grid_.at(20, 6)] = -16 * 32;
  const int without = at(20, 5);
  evidence_.start(grid_, score, boundary_, {});
  EXPECT_NEAR(at(20, 5) - without, 32 / 3.0, 2);
  EXPECT_NEAR(at(20, 6) - without, -32 / 3.0, 2);
  EXPECT_EQ(at(20, 7), without);
}

TEST_F(EvidenceOf, GroundBehindIsForTheGround) {
  const GroundBehind behind{GridCurve(40, 4), GridCurve(40, 9), true};
  evidence_.start(grid_, CellScores(grid_.size()), boundary_, behind);
  for (int row = 4; row < 9; ++row)
    EXPECT_GT(at(row, 3), 0) << row;
  EXPECT_LT(at(3, 3), 0);
  EXPECT_LT(at(9, 3), 0);
  EXPECT_EQ(at(4, 3), at(8, 3)) << "as far from either end";
}

TEST_F(EvidenceOf, WhatIsOddSpeaksAgainstTheCellItIsIn) {
  const int before = at(20, 30);
  std::vector<std::uint8_t> odd(80 * 60); // of cells half as large
  const auto set = [&](int row, int column, std::uint8_t value) {
    odd[static_cast<std::size_t>(row * 80 + column)] = value;
  };
  set(40, 60, 56);
  set(40, 59, 88); // centred at x = 236, which cell 30 (centred at 240, from 236 on) has
  set(39, 61, 24); // no more than ground often is
  evidence_.subtract({mask_doubtful, {}, {odd, 80, 60, 2, 0, 80}, {}});
  EXPECT_EQ(at(20, 30), before - (88 - 24) / 2) << "the oddest one counts";
  EXPECT_EQ(at(20, 31), before);
  EXPECT_EQ(at(20, 29), before);
}

TEST_F(EvidenceOf, WhatStandsSpeaksAgainstIt) {
  const int before = at(25, 10);
  std::vector<std::int16_t> standing(80 * 60);
  standing[50 * 80 + 20] = 32; // covers x 80..83, y 200..203
  standing[50 * 80 + 30] = -60;
  evidence_.subtract({mask_not_traversable, {}, {}, {standing, 80, 60, 2, 2, 80}});
  EXPECT_EQ(at(25, 10), before - 64) << "two nats";
  EXPECT_EQ(at(25, 15), before) << "what lies is no evidence for the ground here";
}

TEST_F(EvidenceOf, TheMasksLabelIsWhatItIsFor) {
  for (const int mask_level : {0, 2}) {
    const auto right = told(12 * 8, mask_level), wrong = told(20 * 8, mask_level);
    EXPECT_GT(right[grid_.at(25, 9)], 200);
    EXPECT_GT(right[grid_.at(2, 9)], 200);
    EXPECT_LT(right[grid_.at(12, 9)], 130) << "next to the curve";
    EXPECT_EQ(right[grid_.at(12, 9)], right[grid_.at(11, 9)]);
    EXPECT_EQ(wrong[grid_.at(19, 9)], 0) << "a hole that nothing speaks for";
    EXPECT_EQ(wrong[grid_.at(20, 9)], right[grid_.at(20, 9)]);
  }
}

TEST_F(EvidenceOf, AHoleIsTheSurerTheMoreSpeaksForIt) {
  std::vector<std::int16_t> standing(80 * 60, 100);
  evidence_.subtract({mask_not_traversable, {}, {}, {standing, 80, 60, 2, 2, 80}});
  EXPECT_GT(told(20 * 8, 0)[grid_.at(15, 9)], 150);
}

TEST_F(EvidenceOf, ThePicturesConfidenceIsPartOfIt) {
  EXPECT_LT(told(96, 0, 0)[grid_.at(22, 9)], told(96, 0, 80)[grid_.at(22, 9)]);
  EXPECT_LT(told(96, 0, 80)[grid_.at(22, 9)], told(96, 0, 255)[grid_.at(22, 9)]);
}

TEST_F(EvidenceOf, NothingIsKnownOfWhatIsIgnored) {
  grid_.ignored[grid_.at(25, 9)] = 1;
  const auto map = told(96, 0);
  EXPECT_EQ(map[grid_.at(25, 9)], 0);
  EXPECT_GT(map[grid_.at(25, 10)], 0);
}

/// Through the whole core: ground of one noisy colour under a sky of another, 320 x 240, ground from row 96
/// down.
test::OwnedFrame plain() {
  return {PixelFormat::I420, 320, 240, [](int x, int y) -> test::Components {
            const int noise = test::noise_at(x, y, 0, 3);
            return y < 96 ? test::Components{static_cast<std::uint8_t>(210 + noise), 140, 116}
                          : test::Components{static_cast<std::uint8_t>(100 + noise), 120, 134};
          }};
}

TEST(ConfidenceMap, IsLowAtTheBoundaryAndHighFarFromIt) {
  Segmenter segmenter(Settings{});
  const auto frame = plain();
  for (int i = 0; i < 4; ++i)
    ASSERT_TRUE(segmenter.process(frame.frame()).ok());
  const GrayView& map = segmenter.estimate().confidence_map;
  ASSERT_EQ(map.width, 80);
  ASSERT_EQ(map.height, 60);
  for (int j = 0; j < 80; ++j) {
    const int edge = std::min({map.plane.row(22)[j], map.plane.row(23)[j], map.plane.row(24)[j]});
    EXPECT_LT(edge, 190) << j;
    EXPECT_GT(map.plane.row(50)[j], 220) << j;
    EXPECT_GT(map.plane.row(5)[j], 220) << j;
  }
}

TEST(ConfidenceMap, IsZeroWhileNothingIsKnownAndAbsentInThePapersPipeline) {
  Settings settings;
  settings.learning = false;
  Segmenter unknowing(settings);
  const auto frame = plain();
  ASSERT_TRUE(unknowing.process(frame.frame()).ok());
  const GrayView& map = unknowing.estimate().confidence_map;
  ASSERT_EQ(map.width, 80);
  for (int i = 0; i < map.height; ++i)
    EXPECT_TRUE(std::all_of(map.plane.row(i), map.plane.row(i) + 80, [](int v) { return v == 0; }));
  Segmenter paper(Settings::of(Preset::paper));
  ASSERT_TRUE(paper.process(frame.frame()).ok());
  EXPECT_TRUE(paper.estimate().confidence_map.empty());
}

} // namespace
} // namespace terrainseg
