// SPDX-License-Identifier: LGPL-2.1-or-later
#include "freespace/look/color_bins.hpp"

#include <algorithm>
#include <cmath>
#include <random>
#include <tuple>
#include <utility>
#include <vector>

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
  EXPECT_EQ(light_of(gray(77, 250)), (Light{77u << 8, 77u << 8}));
  test::OwnedGrid part = gray(50);
  for (int i = 60; i < 80; ++i) {
    part.y[i] = 255;
    part.ignored[i] = 1;
  }
  EXPECT_EQ(light_of(part), (Light{50u << 8, 50u << 8}));
  part.ignored.assign(80, 1);
  EXPECT_EQ(light_of(part).black, 0u); // nothing to see: as it should be
  ExposureTables t;
  fill_exposure(light_of(part), t);
  EXPECT_EQ(t.gain, 256);
}

// An oracle that sorts: black is the luma at one two-hundredth of the sorted cells.
TEST(Exposure, BlackIsDarkerThanAllButOneCellOfTwoHundred) {
  std::mt19937 random(11);
  for (const auto& [width, height] : {std::pair{1, 2}, {10, 20}, {40, 30}, {200, 4}, {53, 61}}) {
    test::OwnedGrid grid(width, height);
    std::vector<int> seen;
    for (std::size_t i = 0; i < grid.size(); ++i) {
      grid.y[i] = static_cast<std::uint8_t>(20 + random() % 90);
      grid.ignored[i] = random() % 4 == 0;
      if (i / width >= static_cast<std::size_t>(height / 2) && !grid.ignored[i])
        seen.push_back(grid.y[i]);
    }
    if (seen.empty())
      continue;
    std::sort(seen.begin(), seen.end());
    EXPECT_EQ(light_of(grid).black, static_cast<std::uint32_t>(seen[seen.size() / 200]) << 8)
        << width << " x " << height;
  }
}

TEST(Exposure, FollowsSlowlyAndArrives) {
  std::uint32_t mean = follow_slowly(0, 100 << 8);
  EXPECT_EQ(mean, 100u << 8);
  const std::uint32_t next = follow_slowly(mean, 50 << 8);
  EXPECT_EQ(next, (100u << 8) - (50u << 4));
  for (int i = 0; i < 200; ++i)
    mean = follow_slowly(mean, 50 << 8);
  EXPECT_NEAR(mean, 50 << 8, 16);
  EXPECT_GT(follow_slowly(0, 0), 0u); // a black frame is known: following does not start again
}

// The luma that the exposure brings the mean to.
int target() {
  ExposureTables t;
  fill_exposure({128 << 8, 0}, t);
  return t.luma[128];
}

TEST(Exposure, ANormalisedFrameHasTheTargetMean) {
  for (const int luma : {20, 40, 80, 110, 160, 220})
    for (const int black : {0, 2, 9, luma}) {
      ExposureTables t;
      fill_exposure({static_cast<std::uint32_t>(luma) << 8, static_cast<std::uint32_t>(black) << 8}, t);
      EXPECT_NEAR(t.luma[luma], target(), 2) << luma << " above " << black;
      EXPECT_EQ(t.black, std::clamp((112 - luma) / 10, 0, black)) << luma; // little of a bright picture's
      EXPECT_EQ(t.luma[t.black], 0);
      for (int y = 1; y < 256; ++y)
        ASSERT_GE(t.luma[y], t.luma[y - 1]);
    }
}

TEST(Exposure, SaturationSurvivesTheLight) {
  // Half the light: half the chroma. Normalised, it is the same colour.
  ExposureTables day, dusk;
  fill_exposure({120 << 8, 0}, day);
  fill_exposure({60 << 8, 0}, dusk);
  const int bright = 40 * day.chroma_gain[120] >> 8, dim = 20 * dusk.chroma_gain[60] >> 8;
  EXPECT_NEAR(bright, dim, 3);
}

// A lens that scatters light adds the same to each pixel and, when the picture stays as bright, takes
// contrast.
TEST(Exposure, ScatteredLightChangesNothing) {
  test::OwnedGrid clear(40, 40), hazy(40, 40);
  for (std::size_t i = 0; i < clear.size(); ++i) {
    clear.y[i] = static_cast<std::uint8_t>(i % 7 * 11);
    hazy.y[i] = static_cast<std::uint8_t>(clear.y[i] + 5);
    clear.u[i] = hazy.u[i] = static_cast<std::uint8_t>(120 + i % 17);
    clear.v[i] = hazy.v[i] = 131;
  }
  const std::vector<std::uint16_t> texture(clear.size(), 300);
  const auto bins_of = [&](const test::OwnedGrid& grid) {
    const Light light = light_of(grid);
    ExposureTables exposure;
    fill_exposure(light, exposure);
    CellBins cells;
    bin_cells(grid, texture, exposure, light.mean, cells);
    return cells;
  };
  const CellBins expected = bins_of(clear), cells = bins_of(hazy);
  EXPECT_EQ(cells.luma, expected.luma);
  EXPECT_EQ(cells.u, expected.u);
  EXPECT_EQ(cells.v, expected.v);
  EXPECT_EQ(cells.texture, expected.texture);
}

// An oracle in octaves: differences over a noise floor of 7 grey levels that grows by a quarter of the gain
// above 1, and a surface's differences grow by 1.25 octaves for each of its luma.
TEST(Exposure, RoughnessIsMeasuredOverTheNoise) {
  for (const int luma : {12, 25, 60, 110, 200})
    for (const int difference : {0, 1, 8, 60, 255}) {
      const test::OwnedGrid grid = gray(luma, luma);
      const std::vector<std::uint16_t> texture(grid.size(), static_cast<std::uint16_t>(16 * difference));
      ExposureTables exposure;
      fill_exposure({static_cast<std::uint32_t>(luma) << 8, 0}, exposure);
      CellBins cells;
      bin_cells(grid, texture, exposure, 0, cells);
      const double gain = exposure.gain / 256.0, noise = 7 * (1 + std::max(gain - 1, 0.0) / 4);
      const double octaves = std::log2(16 * (difference * gain + noise)) - 2 +
                             1.25 * (std::log2(90) - std::log2(cells.luma[0] + 16));
      EXPECT_NEAR(cells.roughness[0] / 256.0, octaves, 0.03) << luma << ' ' << difference;
    }
}

TEST(Exposure, OffIsNoGainAndDarkIsBounded) {
  ExposureTables t;
  fill_exposure({}, t);
  EXPECT_EQ(t.gain, 256);
  for (int y = 0; y < 256; ++y)
    ASSERT_EQ(t.luma[y], y);
  fill_exposure({0, 9 << 8}, t);
  EXPECT_EQ(t.black, 0);
  fill_exposure({1, 1}, t);
  EXPECT_EQ(t.gain, (target() << 16) / 2048);
}

// The square of a dark picture's gain on chroma has 32 bits: no int holds it.
TEST(Exposure, AModelKeepsItsShapeInTheDark) {
  ExposureTables t;
  fill_exposure({1, 0}, t);
  TerrainModel learned;
  learned.mean = {0, 140 << 8, 100 << 8};
  learned.variance = {1u << 20, 1u << 24, 1u << 26};
  const TerrainModel dark = in_this_light(learned, t);
  const std::uint64_t square = std::uint64_t{t.chroma_gain[0]} * t.chroma_gain[0];
  ASSERT_GT(square, std::uint64_t{1} << 31);
  EXPECT_EQ(dark.variance[1], (std::uint64_t{1} << 40) / square);
  EXPECT_EQ(dark.variance[2], (std::uint64_t{1} << 42) / square);
}

// A model of the normalised ground, back in the light of the frame, has the ground's own luma.
TEST(Exposure, AModelComesBackAboveBlack) {
  ExposureTables t;
  fill_exposure({32 << 8, 8 << 8}, t);
  ASSERT_EQ(t.black, 8);
  TerrainModel learned;
  learned.mean = {static_cast<std::uint16_t>(t.luma[40] << 8), 128 << 8, 128 << 8};
  learned.variance = {1u << 16, 1u << 16, 1u << 16};
  EXPECT_NEAR(in_this_light(learned, t).mean[0] / 256.0, 40, 1);
}

// An oracle in floating point: the mean over the columns and rows in reach that exist, twice.
std::vector<double> box_twice(const test::OwnedGrid& grid, int reach) {
  std::vector<double> now(grid.y.begin(), grid.y.end()), next(now.size());
  for (int time = 0; time < 2; ++time) {
    for (int i = 0; i < grid.height; ++i)
      for (int j = 0; j < grid.width; ++j) {
        double sum = 0;
        int count = 0;
        for (int y = std::max(i - reach, 0); y <= std::min(i + reach, grid.height - 1); ++y)
          for (int x = std::max(j - reach, 0); x <= std::min(j + reach, grid.width - 1); ++x, ++count)
            sum += now[grid.at(y, x)];
        next[grid.at(i, j)] = sum / count;
      }
    now.swap(next);
  }
  return now;
}

TEST(LocalLight, IsTheMeanOfTwoBoxes) {
  std::mt19937 random(7);
  CellBins work;
  for (const auto& [width, height, reach] :
       {std::tuple{1, 1, 1}, {4, 4, 1}, {7, 5, 9}, {53, 30, 10}, {60, 34, 12}, {95, 96, 19}, {300, 4, 60}}) {
    test::OwnedGrid grid(width, height);
    for (auto& y : grid.y)
      y = static_cast<std::uint8_t>(random());
    mean_around(grid, reach, work.half_around, work.sums, work.around);
    const std::vector<double> expected = box_twice(grid, reach);
    for (std::size_t i = 0; i < expected.size(); ++i)
      ASSERT_NEAR(work.around[i], expected[i], 2.1)
          << width << " x " << height << " at " << i; // four roundings
    for (auto& y : grid.y)
      y = 255;
    mean_around(grid, reach, work.half_around, work.sums, work.around);
    ASSERT_TRUE(std::all_of(work.around.begin(), work.around.end(), [](int y) { return y == 255; }));
  }
}

// One ground, its left third in the sun at twice the brightness: in the bins the sunlit part comes three
// eighths of the way to the mean of the frame, and the rest stays as it is.
TEST(LocalLight, BringsBrightPartsTowardsTheMean) {
  test::OwnedGrid grid = test::gray_grid(90, 60, 80);
  for (int i = 0; i < 60; ++i)
    std::fill_n(grid.y.begin() + static_cast<std::ptrdiff_t>(grid.at(i, 0)), 30, std::uint8_t{160});
  const std::uint32_t mean = light_of(grid).mean;
  ASSERT_NEAR(mean / 256.0, 106.7, 0.1);
  ExposureTables none;
  fill_exposure({}, none);
  CellBins as_it_is, flat;
  const std::vector<std::uint16_t> texture(grid.size(), 100);
  bin_cells(grid, texture, none, 0, as_it_is);
  EXPECT_EQ(as_it_is.luma, grid.y);
  bin_cells(grid, texture, none, mean, flat);
  const std::size_t sun = grid.at(30, 2), shade = grid.at(30, 87);
  EXPECT_EQ(flat.luma[shade], 80);
  const double whole = 160 * (106.7 + 8) / (flat.around[sun] + 8);
  EXPECT_NEAR(flat.luma[sun], 160 + (whole - 160) * 3 / 8, 2);
  EXPECT_LT(flat.luma[sun], 150);
  EXPECT_EQ(flat.u, as_it_is.u);
  EXPECT_EQ(flat.v, as_it_is.v);
  for (std::size_t i = 0; i < grid.size(); ++i)
    ASSERT_LE(flat.luma[i], grid.y[i]); // no cell becomes brighter
}

} // namespace
} // namespace terrainseg
