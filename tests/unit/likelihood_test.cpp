// SPDX-License-Identifier: LGPL-2.1-or-later
#include "freespace/score/likelihood.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

#include <gtest/gtest.h>

#include "support/grids.hpp"

namespace terrainseg {
namespace {

constexpr int bin(int y, int u, int v) {
  return (y >> 5) << 8 | (u >> 4) << 4 | v >> 4;
}

CellBins cells_of(const std::vector<std::array<int, 4>>& yuvt) {
  CellBins c;
  for (const auto& cell : yuvt) {
    c.color.push_back(static_cast<std::uint16_t>(bin(cell[0], cell[1], cell[2])));
    c.texture.push_back(static_cast<std::uint8_t>(cell[3]));
  }
  return c;
}

Terrain gray_road() {
  Terrain t;
  TerrainModel m;
  m.mean = {112 << 8, 128 << 8, 128 << 8};
  m.variance = {300 << 8, 180 << 8, 180 << 8};
  m.mass = 100 << 8;
  t.models = {m};
  return t;
}

/// The tables with all colours.
void build(const Terrain& learned, std::span<const TerrainModel> training, int taught_q8,
           const Settings& settings, LikelihoodTables& tables) {
  std::vector<std::uint16_t> all(color_bins);
  std::iota(all.begin(), all.end(), std::uint16_t{0});
  Likelihood likelihood;
  likelihood.build(learned, training, taught_q8, settings, tables);
  likelihood.compute(all, tables);
}

TEST(Likelihood, CountsWhatItIsTold) {
  const CellBins cells = cells_of({{100, 128, 128, 5}, {30, 90, 90, 9}, {30, 90, 90, 9}, {200, 150, 150, 1}});
  Terrain t;
  learn_histograms(cells, {Lesson::terrain, Lesson::against, Lesson::against_little, Lesson::nothing}, 0, t);
  EXPECT_EQ(t.negative_colors[bin(100, 128, 128)], 0u);
  EXPECT_EQ(t.negative_colors[bin(200, 150, 150)], 0u);
  const std::uint32_t one = t.terrain_texture[5];
  EXPECT_GT(one, 0u);
  EXPECT_EQ(t.negative_texture[9],
            one / 2 + one / 8); // two cells share a frame's weight; one counts a quarter
  EXPECT_EQ(t.negative_texture[1], 0u);
}

TEST(Likelihood, EveryFrameWeighsTheSameAndFades) {
  Terrain few, many;
  learn_histograms(cells_of({{9, 9, 9, 3}}), {Lesson::against}, 5, few);
  learn_histograms(cells_of(std::vector<std::array<int, 4>>(1000, {9, 9, 9, 3})),
                   std::vector<Lesson>(1000, Lesson::against), 5, many);
  EXPECT_NEAR(few.negative_texture[3], many.negative_texture[3], few.negative_texture[3] / 500.0);
  const std::uint32_t before = few.negative_texture[3];
  for (int i = 0; i < 300; ++i)
    learn_histograms(cells_of({{200, 9, 9, 8}}), {Lesson::against}, 5, few);
  EXPECT_LT(few.negative_texture[3], before / 1000);
  EXPECT_NEAR(few.negative_texture[8], 32.0 * before, before); // 1 / (1/32)
}

TEST(Likelihood, NeverRunsOver) {
  Terrain t;
  for (int i = 0; i < 5000; ++i)
    learn_histograms(cells_of({{9, 9, 9, 3}}), {Lesson::against}, 0, t);
  EXPECT_GT(t.negative_texture[3], 1u << 28);
  EXPECT_LT(t.negative_texture[3], (1u << 30) + (1u << 21));
}

// The colour table against the formula in floating point.
TEST(Likelihood, IsTheWeightedLogLikelihoodRatio) {
  Terrain t = gray_road();
  std::vector<std::array<int, 4>> rest;
  std::vector<Lesson> lessons;
  for (int i = 0; i < 400; ++i) {
    rest.push_back({40 + i % 100, 100 + i % 50, 110 + i % 40, 4});
    lessons.push_back(Lesson::against);
  }
  learn_histograms(cells_of(rest), lessons, 5, t);
  std::vector<double> blurred(2048, 0);
  double total = 0;
  const auto count = [&](int l, int u, int v) {
    return double(
        t.negative_colors[std::clamp(l, 0, 7) << 8 | std::clamp(u, 0, 15) << 4 | std::clamp(v, 0, 15)]);
  };
  const double w[3] = {1, 2, 1};
  for (int i = 0; i < 2048; ++i) {
    for (int a = -1; a < 2; ++a)
      for (int b = -1; b < 2; ++b)
        for (int c = -1; c < 2; ++c)
          blurred[i] +=
              w[a + 1] * w[b + 1] * w[c + 1] / 64 * count((i >> 8) + a, (i >> 4 & 15) + b, (i & 15) + c);
    total += blurred[i];
  }
  // The prior for ground among the rest, octaves in Q8: less the more of the picture was taught as terrain.
  for (const auto& [taught, prior] : {std::pair{0, 950}, {32, 950}, {48, 625}, {64, 300}, {256, 300}}) {
    LikelihoodTables tables;
    build(t, {}, taught, Settings(), tables);
    for (int i = 0; i < 2048; ++i) {
      const double d[3] = {(i >> 8) * 32 + 16 - 112.0, (i >> 4 & 15) * 16 + 8 - 128.0,
                           (i & 15) * 16 + 8 - 128.0};
      double log2p = 13 + prior / 256.0; // colours of a bin
      for (int c = 0; c < 3; ++c) {
        const double variance = c == 0 ? 300 : 180;
        log2p -= 0.5 * std::log2(2 * M_PI * variance) + d[c] * d[c] / variance / 2 * M_LOG2E;
      }
      const double against = std::log2((blurred[i] + total / 10000) / total);
      const double nats = (std::max(log2p, -3968 / 256.0) - against) * M_LN2;
      const double expected = 0.384 * 32 * nats;
      if (expected < -28 && std::abs(d[1]) + std::abs(d[2]) > 136)
        EXPECT_EQ(tables.color[i], -128) << i; // no light makes such a colour of the road's
      else
        EXPECT_NEAR(tables.color[i], std::clamp(expected, -26.0, 26.0), 1.6) << i << " taught " << taught;
    }
  }
}

TEST(Likelihood, TheNearestModelSpeaks) {
  Terrain one = gray_road(), two = gray_road();
  two.models.push_back(two.models[0]);
  two.models[1].mean = {60 << 8, 160 << 8, 90 << 8};
  LikelihoodTables a, b;
  build(one, {}, 0, Settings(), a);
  build(two, {}, 0, Settings(), b);
  EXPECT_LT(a.color[bin(60, 160, 90)], 0);
  EXPECT_GT(b.color[bin(60, 160, 90)], 0);
  EXPECT_GT(b.color[bin(112, 128, 128)], 0);
}

TEST(Likelihood, WhatIsInTheWindowNowIsTerrain) {
  Terrain memory = gray_road();
  memory.models[0].mass = std::uint64_t{1} << 40; // hours of it
  TerrainModel now = memory.models[0];
  now.mean = {60 << 8, 160 << 8, 90 << 8};
  now.mass = 70 << 8;
  LikelihoodTables before, after;
  build(memory, {}, 0, Settings(), before);
  build(memory, {&now, 1}, 0, Settings(), after);
  EXPECT_LT(before.color[bin(60, 160, 90)], -20);
  EXPECT_GT(after.color[bin(60, 160, 90)], 20);
  EXPECT_EQ(after.color[bin(112, 128, 128)], before.color[bin(112, 128, 128)]);
}

// Whoever is ground in one of both lights is ground in any; the other light speaks with half a share.
TEST(Likelihood, InAnyLightTheOtherOneSpeaksToo) {
  Terrain lit = gray_road(), other = lit;
  lit.models[0].mean[0] = 160 << 8;
  other.models[0] = in_other_light(lit.models[0]);
  LikelihoodTables both, shade;
  build(lit, {}, 0, Settings(), both);
  build(other, {}, 0, Settings(), shade);
  EXPECT_LT(both.color[bin(80, 128, 128)], 0);
  EXPECT_GT(both.any_light[bin(80, 128, 128)], 10);
  const double half_a_share = 0.384 * 32 * std::log(2);
  for (int i = 0; i < 2048; ++i) {
    EXPECT_GE(both.any_light[i], both.color[i]) << i;
    const int further =
        std::abs(shade.color[i]) < 26 // not at the limit
            ? std::max<int>(both.color[i], static_cast<int>(std::lround(shade.color[i] - half_a_share)))
            : both.any_light[i];
    EXPECT_NEAR(both.any_light[i], further, 1.6) << i;
  }
  // The window's own models too.
  Terrain blue = gray_road();
  blue.models[0].mean = {60 << 8, 160 << 8, 90 << 8};
  LikelihoodTables trained;
  build(blue, lit.models, 0, Settings(), trained);
  EXPECT_GT(trained.any_light[bin(80, 128, 128)], trained.color[bin(80, 128, 128)]);
}

TEST(Likelihood, AColorOfNoLightIsNoGroundHoweverSmooth) {
  LikelihoodTables tables;
  build(gray_road(), {}, 0, Settings(), tables);
  const int orange = bin(140, 40, 200), shade = bin(30, 136, 120), white = bin(250, 128, 128);
  for (const auto* table : {&tables.color, &tables.any_light}) {
    EXPECT_EQ((*table)[orange], -128);
    EXPECT_GE((*table)[shade], -26);
    EXPECT_GE((*table)[white], -26);
  }
  // 72 + 72 from grey, 72 + 56.
  EXPECT_EQ(tables.color[bin(112, 200, 200)], -128);
  EXPECT_EQ(tables.color[bin(112, 200, 184)], -26);
  // One model that is near is enough: learned or of this window.
  Terrain carpet = gray_road();
  carpet.models.push_back(carpet.models[0]);
  carpet.models[1].mean = {60 << 8, 40 << 8, 200 << 8};
  build(carpet, {}, 0, Settings(), tables);
  EXPECT_GE(tables.color[orange], -26);
  build(gray_road(), std::span(carpet.models).subspan(1), 0, Settings(), tables);
  EXPECT_GE(tables.color[orange], -26);
  carpet.models[1].mass = 0; // no model
  build(carpet, {}, 0, Settings(), tables);
  EXPECT_EQ(tables.color[orange], -128);
}

TEST(Likelihood, ComputesTheColorsThatAreAskedFor) {
  const Terrain t = gray_road();
  const auto road = static_cast<std::uint16_t>(bin(112, 128, 128)),
             orange = static_cast<std::uint16_t>(bin(140, 40, 200));
  LikelihoodTables all, asked;
  build(t, {}, 0, Settings(), all);
  Likelihood likelihood;
  likelihood.build(t, {}, 0, Settings(), asked);
  const auto compute = [&](std::uint16_t color) { likelihood.compute({&color, 1}, asked); };
  compute(road);
  EXPECT_EQ(asked.color[road], all.color[road]);
  EXPECT_EQ(asked.any_light[road], all.any_light[road]);
  EXPECT_EQ(asked.color[orange], 0);
  compute(orange);
  EXPECT_EQ(asked.color[orange], -128);
  // Another terrain makes all of them stale.
  Terrain bright = t;
  bright.models[0].mean[0] = 240 << 8;
  build(bright, {}, 0, Settings(), all);
  likelihood.build(bright, {}, 0, Settings(), asked);
  compute(road);
  EXPECT_EQ(asked.color[road], all.color[road]);
  EXPECT_LT(asked.color[road], 0);
}

TEST(Likelihood, TextureIsForWhatTheWindowShows) {
  Terrain t = gray_road();
  std::vector<std::array<int, 4>> cells;
  std::vector<Lesson> lessons;
  for (int i = 0; i < 100; ++i) {
    cells.push_back({100, 128, 128, i % 2 ? 4 : 17});
    lessons.push_back(i % 2 ? Lesson::terrain : Lesson::against);
  }
  learn_histograms(cells_of(cells), lessons, 5, t);
  LikelihoodTables tables;
  build(t, {}, 0, Settings(), tables);
  EXPECT_GT(tables.texture[4], 60);
  EXPECT_LT(tables.texture[17], -60);
  EXPECT_NEAR(tables.texture[4], -tables.texture[17], 2);
  Settings without;
  without.texture = false;
  build(t, {}, 0, without, tables);
  for (const int v : tables.texture)
    EXPECT_EQ(v, 0);
}

TEST(Likelihood, WhatIsVouchedForIsNeverAgainst) {
  const CellBins cells = cells_of({{100, 128, 128, 5}, {30, 90, 90, 9}, {30, 90, 90, 9}, {200, 150, 150, 1}});
  const test::OwnedGrid grid = test::gray_grid(4, 1);
  LikelihoodTables tables{};
  tables.color[cells.color[0]] = 20;
  tables.color[cells.color[1]] = -20;
  tables.texture.fill(-40);
  tables.texture[5] = 15;
  const CellPenalties none{0, 0, 0, 0};
  CellScores score;
  score_cells(grid, cells, tables, none, {}, {}, score);
  EXPECT_EQ(score, (CellScores{16 * 35, 16 * -48, 16 * -48, 16 * -40}));
  const std::vector<std::uint8_t> vouched{1, 1, 0, 1};
  const std::vector<Cell> ground{{0, 0}}, both{{0, 0}, {3, 0}};
  score_cells(grid, cells, tables, none, {vouched, ground}, {}, score);
  EXPECT_EQ(score, (CellScores{16 * 35, 16 * 24, 16 * -48, 16 * 24}));
  // Seeds that are hardly ground themselves: (35 - 40) / 2.
  score_cells(grid, cells, tables, none, {vouched, both}, {}, score);
  EXPECT_EQ(score, (CellScores{16 * 35, 16 * -2, 16 * -48, 16 * -2}));
}

TEST(Likelihood, AheadTheGroundMayLieInAnotherLight) {
  // Two rows of five cells; the columns 1 to 3 lie ahead.
  const CellBins cells = cells_of({{100, 128, 128, 5},
                                   {100, 128, 128, 5},
                                   {30, 90, 90, 5},
                                   {30, 90, 90, 5},
                                   {30, 90, 90, 5},
                                   {30, 90, 90, 5},
                                   {100, 128, 128, 5},
                                   {200, 150, 150, 5},
                                   {30, 90, 90, 5},
                                   {100, 128, 128, 5}});
  test::OwnedGrid grid = test::gray_grid(5, 2);
  grid.ignored[grid.at(1, 1)] = 1;
  LikelihoodTables tables{};
  tables.color.fill(-20);
  tables.any_light.fill(-20);
  tables.color[cells.color[0]] = tables.any_light[cells.color[0]] = 25; // not the largest evidence
  tables.any_light[cells.color[2]] = 26;
  const CellPenalties penalty{7, 7, 7, 0, 7, 7, 7, 7, 8, 7};
  CellScores score;
  score_cells(grid, cells, tables, penalty, {}, {1, 4}, score);
  EXPECT_EQ(score, (CellScores{16 * 18, 16 * 18, 16 * (26 - 3), 16 * 26, 16 * -27, //
                               16 * -27, 0, 16 * -27, 16 * (26 - 4), 16 * 18}));
  score_cells(grid, cells, tables, penalty, {}, {}, score);
  EXPECT_EQ(score, (CellScores{16 * 18, 16 * 18, 16 * -27, 16 * -20, 16 * -27, //
                               16 * -27, 0, 16 * -27, 16 * -28, 16 * 18}));
}

} // namespace
} // namespace terrainseg
