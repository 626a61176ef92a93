// SPDX-License-Identifier: LGPL-2.1-or-later
#include "freespace/curve/boundary.hpp"

#include <algorithm>
#include <cmath>
#include <random>

#include <gtest/gtest.h>

#include "support/grids.hpp"

namespace terrainseg {
namespace {

using Curve = GridCurve;

test::OwnedGrid random_grid(int width, int height, std::mt19937& dice) {
  test::OwnedGrid g = test::gray_grid(width, height);
  for (auto* plane : {&g.y, &g.u, &g.v})
    for (auto& sample : *plane)
      sample = static_cast<std::uint8_t>(dice() % 3 ? 128 + dice() % 8 : dice() % 256);
  for (auto& i : g.ignored)
    i = dice() % 9 == 0;
  return g;
}

// What a curve is worth by the definition, written apart from the search: floor and table apart, in floating
// point.
double worth(const test::OwnedGrid& g, const CellScores& score, const RowPriors& prior, int gain,
             const Curve& before, bool behind, const Curve& curve,
             const std::vector<std::uint8_t>& edgeless = {}) {
  const auto step = [&](int i, int j, int k, int l) {
    const auto a = g.at(i, j), b = g.at(k, l);
    return std::min(std::floor((std::abs(g.y[a] - g.y[b]) + 2.0 * std::abs(g.u[a] - g.u[b]) +
                                2.0 * std::abs(g.v[a] - g.v[b])) *
                               gain / 256),
                    1023.0);
  };
  double sum = 0;
  for (int j = 0; j < g.width; ++j) {
    for (int i = 0; i < g.height; ++i) {
      const double s = score[g.at(i, j)] / 16.0 + prior[i];
      sum += i >= curve[j] ? s : -s;
    }
    const int r = curve[j];
    if (r > 0 && r < g.height && !g.ignored[g.at(r, j)] && !g.ignored[g.at(r - 1, j)]) {
      sum += std::min(288.0, 88 * std::log2((step(r, j, r - 1, j) + 4) / 4));
      sum +=
          std::clamp(10.0 * std::floor((g.y[g.at(r, j)] - g.y[g.at(r - 1, j)]) * gain / 256.0), 0.0, 215.0);
    }
    if (r < g.height && !edgeless.empty() && edgeless[g.at(r, j)])
      sum -= 360;
    double stretch = 0; // the best one above the curve with a row between them
    for (int first = 0; behind && first < r - 1; ++first) {
      double turned = -360;
      for (int i = first; i < r - 1; ++i) {
        turned += 2 * (score[g.at(i, j)] / 16.0 + prior[i]);
        stretch = std::max(stretch, turned);
      }
    }
    sum += stretch;
    if (!before.empty())
      sum -= 80 * std::min(std::abs(r - before[j]), 3);
    if (j > 0)
      for (int i = std::min(curve[j], curve[j - 1]); i < std::max(curve[j], curve[j - 1]); ++i)
        sum -= std::max(0.0, 140 - 72 * std::log2((step(i, j, i, j - 1) + 32) / 32));
  }
  return sum;
}

void find(const test::OwnedGrid& g, const CellScores& score, const RowPriors& prior, int gain,
          const Curve& before, bool behind, Curve& found, const std::vector<std::uint8_t>& edgeless = {}) {
  BoundarySearch search;
  search.look(g, test::color_steps_of(g, gain), gain, before);
  if (!edgeless.empty())
    search.price_edgeless(g, edgeless);
  search.find(g, score, prior, behind, found);
}

TEST(Boundary, NoCurveIsBetter) {
  std::mt19937 dice(7);
  for (int round = 0; round < 60; ++round) {
    const int width = 1 + static_cast<int>(dice() % 4), height = 1 + static_cast<int>(dice() % 8);
    const test::OwnedGrid g = random_grid(width, height, dice);
    CellScores score;
    RowPriors prior;
    for (int i = 0; i < width * height; ++i) // a few nats now and then, so that a stretch behind pays
      score.push_back(
          static_cast<std::int16_t>((static_cast<int>(dice() % 1537) - 768) * (dice() % 2 ? 1 : 3)));
    for (int i = 0; i < height; ++i)
      prior.push_back(static_cast<std::int16_t>(static_cast<int>(dice() % 65) - 32));
    const int gain = 128 + static_cast<int>(dice() % 512);
    const bool behind = round % 3 != 0;
    Curve before, found, curve(static_cast<std::size_t>(width), 0), best;
    if (round % 2)
      for (int j = 0; j < width; ++j)
        before.push_back(static_cast<std::uint16_t>(dice() % (height + 1)));
    std::vector<std::uint8_t> edgeless;
    if (round % 4 > 1)
      for (std::size_t i = 0; i < g.size(); ++i)
        edgeless.push_back(dice() % 2);
    find(g, score, prior, gain, before, behind, found, edgeless);
    ASSERT_EQ(found.size(), static_cast<std::size_t>(width));
    double most = -1e18;
    for (;;) { // all (height + 1)^width curves
      const double w = worth(g, score, prior, gain, before, behind, curve, edgeless);
      if (w > most) {
        most = w;
        best = curve;
      }
      int j = 0;
      while (j < width && curve[j] == height)
        curve[j++] = 0;
      if (j == width)
        break;
      ++curve[j];
    }
    // The tables round: a tie may fall either way.
    EXPECT_NEAR(worth(g, score, prior, gain, before, behind, found, edgeless), most, 1.0 + 2.0 * width)
        << width << 'x' << height;
  }
}

TEST(Boundary, AllAndNothing) {
  const test::OwnedGrid g = test::gray_grid(20, 12);
  const RowPriors prior(12, 0);
  Curve curve;
  find(g, CellScores(240, 300), prior, 256, {}, false, curve);
  EXPECT_EQ(curve, Curve(20, 0));
  find(g, CellScores(240, -300), prior, 256, {}, false, curve);
  EXPECT_EQ(curve, Curve(20, 12));
}

// The values of whole curves exceed 32 bits: a frame of 1400 x 1000 at pyramid-levels=0 with the largest
// caution.
TEST(Boundary, AllAndNothingOnALargeGrid) {
  const test::OwnedGrid g = test::gray_grid(1400, 1000);
  Curve curve;
  find(g, CellScores(g.size(), 768), RowPriors(1000, 132), 256, {}, false, curve);
  EXPECT_EQ(curve, Curve(1400, 0));
  find(g, CellScores(g.size(), -768), RowPriors(1000, -132), 256, {}, true, curve);
  EXPECT_EQ(curve, Curve(1400, 1000));
}

TEST(Boundary, FollowsAnUprightEdgeMoreReadilyThanNone) {
  // A narrow obstacle with weak scores: found where the picture shows its sides, smoothed away where it does
  // not.
  CellScores score(20 * 20, 0);
  RowPriors prior(20, 0);
  for (int i = 0; i < 20; ++i)
    for (int j = 0; j < 20; ++j)
      score[static_cast<std::size_t>(i * 20 + j)] = i < 8 ? -400 : j >= 8 && j < 11 && i < 14 ? -250 : 400;
  test::OwnedGrid seen = test::gray_grid(20, 20);
  for (int i = 8; i < 14; ++i)
    for (int j = 8; j < 11; ++j)
      seen.u[seen.at(i, j)] = 220;
  Curve with, without;
  find(test::gray_grid(20, 20), score, prior, 256, {}, false, without);
  find(seen, score, prior, 256, {}, false, with);
  EXPECT_EQ(without[9], 8);
  EXPECT_EQ(with[9], 14);
  EXPECT_EQ(with[2], 8);
}

TEST(Boundary, CutsOutAnObstacleOnOpenGround) {
  // A dark wall as high as the ground that is seen behind it: one curve alone prefers to run over both.
  CellScores score(20 * 20, 0);
  RowPriors prior(20, 0);
  test::OwnedGrid g = test::gray_grid(20, 20);
  for (int i = 0; i < 20; ++i)
    for (int j = 0; j < 20; ++j) {
      const bool ground = i >= 2 && (j < 4 || i < 10 || i >= 15);
      score[g.at(i, j)] = ground ? 760 : -760;
      g.y[g.at(i, j)] = ground ? 100 : 30;
    }
  Curve whole, cut;
  find(g, score, prior, 256, {}, false, whole);
  find(g, score, prior, 256, {}, true, cut);
  EXPECT_EQ(whole[9], 2);
  EXPECT_EQ(cut[9], 15);
  EXPECT_EQ(cut[18], 15);
  EXPECT_EQ(cut[2], 2);
}

} // namespace
} // namespace terrainseg
