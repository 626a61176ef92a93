// SPDX-License-Identifier: LGPL-2.1-or-later
#include "freespace/score/cell_scorer.hpp"

#include <cmath>

#include <gtest/gtest.h>

#include "support/frames.hpp"
#include "support/grids.hpp"

namespace terrainseg {
namespace {

test::OwnedGrid scene(int shift, int seed = 0) {
  test::OwnedGrid g(40, 30);
  for (int i = 0; i < 30; ++i)
    for (int j = 0; j < 40; ++j)
      g.y[g.at(i, j)] = static_cast<std::uint8_t>(4 * (j + shift) + test::noise_at(0, i + seed, seed, 6));
  return g;
}

constexpr std::int64_t ms = 1'000'000;

/// Whether a picture shows the same place as the one before, which it then is.
struct Pictures {
  LastPicture last;
  bool shows_same(const Grid& grid, std::int64_t pts, Temporal mode) {
    const bool same = shows_same_place(last, grid, pts, mode);
    remember(grid, pts, last);
    return same;
  }
};

TEST(LastPicture, LikePicturesInQuickSuccessionContinue) {
  for (const Temporal mode : {Temporal::automatic, Temporal::off}) {
    Pictures p;
    EXPECT_FALSE(p.shows_same(scene(0), 0, mode)); // the first
    EXPECT_TRUE(p.shows_same(scene(1), 66 * ms, mode));
    EXPECT_TRUE(p.shows_same(scene(0), 2066 * ms, mode));
    EXPECT_FALSE(p.shows_same(scene(1), 4067 * ms, mode));     // too late
    EXPECT_FALSE(p.shows_same(scene(25, 9), 4100 * ms, mode)); // another picture
    EXPECT_TRUE(p.shows_same(scene(25, 9), -1, mode));         // time unknown: the picture tells
    EXPECT_TRUE(p.shows_same(scene(25, 9), 10 * ms, mode));
  }
}

TEST(LastPicture, WhereAveragingIsOnOnlyTheSizeMatters) {
  Pictures p;
  EXPECT_FALSE(p.shows_same(scene(0), 0, Temporal::on));
  EXPECT_TRUE(p.shows_same(scene(25, 9), 5000 * ms, Temporal::on));
  p.last = {};
  EXPECT_FALSE(p.shows_same(scene(25, 9), 5002 * ms, Temporal::on));
}

/// A picture with waves of 8 cells across and 10 down, moved by parts of a cell.
test::OwnedGrid waves(double across, double down) {
  test::OwnedGrid g(64, 40);
  for (int i = 0; i < 40; ++i)
    for (int j = 0; j < 64; ++j)
      g.y[g.at(i, j)] =
          static_cast<std::uint8_t>(std::lround(128 + 50 * std::sin(2 * 3.14159265 * (j - across) / 8) +
                                                50 * std::sin(2 * 3.14159265 * (i - down) / 10)));
  return g;
}

TEST(LastPicture, APictureHasHardlyMovedWhileItMovesByPartsOfACell) {
  LastPicture last;
  remember(waves(0, 0), 0, last);
  EXPECT_TRUE(has_hardly_moved(last, waves(0, 0)));
  for (const double sign : {-1.0, 1.0}) {
    EXPECT_TRUE(has_hardly_moved(last, waves(sign * 0.2, 0)));
    EXPECT_TRUE(has_hardly_moved(last, waves(0, sign * 0.2)));
    EXPECT_FALSE(has_hardly_moved(last, waves(sign * 0.6, 0)));
    EXPECT_FALSE(has_hardly_moved(last, waves(0, sign * 0.6)));
    EXPECT_FALSE(has_hardly_moved(last, waves(sign * 2, sign * 2)));
  }
  EXPECT_FALSE(has_hardly_moved(last, scene(0))) << "another size";
  // Nothing shows whether an even picture has moved.
  remember(test::OwnedGrid(64, 40), 0, last);
  EXPECT_FALSE(has_hardly_moved(last, test::OwnedGrid(64, 40)));
}

TEST(AverageScores, MovesByThreeQuarters) {
  CellScores average;
  average_scores({100, -400}, true, average); // nothing to continue
  EXPECT_EQ(average, (CellScores{100, -400}));
  average_scores({500, -400}, true, average);
  EXPECT_EQ(average, (CellScores{400, -400}));
  average_scores({0, 768}, false, average);
  EXPECT_EQ(average, (CellScores{0, 768}));
  for (int i = 0; i < 40; ++i)
    average_scores({-768, 768}, true, average);
  EXPECT_EQ(average, (CellScores{-768, 768}));
}

} // namespace
} // namespace terrainseg
