// SPDX-License-Identifier: LGPL-2.1-or-later
#include "freespace/cues/temporal.hpp"

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

TEST(ScoreAverage, LikePicturesInQuickSuccessionContinue) {
  ScoreAverage a;
  EXPECT_FALSE(a.continues(scene(0), 0, Temporal::automatic)); // the first
  EXPECT_TRUE(a.continues(scene(1), 66 * ms, Temporal::automatic));
  EXPECT_TRUE(a.continues(scene(0), 2066 * ms, Temporal::automatic));
  EXPECT_FALSE(a.continues(scene(1), 4067 * ms, Temporal::automatic));     // too late
  EXPECT_FALSE(a.continues(scene(25, 9), 4100 * ms, Temporal::automatic)); // another picture
  EXPECT_TRUE(a.continues(scene(25, 9), -1, Temporal::automatic));         // time unknown: the picture tells
  EXPECT_TRUE(a.continues(scene(25, 9), 10 * ms, Temporal::automatic));
}

TEST(ScoreAverage, OnAndOff) {
  ScoreAverage a;
  EXPECT_FALSE(a.continues(scene(0), 0, Temporal::on));
  EXPECT_TRUE(a.continues(scene(25, 9), 5000 * ms, Temporal::on));
  EXPECT_FALSE(a.continues(scene(25, 9), 5001 * ms, Temporal::off));
  a.forget();
  EXPECT_FALSE(a.continues(scene(25, 9), 5002 * ms, Temporal::on));
}

TEST(ScoreAverage, MovesByThreeQuarters) {
  ScoreAverage a;
  CellScores average;
  a.add({100, -400}, true, average); // nothing to continue
  EXPECT_EQ(average, (CellScores{100, -400}));
  a.add({500, -400}, true, average);
  EXPECT_EQ(average, (CellScores{400, -400}));
  a.add({0, 768}, false, average);
  EXPECT_EQ(average, (CellScores{0, 768}));
  for (int i = 0; i < 40; ++i)
    a.add({-768, 768}, true, average);
  EXPECT_EQ(average, (CellScores{-768, 768}));
}

} // namespace
} // namespace terrainseg
