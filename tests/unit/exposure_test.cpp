// SPDX-License-Identifier: LGPL-2.1-or-later
#include "freespace/look/color_bins.hpp"

#include <algorithm>

#include <gtest/gtest.h>

#include "support/grids.hpp"

namespace terrainseg {
namespace {

test::OwnedGrid gray(int luma, int upper = 255) {
  test::OwnedGrid g = test::gray_grid(10, 8, luma);
  std::fill_n(g.y.begin(), 40, static_cast<std::uint8_t>(upper));
  return g;
}

TEST(Exposure, TheLowerHalfCounts) {
  EXPECT_EQ(mean_luma(gray(77, 250)), 77u << 8);
  test::OwnedGrid part = gray(50);
  for (int i = 60; i < 80; ++i) {
    part.y[i] = 255;
    part.ignored[i] = 1;
  }
  EXPECT_EQ(mean_luma(part), 50u << 8);
  part.ignored.assign(80, 1);
  EXPECT_EQ(mean_luma(part), 110u << 8); // nothing to see: as it should be
}

TEST(Exposure, FollowsSlowlyAndArrives) {
  std::uint32_t mean = follow_exposure(0, 100 << 8);
  EXPECT_EQ(mean, 100u << 8);
  const std::uint32_t next = follow_exposure(mean, 50 << 8);
  EXPECT_EQ(next, (100u << 8) - (50u << 4));
  for (int i = 0; i < 200; ++i)
    mean = follow_exposure(mean, 50 << 8);
  EXPECT_NEAR(mean, 50 << 8, 16);
  EXPECT_GT(follow_exposure(0, 0), 0u); // black is no reason to start anew
}

TEST(Exposure, ANormalisedFrameHasTheTargetMean) {
  for (const int luma : {20, 40, 80, 110, 160, 220}) {
    ExposureTables t;
    fill_exposure(static_cast<std::uint32_t>(luma) << 8, t);
    EXPECT_NEAR(t.luma[luma], 110, 2) << luma;
    for (int y = 1; y < 256; ++y)
      ASSERT_GE(t.luma[y], t.luma[y - 1]);
  }
}

TEST(Exposure, SaturationSurvivesTheLight) {
  // Half the light: half the chroma. Normalised, it is the same colour.
  ExposureTables day, dusk;
  fill_exposure(120 << 8, day);
  fill_exposure(60 << 8, dusk);
  const int bright = 40 * day.chroma_gain[120] >> 8, dim = 20 * dusk.chroma_gain[60] >> 8;
  EXPECT_NEAR(bright, dim, 3);
}

TEST(Exposure, OffIsNoGainAndDarkIsBounded) {
  ExposureTables t;
  fill_exposure(0, t);
  EXPECT_EQ(t.gain, 256);
  for (int y = 0; y < 256; ++y)
    ASSERT_EQ(t.luma[y], y);
  fill_exposure(1, t);
  EXPECT_EQ(t.gain, (110 << 16) / 2048);
}

// The square of a dark picture's gain on chroma has 32 bits: no int holds it.
TEST(Exposure, AModelKeepsItsShapeInTheDark) {
  ExposureTables t;
  fill_exposure(1, t);
  TerrainModel learned;
  learned.mean = {0, 140 << 8, 100 << 8};
  learned.variance = {1u << 20, 1u << 24, 1u << 26};
  const TerrainModel dark = in_this_light(learned, t);
  const std::uint64_t square = std::uint64_t{t.chroma_gain[0]} * t.chroma_gain[0];
  ASSERT_GT(square, std::uint64_t{1} << 31);
  EXPECT_EQ(dark.variance[1], (std::uint64_t{1} << 40) / square);
  EXPECT_EQ(dark.variance[2], (std::uint64_t{1} << 42) / square);
}

} // namespace
} // namespace terrainseg
