// SPDX-License-Identifier: LGPL-2.1-or-later
#include "freespace/holes/stone_field.hpp"

#include <algorithm>
#include <cmath>
#include <random>

#include <gtest/gtest.h>

#include "base/lattice.hpp"
#include "freespace/look/view.hpp"
#include "support/frames.hpp"
#include "terrainseg/segmenter.hpp"

namespace terrainseg {
namespace {

using Bytes = std::vector<std::uint8_t>;

/// A picture in full-range BT.601 whose pyramid is searched at `level`, and a ground with a straight edge.
struct Scene {
  Scene(int width, int height, int level, const test::Painter& painter,
        PixelFormat format = PixelFormat::Y444)
      : owned(format, width, height, painter, 0) {
    owned.frame().colorimetry = {ColorRange::full, ColorMatrix::bt601};
    view.level = level;
    pyramid.build(owned.frame(), {level + 1, 0, 0});
    const bool rgb = format == PixelFormat::RGB;
    luma.read(pyramid, level, level, color_transform_of(rgb, owned.frame().colorimetry), rgb);
    view.horizon = 64;
    curves.boundary.assign(static_cast<std::size_t>(width), static_cast<std::uint16_t>(height / 4));
    curves.safe = curves.boundary;
  }
  bool find() { return field.find(luma.level(view.level), curves, view, watch, found.holes); }
  /// Another picture of the same size, the same search.
  bool find_in(Scene& other) {
    return field.find(other.luma.level(view.level), other.curves, other.view, watch, found.holes);
  }
  bool stone(int row, int column) const {
    return field.oddness().values[static_cast<std::size_t>(row * field.oddness().width + column)] != 0;
  }
  int stones() const {
    const auto cells = field.oddness().values;
    return static_cast<int>(
        std::count_if(cells.begin(), cells.end(), [](std::uint8_t odd) { return odd > 0; }));
  }

  test::OwnedFrame owned;
  Pyramid pyramid;
  LumaLevels luma;
  FreeSpaceCurves curves;
  StoneView view;
  StoneField field;
  StoneField::Watch watch;
  Detection found;
};

/// The definition, every box summed by itself.
class ByDefinition {
 public:
  explicit ByDefinition(const Scene& s)
      : s_(s), w_(s.field.oddness().width), h_(s.field.oddness().height),
        horizon_(static_cast<int>(s.view.horizon) * h_ / 256), first_(h_) {
    for (int i = h_ - 1; i >= 0; --i)
      for (int j = 0; j < w_; ++j)
        first_ = ground(i, j) ? i : first_;
  }

  bool ground(int i, int j) const {
    const int k = s_.view.level;
    for (const Rectangle& r : s_.view.ignored)
      if (contains(r, j << k, i << k))
        return false;
    return i >= (s_.curves.safe[static_cast<std::size_t>(j << k)] + (1 << k) / 2) >> k;
  }

  /// Distance from the mean of the ground around the cell's block in that ground's deviations. What counts as
  /// ground is near the mean of all that lies around its own block; the limit may fall `aside` of where it
  /// is.
  double deviation(int i, int j, int aside) const {
    if (first_look_.empty())
      for (int y = 0; y < (h_ + 15) / 16; ++y)
        for (int x = 0; x < (w_ + 15) / 16; ++x)
          first_look_.push_back(look_at(y, x));
    const auto look = [&](int y, int x) {
      return first_look_[static_cast<std::size_t>(y / 16 * ((w_ + 15) / 16) + x / 16)];
    };
    if (!look(i, j).known)
      return 0;
    double n = 0, sum = 0, distances = 0;
    each_around(i / 16, j / 16, [&](int y, int x) {
      const Look own = look(y, x);
      const double away = std::abs(luma(y, x) - own.mean);
      if (own.known && away <= own.limit + aside) {
        ++n;
        sum += luma(y, x);
        distances += away;
      }
    });
    return n == 0 ? 0 : std::abs(luma(i, j) - sum / n) / std::max(1.25 * distances / n, 5.0);
  }

  /// Seeds, growth, pieces, and which of them are stones, of the code's own deviations.
  Bytes stones() const {
    const std::span<const std::uint8_t> z = s_.field.deviations();
    const auto candidate = [&](int i, int j) { return i >= first_ && z[at(i, j)] >= 24; };
    const auto sum_over = [&](int i, int j, const auto& value) {
      const int reach = std::max(static_cast<int>(std::floor(20.0 * (i - horizon_) / 1024 + 0.5)), 1);
      double sum = 0;
      for (int y = std::max(i - reach, first_); y <= std::min(i + reach, h_ - 1); ++y)
        for (int x = std::max(j - reach, 0); x <= std::min(j + reach, w_ - 1); ++x)
          sum += value(y, x);
      return sum;
    };
    Bytes seed(static_cast<std::size_t>(w_ * h_), 0), odd = seed, stones = seed;
    for (int i = first_; i < h_; ++i)
      for (int j = 0; j < w_; ++j)
        seed[at(i, j)] =
            candidate(i, j) && sum_over(i, j, [&](int y, int x) { return z[at(y, x)]; }) >=
                                   31 * sum_over(i, j, [&](int y, int x) { return ground(y, x); });
    for (int i = first_; i < h_; ++i)
      for (int j = 0; j < w_; ++j)
        odd[at(i, j)] = candidate(i, j) && sum_over(i, j, [&](int y, int x) { return seed[at(y, x)]; }) > 0;
    // Pieces: the least number of its cells, spread until nothing changes.
    std::vector<int> name(odd.size(), -1);
    for (std::size_t c = 0; c < odd.size(); ++c)
      name[c] = odd[c] ? static_cast<int>(c) : -1;
    for (bool changed = true; changed;) {
      changed = false;
      for (int i = 0; i < h_; ++i)
        for (int j = 0; j < w_; ++j)
          for (int y = std::max(i - 1, 0); name[at(i, j)] >= 0 && y <= std::min(i + 1, h_ - 1); ++y)
            for (int x = std::max(j - 1, 0); x <= std::min(j + 1, w_ - 1); ++x)
              if (name[at(y, x)] >= 0 && name[at(y, x)] < name[at(i, j)]) {
                name[at(i, j)] = name[at(y, x)];
                changed = true;
              }
    }
    double sure = 0, sure_cells = 0, all = 0;
    std::vector<int> taken;
    for (std::size_t c = 0; c < name.size(); ++c) {
      if (name[c] != static_cast<int>(c))
        continue;
      int left = w_, right = -1, top = h_, bottom = -1, cells = 0, peak = 0;
      bool inside = true;
      for (int i = 0; i < h_; ++i)
        for (int j = 0; j < w_; ++j)
          if (name[at(i, j)] == static_cast<int>(c)) {
            left = std::min(left, j);
            right = std::max(right, j);
            top = std::min(top, i);
            bottom = std::max(bottom, i);
            ++cells;
            peak = std::max<int>(peak, z[at(i, j)]);
            inside &= i > first_ && ground(i - 1, j);
          }
      inside &= left > 0 && right < w_ - 1 && bottom < h_ - 1;
      const double away = bottom - horizon_;
      const auto fits = [&](double size) {
        return right - left + 1 <= size / 64 * away && bottom - top + 1 <= size / 64 * away;
      };
      all += cells;
      if (inside && peak >= 80 && fits(18)) {
        ++sure;
        sure_cells += cells;
      }
      if (inside && peak >= 48 && fits(44))
        taken.push_back(static_cast<int>(c));
    }
    if (sure < 16 || 6 * sure_cells < all)
      return stones;
    for (int i = 0; i < h_; ++i)
      for (const int piece : taken) {
        int from = w_, to = -1;
        for (int j = 0; j < w_; ++j)
          if (name[at(i, j)] == piece) {
            from = std::min(from, j);
            to = std::max(to, j);
          }
        for (int j = from; j <= to; ++j)
          stones[at(i, j)] = 1;
      }
    return stones;
  }

 private:
  struct Look {
    bool known;
    double mean, limit;
  };
  static int reach_of(double away) { return std::clamp(static_cast<int>((away / 2 + 8) / 16), 1, 15); }
  int reach(int block_row) const { return reach_of(16 * block_row + 8 - horizon_); }
  template <typename Visit> void each_around(int block_row, int block, Visit visit) const {
    const int r = reach(block_row);
    for (int y = std::max(16 * (block_row - r), 0); y < std::min(16 * (block_row + r + 1), h_); ++y)
      for (int x = std::max(16 * (block - r), 0); x < std::min(16 * (block + r + 1), w_); ++x)
        if (y % 4 == 0 && ground(y, x))
          visit(y, x);
  }
  Look look_at(int block_row, int block) const {
    double n = 0, sum = 0, squares = 0;
    each_around(block_row, block, [&](int y, int x) {
      ++n;
      sum += luma(y, x);
      squares += luma(y, x) * luma(y, x);
    });
    const double mean = sum / n, variance = squares / n - mean * mean;
    return {16 * n >= std::pow(16.0 * (2 * reach(block_row) + 1), 2), std::round(mean),
            std::floor(2 * std::max(std::sqrt(std::max(variance, 0.0)), 5.0))};
  }
  double luma(int i, int j) const { return s_.pyramid.plane(s_.view.level, 0).row(i)[j]; }
  std::size_t at(int i, int j) const { return static_cast<std::size_t>(i * w_ + j); }

  const Scene& s_;
  int w_, h_, horizon_, first_;
  mutable std::vector<Look> first_look_;
};

std::uint8_t grain(int x, int y) {
  std::uint32_t h = static_cast<std::uint32_t>(x) * 73856093u ^ static_cast<std::uint32_t>(y) * 19349663u;
  h ^= h >> 13;
  h *= 0x5bd1e995;
  return static_cast<std::uint8_t>((h ^ h >> 15) & 15);
}

/// Grey ground with a grain; stones have a lit left half and a shaded right one.
test::Painter ground_with(std::vector<Rectangle> stones, int lit = 60, int shaded = -50) {
  return [=](int x, int y) -> test::Components {
    int light = 0;
    for (const Rectangle& stone : stones)
      if (contains(stone, x, y))
        light = x < stone.x + stone.width / 2 ? lit : shaded;
    return {static_cast<std::uint8_t>(112 + light + grain(x, y)), 128, 128};
  };
}

/// `count` stones in rows of eight, the larger the nearer.
std::vector<Rectangle> field_of(int count, int width, int height) {
  std::vector<Rectangle> stones;
  for (int n = 0; n < count; ++n) {
    const int row = n / 8, y = height / 3 + row * height / 9, size = 4 + row * height / 120;
    stones.push_back({width * (2 * (n % 8) + 1 + row % 2) / 18, y, size + size / 2, size});
  }
  return stones;
}

TEST(StoneField, IsWhatTheDefinitionSays) {
  std::mt19937 dice(5);
  int fields = 0, none = 0, cells = 0;
  for (int round = 0; round < 12; ++round) {
    const int level = round % 2, width = (150 + static_cast<int>(dice() % 25)) << level,
              height = (110 + static_cast<int>(dice() % 15)) << level;
    std::vector<Rectangle> stones;
    for (int n = 0; n < 50; ++n) {
      const int y = height / 4 + static_cast<int>(dice() % static_cast<unsigned>(height * 3 / 4)),
                size = (2 + static_cast<int>(dice() % 9)) << level;
      stones.push_back({static_cast<int>(dice() % static_cast<unsigned>(width)), y, size + size / 3, size});
    }
    if (round % 3 == 2) // markings: as much as the stones, and not theirs
      for (int n = 0; n < 6; ++n)
        stones.push_back({0, height / 2 + n * height / 14, width, 8 << level});
    const int lit = 20 + static_cast<int>(dice() % 50), shaded = -20 - static_cast<int>(dice() % 50);
    Scene s(width, height, level, ground_with(stones, lit, shaded));
    for (int x = 0; x < width; ++x)
      s.curves.safe[static_cast<std::size_t>(x)] =
          static_cast<std::uint16_t>(height * (3 + (x * 5 / width) % 2) / 12);
    const std::vector<Rectangle> ignored{{width / 8, height * 3 / 4, width / 9, height / 6}};
    if (round % 4 > 1)
      s.view.ignored = ignored;
    const bool any = s.find();
    const ByDefinition truth(s);
    for (int i = s.field.oddness().height / 3; i < s.field.oddness().height; i += 3)
      for (int j = 0; j < s.field.oddness().width; j += 7) {
        const int said = s.field.deviations()[static_cast<std::size_t>(i * s.field.oddness().width + j)];
        double low = 127, high = 0;
        for (int aside = -1; aside <= 1; ++aside) {
          const double is = truth.ground(i, j) ? std::min(16 * truth.deviation(i, j, aside), 127.0) : 0.0;
          low = std::min(low, is);
          high = std::max(high, is);
        }
        // The mean is told to half a grey level, a tenth of the least deviation.
        ASSERT_GE(said, low - 3 - low / 16) << round << ": " << i << ' ' << j;
        ASSERT_LE(said, high + 3 + high / 16) << round << ": " << i << ' ' << j;
      }
    const Bytes wanted = truth.stones();
    Bytes said(s.field.oddness().values.begin(), s.field.oddness().values.end());
    for (std::uint8_t& odd : said)
      odd = odd > 0;
    EXPECT_EQ(said, wanted) << round;
    EXPECT_EQ(any, std::count(wanted.begin(), wanted.end(), 1) > 0) << round;
    (any ? fields : none) += 1;
    cells += s.stones();
  }
  EXPECT_GT(fields, 3); // the pictures have both
  EXPECT_GT(none, 3);
  EXPECT_GT(cells, 2000);
}

TEST(StoneField, StonesWithTheGroundsOwnMeanAreFoundAndTheGroundIsNot) {
  const std::vector<Rectangle> stones = field_of(32, 320, 240);
  Scene s(320, 240, 0, ground_with(stones, 55, -55));
  ASSERT_TRUE(s.find());
  int found = 0, area = 0;
  for (const Rectangle& stone : stones) {
    found += s.stone(stone.y + stone.height / 2, stone.x + stone.width / 2);
    area += stone.width * stone.height;
  }
  EXPECT_GE(found, 30);
  EXPECT_LT(s.stones(), area * 5 / 4);
}

TEST(StoneField, AFewAreNoField) {
  Scene many(320, 240, 0, ground_with(field_of(32, 320, 240))),
      few(320, 240, 0, ground_with(field_of(10, 320, 240)));
  EXPECT_FALSE(few.find());
  EXPECT_EQ(few.stones(), 0);
  ASSERT_TRUE(many.find());
  EXPECT_FALSE(many.find_in(few)) << "whatever was there before";
  EXPECT_EQ(many.stones(), 0) << "nothing is left of the frame before";
}

TEST(StoneField, LooksMoreSeldomWhereThereIsNone) {
  Scene many(320, 240, 0, ground_with(field_of(32, 320, 240))),
      even(320, 240, 0, ground_with(std::vector<Rectangle>{}));
  // A field is shown after so many frames without one: the frame in which it is found.
  const std::vector<std::pair<int, int>> found_in{{0, 0}, {1, 3}, {3, 3}, {4, 8}, {8, 8}, {9, 17}, {18, 26}};
  for (const auto& [without, found] : found_in) {
    even.watch = {};
    for (int frame = 0; frame < without; ++frame)
      ASSERT_FALSE(even.find());
    int frame = without;
    while (frame < 100 && !even.find_in(many))
      ++frame;
    EXPECT_EQ(frame, found) << without << " frames without a field";
    EXPECT_TRUE(even.find_in(many)) << "every frame is looked at";
    ASSERT_FALSE(even.find());
    EXPECT_EQ(std::vector<bool>({even.find_in(many), even.find_in(many), even.find_in(many)}),
              (std::vector<bool>{false, false, true}))
        << "pauses are short again";
  }
}

TEST(StoneField, ANewPlaceIsLookedAtAtOnce) {
  Scene many(320, 240, 0, ground_with(field_of(32, 320, 240))),
      even(320, 240, 0, ground_with(std::vector<Rectangle>{}));
  for (int frame = 0; frame < 12; ++frame)
    ASSERT_FALSE(even.find());
  ASSERT_FALSE(even.find_in(many)) << "it waits";
  even.watch.look_again();
  EXPECT_TRUE(even.find_in(many));
}

TEST(StoneField, MarkingsAreNoStones) {
  std::vector<Rectangle> painted = field_of(24, 320, 240);
  for (Rectangle& mark : painted)
    mark = {mark.x, mark.y, 5, 60};
  Scene lines(320, 240, 0, ground_with(painted, 90, 90));
  EXPECT_FALSE(lines.find());
  // Stones among much more that is none: seams and patches tell that this is a road.
  std::vector<Rectangle> both = field_of(32, 320, 240);
  for (int n = 0; n < 6; ++n)
    both.push_back({0, 62 + n * 30, 320, 14});
  Scene road(320, 240, 0, ground_with(both));
  EXPECT_FALSE(road.find());
}

TEST(StoneField, WhatTheGroundDoesNotSurroundIsNoStone) {
  std::vector<Rectangle> stones = field_of(32, 320, 240);
  const Rectangle above{30, 50, 14, 14}, aside{0, 120, 10, 9}, large{200, 90, 60, 22};
  for (const Rectangle& more : {above, aside, large})
    stones.push_back(more);
  Scene s(320, 240, 0, ground_with(stones));
  ASSERT_TRUE(s.find());
  for (const Rectangle& other : {above, aside, large})
    EXPECT_FALSE(s.stone(other.y + other.height - 2, other.x + 2)) << other.x;
  const std::vector<Rectangle> ignored{{0, 0, 90, 240}};
  s.view.ignored = ignored;
  s.watch = {};
  ASSERT_TRUE(s.find());
  for (int y = 0; y < 240; ++y)
    for (int x = 0; x < 90; ++x)
      ASSERT_FALSE(s.stone(y, x)) << y << ' ' << x;
}

TEST(StoneField, WhatStandsNearestIsSeenToo) {
  std::vector<Rectangle> stones = field_of(32, 320, 240);
  const Rectangle before{150, 215, 16, 14}; // where the training window lies
  stones.push_back(before);
  Scene s(320, 240, 0, ground_with(stones));
  ASSERT_TRUE(s.find());
  EXPECT_TRUE(s.stone(221, 153));
}

TEST(StoneField, GreyOfRedGreenAndBlueIsTheSame) {
  const std::vector<Rectangle> stones = field_of(32, 320, 240);
  const test::Painter luma = ground_with(stones);
  Scene yuv(320, 240, 0, luma), rgb(
                                    320, 240, 0,
                                    [&](int x, int y) -> test::Components {
                                      const std::uint8_t grey = luma(x, y)[0];
                                      return {grey, grey, grey};
                                    },
                                    PixelFormat::RGB);
  ASSERT_TRUE(yuv.find());
  ASSERT_TRUE(rgb.find());
  const auto a = yuv.field.oddness().values, b = rgb.field.oddness().values;
  EXPECT_TRUE(std::equal(a.begin(), a.end(), b.begin(), b.end()));
}

TEST(StoneField, AreHolesInTheMaskAndEndTheFreeSpace) {
  const std::vector<Rectangle> stones = field_of(32, 320, 240);
  for (const int mask_level : {0, 1, 2}) {
    Scene s(320, 240, 0, ground_with(stones));
    ASSERT_TRUE(s.find());
    const int width = subsampled(320, mask_level), height = subsampled(240, mask_level);
    std::vector<std::uint8_t> mask(static_cast<std::size_t>(width * height), mask_traversable);
    const std::uint64_t turned = mark(s.found, {mask.data(), width}, width, height, mask_level);
    EXPECT_EQ(turned, static_cast<std::uint64_t>(std::count(mask.begin(), mask.end(), mask_doubtful)));
    EXPECT_GT(turned, 0u);
    FrameCurve rows(static_cast<std::size_t>(width), 60);
    lower_below(s.found, mask_level, rows);
    for (int x = 0; x < width; ++x) {
      int lowest = 60;
      for (int y = 0; y < 240; ++y)
        for (int column = x << mask_level; column < std::min((x + 1) << mask_level, 320); ++column)
          lowest = s.stone(y, column) ? std::max(lowest, y + 1) : lowest;
      // A stretch begins at the first column of the mask that it reaches.
      EXPECT_LE(rows[static_cast<std::size_t>(x)], lowest) << x;
      if (mask_level == 0) {
        EXPECT_EQ(rows[static_cast<std::size_t>(x)], lowest) << x;
      }
    }
  }
}

// The whole filter, and a mask of any size.
TEST(StoneField, StandsInTheMaskOfTheFilter) {
  const std::vector<Rectangle> stones = field_of(32, 480, 360);
  const test::Painter ground = ground_with(stones);
  const test::OwnedFrame frame(
      PixelFormat::I420, 480, 360,
      [&](int x, int y) -> test::Components {
        if (y < 90)
          return {230, 140, 110};
        return ground(x, y);
      },
      0);
  const auto doubtful_in_stones = [&](bool odd_spots, int mask_level) {
    Settings settings;
    settings.odd_spots = odd_spots;
    settings.mask_level = mask_level;
    Segmenter segmenter(settings);
    for (int n = 0; n < 4; ++n)
      EXPECT_TRUE(segmenter.process(frame.frame()).ok());
    const Estimate& estimate = segmenter.estimate();
    int found = 0;
    for (const Rectangle& stone : stones)
      found +=
          estimate.mask.plane.row((stone.y + stone.height / 2) >>
                                  mask_level)[(stone.x + stone.width / 2) >> mask_level] == mask_doubtful;
    return found;
  };
  EXPECT_EQ(doubtful_in_stones(false, 0), 0);
  const int found = doubtful_in_stones(true, 0);
  EXPECT_GE(found, 26);
  EXPECT_NEAR(doubtful_in_stones(true, 1), found, 2);
}

} // namespace
} // namespace terrainseg
