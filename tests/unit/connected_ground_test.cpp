// SPDX-License-Identifier: LGPL-2.1-or-later
#include "freespace/look/connected_ground.hpp"

#include <algorithm>
#include <cmath>
#include <random>

#include <gtest/gtest.h>

#include "support/grids.hpp"

namespace terrainseg {
namespace {

using test::gray_grid;

struct Picture {
  test::OwnedGrid grid;
  CellBins cells;
  std::int16_t& rough(int i, int j) { return cells.roughness[grid.at(i, j)]; }
};

Picture picture(int width, int height, int luma = 100, int rough = 2000) {
  Picture p{gray_grid(width, height, luma), {}};
  p.cells.roughness.assign(p.grid.size(), static_cast<std::int16_t>(rough));
  return p;
}

std::vector<Cell> bottom_middle(const test::OwnedGrid& g) {
  std::vector<Cell> cells;
  for (int j = g.width / 3; j < g.width - g.width / 3; ++j)
    cells.push_back({static_cast<std::int16_t>(j), static_cast<std::int16_t>(g.height - 1)});
  return cells;
}

// The definition in grey levels and octaves, with doubles.
class ByDefinition {
 public:
  explicit ByDefinition(const Picture& p) : p_(p) {}

  struct Difference {
    double luma, chroma, rough; // luma relative to the mean of both and four grey levels
  };
  Difference between(int i, int j, int k, int l) const {
    const auto d = [&](const auto& values) { return std::abs(at(values, i, j) - at(values, k, l)); };
    const test::OwnedGrid& g = p_.grid;
    return {d(g.y) / ((at(g.y, i, j) + at(g.y, k, l)) / 2 + 4), d(g.u) + d(g.v), d(p_.cells.roughness) / 256};
  }
  bool ignored(int i, int j) const { return p_.grid.ignored[p_.grid.at(i, j)] != 0; }
  bool joins(int i, int j, int k, int l) const {
    const Difference d = between(i, j, k, l);
    return ignored(i, j) || ignored(k, l) ||
           (d.luma <= 1.0 / 16 && d.chroma <= 2.25 && d.rough <= 369.0 / 1024);
  }
  bool edge(int r, int j) const { // between rows r - 1 and r
    const Difference d = between(r - 1, j, r, j);
    return ignored(r - 1, j) || ignored(r, j) || d.luma > 0.1 || d.chroma > 4 || d.rough > 616.0 / 1024;
  }

  // Row by row from the lowest seed: whatever a joined cell of this row or the one below leads to.
  std::vector<std::uint8_t> grown(const std::vector<Cell>& seeds) const {
    const test::OwnedGrid& g = p_.grid;
    std::vector<std::uint8_t> joined(g.size(), 0);
    int lowest = -1;
    for (const Cell& s : seeds) {
      joined[g.at(s.y, s.x)] = 1;
      lowest = std::max(lowest, int{s.y});
    }
    for (int i = lowest; i >= 0; --i)
      for (bool changed = true; changed;) {
        changed = false;
        for (int j = 0; j < g.width; ++j)
          for (const auto& [di, dj] : {std::pair{0, -1}, {0, 1}, {1, -1}, {1, 0}, {1, 1}}) {
            const int k = i + di, l = j + dj;
            if (joined[g.at(i, j)] || k > lowest || l < 0 || l >= g.width || !joined[g.at(k, l)] ||
                !joins(i, j, k, l))
              continue;
            joined[g.at(i, j)] = 1;
            changed = true;
          }
      }
    return joined;
  }

  // Of the joined cells those within twelve grey levels of the seeds' chroma, of both together.
  std::vector<std::uint8_t> taught(const std::vector<Cell>& seeds) const {
    const test::OwnedGrid& g = p_.grid;
    std::vector<std::uint8_t> joined = grown(seeds);
    double u = 0, v = 0;
    for (const Cell& s : seeds) {
      u += at(g.u, s.y, s.x) / static_cast<double>(seeds.size());
      v += at(g.v, s.y, s.x) / static_cast<double>(seeds.size());
    }
    u = std::trunc(4 * u + 1e-9) / 4, v = std::trunc(4 * v + 1e-9) / 4; // as the code has them
    for (int i = 0; i < g.height; ++i)
      for (int j = 0; j < g.width; ++j)
        if (std::abs(at(g.u, i, j) - u) + std::abs(at(g.v, i, j) - v) > 12)
          joined[g.at(i, j)] = 0;
    return joined;
  }

  // Of the joined cells those of the seeds' chroma that are no darker than they by more than a sixth.
  std::vector<std::uint8_t> vouched(const std::vector<Cell>& seeds,
                                    const std::vector<std::uint16_t>& texture) const {
    const test::OwnedGrid& g = p_.grid;
    std::vector<std::uint8_t> joined = grown(seeds);
    const auto mean = [&](const auto& value) {
      double sum = 0;
      for (const Cell& s : seeds)
        sum += value(s);
      return sum / static_cast<double>(seeds.size());
    };
    // In quarters of a grey level, whole ones, as the code has them.
    const auto quarters = [&](const auto& plane) {
      return std::trunc(mean([&](const Cell& s) { return 4 * at(plane, s.y, s.x); }));
    };
    const bool dull = mean([&](const Cell& s) { return texture[g.at(s.y, s.x)] / 16.0; }) < 3.5;
    const double y = quarters(g.y), u = quarters(g.u), v = quarters(g.v);
    for (int i = 0; i < g.height; ++i)
      for (int j = 0; j < g.width; ++j)
        if (dull || y - 4 * at(g.y, i, j) > std::trunc((y + 32) / 6) ||
            std::abs(4 * at(g.u, i, j) - u) + std::abs(4 * at(g.v, i, j) - v) > 48)
          joined[g.at(i, j)] = 0;
    return joined;
  }

  std::vector<std::uint8_t> edgeless() const {
    const test::OwnedGrid& g = p_.grid;
    std::vector<std::uint8_t> none(g.size(), 0);
    for (int r = 1; r < g.height; ++r)
      for (int j = 0; j < g.width; ++j) {
        bool any = false;
        for (int k = 1; k < g.height; ++k)
          any |= std::abs(k - r) <= 3 && edge(k, j);
        none[g.at(r, j)] = !any;
      }
    return none;
  }

 private:
  template <typename T> double at(const std::vector<T>& values, int i, int j) const { // smooth along the row
    const test::OwnedGrid& g = p_.grid;
    const double left = values[g.at(i, std::max(j - 1, 0))],
                 right = values[g.at(i, std::min(j + 1, g.width - 1))];
    return (left + 2.0 * values[g.at(i, j)] + right) / 4;
  }

  const Picture& p_;
};

TEST(ConnectedGround, IsWhatTheDefinitionSays) {
  std::mt19937 dice(5);
  const auto up_to = [&](unsigned n) { return static_cast<int>(dice() % n); };
  int joined = 0, apart = 0, vouched = 0, doubted = 0, edgeless = 0, edges = 0;
  for (int round = 0; round < 60; ++round) {
    const int width = 1 + up_to(40), height = 1 + up_to(30), luma = 20 + up_to(200);
    Picture p = picture(width, height, luma);
    const int grain = 1 + up_to(14), chroma = 1 + up_to(4), rough = 1 + up_to(700);
    for (std::size_t i = 0; i < p.grid.size(); ++i) {
      p.grid.y[i] =
          static_cast<std::uint8_t>(std::clamp(p.grid.y[i] + up_to(static_cast<unsigned>(grain)), 0, 255));
      p.grid.u[i] = static_cast<std::uint8_t>(126 + up_to(static_cast<unsigned>(chroma)));
      p.grid.v[i] = static_cast<std::uint8_t>(126 + up_to(static_cast<unsigned>(chroma)));
      p.cells.roughness[i] =
          static_cast<std::int16_t>(1800 + up_to(static_cast<unsigned>(rough)) - (dice() % 9 == 0 ? 500 : 0));
      p.grid.ignored[i] = dice() % 15 == 0;
    }
    std::vector<Cell> seeds;
    for (int k = 0; k < 1 + up_to(8); ++k) {
      const int x = up_to(static_cast<unsigned>(width)), y = up_to(static_cast<unsigned>(height));
      seeds.push_back({static_cast<std::int16_t>(x), static_cast<std::int16_t>(y)});
    }
    ConnectedGround ground;
    ground.look(p.grid, p.cells);
    const auto grown = ground.grow(p.grid, seeds);
    EXPECT_EQ(grown, ByDefinition(p).grown(seeds)) << round;
    EXPECT_EQ(ground.taught(), ByDefinition(p).taught(seeds)) << round;
    std::vector<std::uint16_t> texture(p.grid.size());
    const int least = 10 + up_to(60); // half of the pictures are dull
    for (std::uint16_t& t : texture)
      t = static_cast<std::uint16_t>(least + up_to(40));
    const auto alike = ground.vouched(p.grid, seeds, texture);
    EXPECT_EQ(alike, ByDefinition(p).vouched(seeds, texture)) << round;
    vouched += static_cast<int>(std::count(alike.begin(), alike.end(), 1));
    for (std::size_t i = 0; i < grown.size(); ++i)
      doubted += grown[i] && !alike[i];
    const auto none = ground.edgeless(p.grid);
    EXPECT_EQ(none, ByDefinition(p).edgeless()) << round;
    joined += static_cast<int>(std::count(grown.begin(), grown.end(), 1));
    apart += static_cast<int>(std::count(grown.begin(), grown.end(), 0));
    edgeless += static_cast<int>(std::count(none.begin(), none.end(), 1));
    edges += static_cast<int>(std::count(none.begin(), none.end(), 0));
  }
  for (const int count : {joined, apart, vouched, doubted, edgeless, edges}) // the pictures have both
    EXPECT_GT(count, 1000);
}

TEST(ConnectedGround, AGentleSlopeOfLightIsOneGround) {
  Picture p = picture(40, 30);
  for (int i = 0; i < 30; ++i)
    for (int j = 0; j < 40; ++j)
      p.grid.y[p.grid.at(i, j)] = static_cast<std::uint8_t>(60 + 3 * (29 - i) + j);
  ConnectedGround ground;
  ground.look(p.grid, p.cells);
  const auto& joined = ground.grow(p.grid, bottom_middle(p.grid));
  EXPECT_EQ(std::count(joined.begin(), joined.end(), 1), 40 * 30);
}

TEST(ConnectedGround, EndsAtAStepOfLumaOfColourAndOfRoughness) {
  for (int kind = 0; kind < 3; ++kind) {
    Picture p = picture(40, 30);
    for (int i = 0; i < 12; ++i)
      for (int j = 0; j < 40; ++j) {
        p.grid.y[p.grid.at(i, j)] = kind == 0 ? 85 : 100;
        p.grid.u[p.grid.at(i, j)] = kind == 1 ? 133 : 128;
        p.rough(i, j) = kind == 2 ? 2200 : 2000;
      }
    ConnectedGround ground;
    ground.look(p.grid, p.cells);
    const auto joined = ground.grow(p.grid, bottom_middle(p.grid));
    EXPECT_EQ(std::count(joined.begin(), joined.end(), 1), 40 * 18) << kind;
    EXPECT_EQ(joined[p.grid.at(12, 0)], 1) << kind;
    const auto& edgeless = ground.edgeless(p.grid);
    for (int r = 0; r < 30; ++r)
      EXPECT_EQ(edgeless[p.grid.at(r, 20)], r > 0 && std::abs(r - 12) > 3) << kind << ' ' << r;
  }
}

TEST(ConnectedGround, IsNothingWithoutSeeds) {
  const Picture p = picture(40, 30);
  ConnectedGround ground;
  ground.look(p.grid, p.cells);
  const auto& joined = ground.grow(p.grid, {});
  EXPECT_EQ(std::count(joined.begin(), joined.end(), 0), 40 * 30);
  const auto& taught = ground.taught();
  EXPECT_EQ(std::count(taught.begin(), taught.end(), 0), 40 * 30);
  const auto& vouched = ground.vouched(p.grid, {}, std::vector<std::uint16_t>(p.grid.size(), 500));
  EXPECT_EQ(std::count(vouched.begin(), vouched.end(), 0), 40 * 30);
}

// Twice as light little by little is the same ground, half as light an obstacle's foot may be.
TEST(ConnectedGround, SeedsVouchForMoreLightAndNotForLess) {
  Picture p = picture(40, 30);
  for (int i = 0; i < 30; ++i)
    for (int j = 0; j < 40; ++j)
      p.grid.y[p.grid.at(i, j)] = static_cast<std::uint8_t>(100 + (j < 20 ? 1 : -1) * (29 - i) * 2);
  const std::vector<Cell> left{{10, 29}}, right{{30, 29}};
  const std::vector<std::uint16_t> rough(p.grid.size(), 100), dull(p.grid.size(), 50);
  ConnectedGround ground;
  ground.look(p.grid, p.cells);
  EXPECT_EQ(ground.grow(p.grid, left)[p.grid.at(0, 10)], 1);
  EXPECT_EQ(ground.vouched(p.grid, left, rough)[p.grid.at(0, 10)], 1);
  EXPECT_EQ(ground.vouched(p.grid, left, dull)[p.grid.at(0, 10)], 0);
  EXPECT_EQ(ground.grow(p.grid, right)[p.grid.at(10, 30)], 1);
  EXPECT_EQ(ground.vouched(p.grid, right, rough)[p.grid.at(22, 30)], 1);
  EXPECT_EQ(ground.vouched(p.grid, right, rough)[p.grid.at(10, 30)], 0);
}

// Two grey levels a row are no step, twelve are another colour.
TEST(ConnectedGround, WhatItTeachesHasTheSeedsChroma) {
  Picture p = picture(40, 30);
  for (int i = 0; i < 30; ++i)
    for (int j = 0; j < 40; ++j)
      (j < 20 ? p.grid.u : p.grid.v)[p.grid.at(i, j)] = static_cast<std::uint8_t>(128 + 2 * (29 - i));
  for (const int column : {10, 30}) {
    ConnectedGround ground;
    ground.look(p.grid, p.cells);
    const auto& joined = ground.grow(p.grid, {{static_cast<std::int16_t>(column), 29}});
    const auto& taught = ground.taught();
    for (int i = 0; i < 30; ++i) {
      EXPECT_EQ(joined[p.grid.at(i, column)], 1) << i;
      EXPECT_EQ(taught[p.grid.at(i, column)], i >= 29 - 6) << i;
    }
  }
}

} // namespace
} // namespace terrainseg
