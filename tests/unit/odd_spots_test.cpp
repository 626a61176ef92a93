// SPDX-License-Identifier: LGPL-2.1-or-later
#include "freespace/holes/odd_spots.hpp"

#include <algorithm>
#include <cmath>
#include <random>
#include <set>

#include <gtest/gtest.h>

#include "base/lattice.hpp"
#include "scene/scene.hpp"
#include "support/frames.hpp"
#include "terrainseg/segmenter.hpp"

namespace terrainseg {
namespace {

using Bytes = std::vector<std::uint8_t>;

/// A picture in full-range BT.601 whose pyramid is searched at `level`, and a ground with straight edges.
struct Scene {
  Scene(int width, int height, int level, const test::Painter& painter)
      : owned(PixelFormat::Y444, width, height, painter, 0) {
    owned.frame().colorimetry = {ColorRange::full, ColorMatrix::bt601};
    pyramid.build(owned.frame(), {level + 1, 0, 0});
    view.level = level;
    view.horizon = 70;
    curves.boundary.assign(static_cast<std::size_t>(width), static_cast<std::uint16_t>(height * 3 / 10));
    curves.safe = curves.boundary;
  }
  bool find() {
    return spots.find(pyramid, color_transform_of(false, owned.frame().colorimetry), curves, view,
                      found.holes);
  }
  std::uint8_t oddness(int row, int column) const {
    return spots.oddness().values[static_cast<std::size_t>(row * spots.oddness().stride + column)];
  }
  bool spot(int row, int column) const {
    return spots.spots()[static_cast<std::size_t>(row * spots.oddness().stride + column)] != 0;
  }

  test::OwnedFrame owned;
  Pyramid pyramid;
  FreeSpaceCurves curves;
  GroundView view;
  OddSpots spots;
  Detection found;
};

/// The definition with doubles: every box summed by itself, deviations by square roots.
class ByDefinition {
 public:
  explicit ByDefinition(const Scene& s)
      : s_(s), w_(s.spots.oddness().width), h_(s.spots.oddness().height),
        horizon_(static_cast<int>(s.view.horizon) * s.pyramid.height(s.view.level) / 256) {}

  bool ground(int i, int j) const {
    const int k = s_.view.level, half = (1 << k) / 2;
    const auto x = static_cast<std::size_t>((j << k) >> s_.curves.level);
    const auto row = [&](int edge) { return (edge + half) >> k; };
    for (const Rectangle& r : s_.view.ignored)
      if (contains(r, j << k, i << k))
        return false;
    const FreeSpaceCurves& c = s_.curves;
    return i >= row(c.safe[x]) ||
           (c.ground_behind && i >= row(c.behind_first[x]) && i < row(c.behind_end[x]));
  }

  /// Deviations from both sides, per component, and whether luma is darker than both.
  struct Deviation {
    double y = 0, u = 0, v = 0;
    bool dark = true;
  };
  const Deviation& deviation(int i, int j) const {
    if (known_.empty())
      for (int y = 0; y < h_; ++y)
        for (int x = 0; x < w_; ++x)
          known_.push_back(measured(y, x));
    return known_[at(i, j)];
  }

  /// A cell's oddness in sixteenths of a deviation, `dark_below` being told.
  double oddness(const Deviation& d, bool dark_below) const {
    const double y = std::min(16 * d.y, 127.0) / (d.dark || dark_below ? 1 : 4),
                 u = std::min(16 * d.u, 127.0), v = std::min(16 * d.v, 127.0);
    return std::min((std::max({y, u, v}) + y + u + v) / 2, 96.0);
  }

  /// Something darker than both sides by a deviation, within a sixth of the distance below, a column aside.
  bool dark_below(int i, int j, double enough) const {
    const int reach = std::max(10 * std::max(i - horizon_, least()) / 64, 1);
    for (int k = i; k <= std::min(i + reach, h_ - 1); ++k)
      for (int l = std::max(j - 1, 0); l <= std::min(j + 1, w_ - 1); ++l)
        if (const Deviation d = deviation(k, l); ground(k, l) && d.dark && 16 * d.y > enough)
          return true;
    return false;
  }

  /// Seeds, growth and components of the code's own oddness.
  Bytes spots() const {
    const auto mean_over = [&](int i, int j, int parts, const auto& value) {
      const int reach = std::max((parts * std::max(i - horizon_, least()) + 32) / 64, 1);
      double sum = 0;
      for (int y = std::max(i - reach, 0); y <= std::min(i + reach, h_ - 1); ++y)
        for (int x = std::max(j - reach, 0); x <= std::min(j + reach, w_ - 1); ++x)
          sum += value(y, x);
      return sum;
    };
    const auto candidate = [&](int i, int j) { return s_.oddness(i, j) >= 31; };
    Bytes seed(static_cast<std::size_t>(w_ * h_), 0), odd = seed;
    for (int i = 0; i < h_; ++i)
      for (int j = 0; j < w_; ++j)
        seed[at(i, j)] =
            candidate(i, j) &&
            mean_over(i, j, 3, [&](int y, int x) { return s_.oddness(y, x); }) >=
                (s_.view.rows > 0 ? 44 : 48) * mean_over(i, j, 3, [&](int y, int x) { return ground(y, x); });
    for (int i = 0; i < h_; ++i)
      for (int j = 0; j < w_; ++j)
        odd[at(i, j)] =
            candidate(i, j) && mean_over(i, j, 4, [&](int y, int x) { return seed[at(y, x)]; }) > 0;
    int first = h_;
    for (int i = h_ - 1; i >= 0; --i)
      for (int j = 0; j < w_; ++j)
        first = ground(i, j) ? i : first;
    // What touches the boundary from below goes, and what touches that.
    Bytes gone(odd.size(), 0);
    for (bool changed = true; changed;) {
      changed = false;
      for (int i = 0; i < h_; ++i)
        for (int j = 0; j < w_; ++j) {
          if (!odd[at(i, j)] || gone[at(i, j)])
            continue;
          bool goes = i > first && !ground(i - 1, j);
          for (int y = std::max(i - 1, 0); y <= std::min(i + 1, h_ - 1); ++y)
            for (int x = std::max(j - 1, 0); x <= std::min(j + 1, w_ - 1); ++x)
              goes |= odd[at(y, x)] && gone[at(y, x)];
          gone[at(i, j)] = goes;
          changed |= goes;
        }
    }
    for (std::size_t c = 0; c < odd.size(); ++c)
      odd[c] &= !gone[c];
    return odd;
  }

 private:
  /// Rows below the horizon: no size is that of a lesser distance, nor of one under 24 in a search far away.
  int least() const { return s_.view.rows > 0 ? 24 : 2; }
  Deviation measured(int i, int j) const {
    // From the last row on two rows of blocks share the boxes of the lower one.
    const int last = h_ / 2, I = last - (last - (i + 1) / 2) / 2 * 2, J = (j + 1) / 2;
    const int d = std::max(2 * I - horizon_, least()), size = (10 * d / 16 + 1) / 2;
    const int reach = std::max(size, 2), rows = std::max(size, 1);
    const int top = std::max(I - rows, 0), bottom = std::min(I + rows, h_ / 2);
    const Box left = box(top, bottom, J - reach, J - 1), right = box(top, bottom, J + 1, J + reach),
              whole = box(top, bottom, J - reach, J + reach);
    const double full = 4.0 * reach * (bottom - top + 1);
    Deviation out;
    std::array<double*, 3> z{&out.y, &out.u, &out.v};
    const bool blind = left.n * 8 < full || right.n * 8 < full;
    for (int c = 0; c < 3; ++c) {
      const double x = value(c, i, j), a = x - left.mean(c), b = x - right.mean(c), floor = c == 0 ? 5 : 2;
      if (c == 0)
        out.dark = !blind && std::max(a, b) < 0;
      if (!blind && a * b > 0)
        *z[static_cast<std::size_t>(c)] =
            std::min(std::abs(a), std::abs(b)) / std::sqrt(whole.variance(c) + floor * floor);
    }
    return out;
  }

  struct Box {
    double n = 0;
    std::array<double, 3> sum{}, squares{};
    double mean(int c) const { return sum[static_cast<std::size_t>(c)] / n; }
    double variance(int c) const { return squares[static_cast<std::size_t>(c)] / n - mean(c) * mean(c); }
  };
  Box box(int top, int bottom, int left, int right) const { // in blocks, ends included
    Box b;
    for (int i = std::max(2 * top - 1, 0); i <= std::min(2 * bottom, h_ - 1); ++i)
      for (int j = std::max(2 * left - 1, 0); j <= std::min(2 * right, w_ - 1); ++j)
        if (ground(i, j)) {
          ++b.n;
          for (int c = 0; c < 3; ++c) {
            b.sum[static_cast<std::size_t>(c)] += value(c, i, j);
            b.squares[static_cast<std::size_t>(c)] += value(c, i, j) * value(c, i, j);
          }
        }
    return b;
  }
  double value(int c, int i, int j) const { return s_.pyramid.plane(s_.view.level, c).row(i)[j]; }
  std::size_t at(int i, int j) const { return static_cast<std::size_t>(i * w_ + j); }

  const Scene& s_;
  int w_, h_, horizon_;
  mutable std::vector<Deviation> known_;
};

std::uint8_t grain(int x, int y, int z) {
  std::uint32_t h = static_cast<std::uint32_t>(x) * 73856093u ^ static_cast<std::uint32_t>(y) * 19349663u ^
                    static_cast<std::uint32_t>(z) * 83492791u;
  h ^= h >> 13;
  h *= 0x5bd1e995;
  return static_cast<std::uint8_t>((h ^ h >> 15) & 7);
}

/// Sand with a grain, `stone` in a box of it.
test::Painter sand(Rectangle box, std::array<int, 3> stone) {
  return [=](int x, int y) -> test::Components {
    const bool in = contains(box, x, y);
    const auto value = [&](int even, int c) {
      return static_cast<std::uint8_t>((in ? stone[static_cast<std::size_t>(c)] : even) + grain(x, y, c));
    };
    return {value(120, 0), value(120, 1), value(136, 2)};
  };
}

TEST(OddSpots, AreWhatTheDefinitionSays) {
  std::mt19937 dice(3);
  int odd = 0, light = 0, spots = 0;
  for (int round = 0; round < 6; ++round) {
    const int level = round % 3, width = (60 + static_cast<int>(dice() % 25)) << level,
              height = (40 + static_cast<int>(dice() % 15)) << level;
    std::vector<std::pair<Rectangle, std::array<int, 3>>> stones;
    for (int n = 0; n < 9; ++n)
      stones.push_back(
          {{static_cast<int>(dice() % static_cast<unsigned>(width)),
            static_cast<int>(dice() % static_cast<unsigned>(height)),
            (2 + static_cast<int>(dice() % 5)) << level, (2 + static_cast<int>(dice() % 4)) << level},
           {40 + static_cast<int>(dice() % 170), 110 + static_cast<int>(dice() % 25),
            125 + static_cast<int>(dice() % 25)}});
    Scene s(width, height, level, [&](int x, int y) {
      test::Components color = sand({}, {})(x, y);
      color[0] = static_cast<std::uint8_t>(color[0] + x * 20 / width);
      for (const auto& [box, stone] : stones)
        if (contains(box, x, y))
          for (std::size_t c = 0; c < 3; ++c)
            color[c] = static_cast<std::uint8_t>(stone[c] + grain(x, y, static_cast<int>(c)));
      return color;
    });
    for (int x = 0; x < width; ++x)
      s.curves.safe[static_cast<std::size_t>(x)] =
          static_cast<std::uint16_t>(height * (3 + (x * 5 / width) % 2) / 10);
    if (round % 2) {
      s.curves.ground_behind = true;
      s.curves.behind_first.assign(static_cast<std::size_t>(width), static_cast<std::uint16_t>(height / 5));
      s.curves.behind_end.assign(static_cast<std::size_t>(width), static_cast<std::uint16_t>(height / 5));
      for (int x = width / 2; x < width * 3 / 4; ++x)
        s.curves.behind_end[static_cast<std::size_t>(x)] = static_cast<std::uint16_t>(height / 4);
    }
    const std::vector<Rectangle> ignored{{width / 8, height * 3 / 4, width / 9, height / 6}};
    if (round > 0 && round < 4) // at every level
      s.view.ignored = ignored;
    if (round % 3 == 1)
      s.view.rows = 20; // what lies below takes no part
    const bool any = s.find();
    const int all = s.pyramid.height(level), horizon = 70 * all / 256;
    ASSERT_EQ(s.spots.oddness().height, s.view.rows > 0 ? std::min(horizon + 20, all) : all);
    const ByDefinition truth(s);
    for (int i = 0; i < s.spots.oddness().height; ++i)
      for (int j = 0; j < s.spots.oddness().width; ++j) {
        if (!truth.ground(i, j)) {
          ASSERT_EQ(s.oddness(i, j), 0) << i << ' ' << j;
          continue;
        }
        const auto d = truth.deviation(i, j);
        // Whether something below is dark enough may fall either way at the limit.
        const double with = truth.oddness(d, truth.dark_below(i, j, 17)),
                     without = truth.oddness(d, truth.dark_below(i, j, 15));
        const int said = s.oddness(i, j);
        // Four values are rounded down, and a root is good to a hundredth.
        const auto near = [said](double truth) { return std::abs(said - truth) <= 4 + truth / 30; };
        ASSERT_TRUE(near(with) || near(without))
            << round << ": " << i << ' ' << j << ": " << said << " for " << with << ", " << without;
        odd += said >= 24;
        light += !d.dark && d.y > 2;
      }
    Bytes said;
    for (int i = 0; i < s.spots.oddness().height; ++i)
      for (int j = 0; j < s.spots.oddness().width; ++j)
        said.push_back(s.spot(i, j));
    EXPECT_EQ(said, any ? truth.spots() : Bytes(said.size(), 0)) << round;
    EXPECT_EQ(any, std::count(said.begin(), said.end(), 1) > 0);
    spots += static_cast<int>(std::count(said.begin(), said.end(), 1));
  }
  EXPECT_GT(odd, 500); // the pictures have all of it
  EXPECT_GT(light, 50);
  EXPECT_GT(spots, 140);
}

TEST(OddSpots, ADarkStoneIsOneAndPaintIsNot) {
  const Rectangle box{60, 60, 12, 10};
  Scene stone(160, 120, 1, sand(box, {50, 120, 136})), paint(160, 120, 1, sand(box, {220, 120, 136})),
      colored(160, 120, 1, sand(box, {120, 120, 160}));
  ASSERT_TRUE(stone.find());
  EXPECT_TRUE(stone.spot(32, 33));
  EXPECT_FALSE(stone.spot(32, 10));
  EXPECT_FALSE(paint.find());
  ASSERT_TRUE(colored.find());
  EXPECT_TRUE(colored.spot(32, 33));
}

TEST(OddSpots, AShadowsEdgeAndASlopeOfLightAreNot) {
  Scene edge(160, 120, 1, [](int x, int y) -> test::Components {
    test::Components color = sand({}, {})(x, y);
    color[0] = static_cast<std::uint8_t>(color[0] / (x > 90 ? 2 : 1));
    return color;
  });
  EXPECT_FALSE(edge.find());
  Scene slope(160, 120, 1, [](int x, int y) -> test::Components {
    test::Components color = sand({}, {})(x, y);
    color[0] = static_cast<std::uint8_t>(color[0] - 60 + x * 2 / 3);
    return color;
  });
  EXPECT_FALSE(slope.find());
}

TEST(OddSpots, WhatTouchesTheBoundaryIsTheBoundarysMatter) {
  const Rectangle box{60, 30, 12, 12};
  Scene s(160, 120, 1, sand(box, {50, 120, 136})); // begins above the ground's first row, 36
  EXPECT_FALSE(s.find());
}

TEST(OddSpots, RowsThatAreSkippedAreNotSearched) {
  Scene s(160, 120, 1, sand({60, 60, 12, 10}, {50, 120, 136})); // rows 30 to 34 of cells, the horizon is 16
  for (const int skipped : {0, 1, 10, 13}) {
    s.view.skipped = skipped;
    EXPECT_TRUE(s.find()) << skipped;
    EXPECT_TRUE(s.spot(32, 33)) << skipped;
  }
  for (const int skipped : {20, 43, 44, 1000}) { // the picture ends at row 60
    s.view.skipped = skipped;
    EXPECT_FALSE(s.find()) << skipped;
    EXPECT_EQ(s.oddness(32, 33), 0) << skipped;
    EXPECT_FALSE(s.spot(32, 33)) << skipped;
  }
}

TEST(OddSpots, WhatStandsNearestIsSeenToo) {
  const Rectangle box{74, 107, 10, 8}; // where the training window lies
  Scene s(160, 120, 1, sand(box, {50, 120, 136}));
  EXPECT_TRUE(s.find());
}

TEST(OddSpots, AreDoubtfulInTheMaskAndEndTheFreeSpace) {
  Scene s(160, 120, 1, sand({60, 60, 12, 10}, {50, 120, 136}));
  ASSERT_TRUE(s.find());
  Bytes mask(160 * 120, mask_traversable);
  mask[65 * 160 + 66] = mask_not_traversable;
  const std::uint64_t turned = mark(s.found, {mask.data(), 160}, 160, 120, 0);
  EXPECT_EQ(turned, static_cast<std::uint64_t>(std::count(mask.begin(), mask.end(), mask_doubtful)));
  EXPECT_EQ(mask[65 * 160 + 66], mask_not_traversable);
  FrameCurve rows;
  rows.assign(160, 36);
  lower_below(s.found, 0, rows);
  for (int x = 0; x < 160; ++x) {
    int lowest = 35;
    for (int y = 0; y < 120; ++y)
      if (mask[static_cast<std::size_t>(y * 160 + x)] == mask_doubtful)
        lowest = y;
    if (x == 66)
      continue; // its not traversable pixel hides nothing of the others, but may be the lowest
    EXPECT_EQ(rows[static_cast<std::size_t>(x)], std::max(lowest + 1, 36)) << x;
  }
  EXPECT_EQ(mask[65 * 160 + 62], mask_doubtful);
  EXPECT_EQ(mask[65 * 160 + 20], mask_traversable);
}

TEST(OddSpots, ThatMoveAsTheGroundAllOverAreDropped) {
  Scene s(160, 120, 1, sand({60, 60, 12, 10}, {50, 120, 136}));
  // Cells of 4 x 4 pixels; the spot lies in columns 15 to 17 and rows 15 to 17 of them.
  std::vector<std::int16_t> evidence(40 * 30, 0);
  const FinerCells<std::int16_t> motion{evidence, 40, 30, 2, 2, 40};
  const auto left_with = [&](int everywhere, int of_one) {
    EXPECT_TRUE(s.find());
    std::fill(evidence.begin(), evidence.end(), static_cast<std::int16_t>(everywhere));
    evidence[16 * 40 + 16] = static_cast<std::int16_t>(of_one);
    const bool left = s.spots.drop_flat(motion, s.found.holes);
    Bytes mask(160 * 120, mask_traversable);
    EXPECT_EQ(mark(s.found, {mask.data(), 160}, 160, 120, 0) > 0, left);
    return left;
  };
  EXPECT_FALSE(left_with(-90, -90));
  EXPECT_FALSE(left_with(-90, -20));
  EXPECT_TRUE(left_with(-90, -19)) << "a part may stand";
  EXPECT_TRUE(left_with(-39, -39)) << "not clearly flat";
  EXPECT_TRUE(left_with(0, -192));
  ASSERT_TRUE(s.find());
  EXPECT_TRUE(s.spots.drop_flat({}, s.found.holes)) << "nothing is known of motion";
  EXPECT_TRUE(s.spot(32, 33));
}

TEST(OddSpots, FindStonesOnARenderedPlain) {
  scene::Renderer renderer({scene::Kind::plain, scene::Light::day, scene::Motion::straight, 5, 80}, 640, 360);
  scene::Picture picture(PixelFormat::I420, 640, 360);
  Settings off;
  off.odd_spots = false;
  Segmenter with({}), without(off);
  long found = 0, lost = 0, ground = 0;
  for (std::uint64_t i = 0; i < 8; ++i) {
    renderer.render(10 * i, picture);
    ASSERT_TRUE(with.process(picture.frame()).ok());
    ASSERT_TRUE(without.process(picture.frame()).ok());
    const GrayView a = with.estimate().mask, b = without.estimate().mask, labels = picture.labels();
    for (int y = 0; y < 360; ++y)
      for (int x = 0; x < 640; ++x) {
        const bool hole = a.plane.row(y)[x] == mask_doubtful && b.plane.row(y)[x] == mask_traversable;
        const std::uint8_t label = labels.plane.row(y)[x];
        found += hole && label == scene::not_traversable;
        lost += hole && label == scene::driven_terrain;
        ground += label == scene::driven_terrain;
      }
    EXPECT_LE(with.estimate().traversable_permille, without.estimate().traversable_permille);
  }
  EXPECT_GT(found, 1000);
  EXPECT_LT(lost * 100, ground * 3);
}

// A stone of a hand's size ten metres away is smaller than a cell of the coarse search.
TEST(OddSpots, FindFarStonesOnARenderedPlain) {
  scene::Renderer renderer({scene::Kind::plain, scene::Light::day, scene::Motion::straight, 301, 80}, 640,
                           360);
  scene::Picture picture(PixelFormat::I420, 640, 360);
  Segmenter segmenter({});
  long stones = 0, found = 0;
  for (std::uint64_t i = 0; i < 8; ++i) {
    renderer.render(10 * i, picture);
    ASSERT_TRUE(segmenter.process(picture.frame()).ok());
    const GrayView mask = segmenter.estimate().mask, labels = picture.labels();
    const int horizon = segmenter.estimate().horizon_row;
    for (int y = horizon + 4; y < horizon + 60; ++y)
      for (int x = 0; x < 640; ++x) {
        // Below the boundary: what lies above it is not for spots to find.
        const bool stone =
            labels.plane.row(y)[x] == scene::not_traversable && mask.plane.row(y)[x] != mask_not_traversable;
        stones += stone;
        found += stone && mask.plane.row(y)[x] == mask_doubtful;
      }
  }
  EXPECT_GT(found * 2, stones);
}

} // namespace
} // namespace terrainseg
