// SPDX-License-Identifier: LGPL-2.1-or-later
// Stage D against equations (10) and (11) in doubles.
#include "coarse/window.hpp"

#include <cmath>
#include <optional>
#include <random>
#include <vector>

#include <gtest/gtest.h>

#include "support/grids.hpp"

namespace terrainseg {
namespace {

constexpr Gaussian ground{{100 << 8, 120 << 8, 130 << 8}, {25 << 8, 16 << 8, 16 << 8}};
constexpr Color terrain{100, 120, 130}, sky{220, 120, 130};

/// `share[row]` of `width` cells look like ground.
test::OwnedGrid picture(int width, const std::vector<int>& share) {
  test::OwnedGrid grid(width, static_cast<int>(share.size()), sky);
  for (std::size_t row = 0; row < share.size(); ++row)
    for (int x = 0; x < share[row]; ++x)
      grid.set({static_cast<std::int16_t>(x), static_cast<std::int16_t>(row)}, terrain);
  return grid;
}

TEST(LooksLikeGround, IsTwoSigmaPerComponent) {
  std::mt19937 random(1);
  for (int i = 0; i < 20000; ++i) {
    Gaussian g;
    Color color{};
    bool expected = true;
    for (int c = 0; c < 3; ++c) {
      g.mean[c] = static_cast<std::uint16_t>(random() % (255 * 256));
      g.variance[c] = 4096 + random() % 300000;
      color[c] = static_cast<std::uint8_t>(random());
      expected &= std::abs(color[c] - g.mean[c] / 256.0) <= 2 * std::sqrt(g.variance[c] / 256.0);
    }
    EXPECT_EQ(looks_like_ground(color, g), expected);
  }
}

TEST(LooksLikeGround, TheLimitBelongsToIt) {
  EXPECT_TRUE(looks_like_ground({110, 128, 122}, ground));
  EXPECT_FALSE(looks_like_ground({111, 120, 130}, ground));
  EXPECT_FALSE(looks_like_ground({100, 129, 130}, ground));
  EXPECT_FALSE(looks_like_ground({100, 120, 121}, ground));
}

TEST(FindHorizon, IsThePoorestRow) {
  const test::OwnedGrid seen = picture(20, {10, 8, 1, 14, 18, 20, 20, 20});
  EXPECT_EQ(find_horizon(seen, ground, 6, 8).row, 2);
}

TEST(FindHorizon, ATieGoesToTheLowest) {
  const test::OwnedGrid seen = picture(20, {0, 0, 0, 14, 18, 20, 20, 20});
  const Horizon horizon = find_horizon(seen, ground, 6, 8);
  EXPECT_EQ(horizon.row, 2);
  EXPECT_EQ(horizon.confidence, 255);
}

TEST(FindHorizon, IsNullWithoutAClearlyPoorerRow) {
  EXPECT_EQ(find_horizon(picture(20, {20, 20, 20, 20}), ground, 3, 4).row, -1);
  EXPECT_EQ(find_horizon(picture(20, {0, 0, 0, 0}), ground, 3, 4).row, -1);
  EXPECT_EQ(find_horizon(picture(20, {12, 11, 15, 20}), ground, 3, 4).row, -1);
}

TEST(FindHorizon, IsNullWhenTheWindowIsAsPoor) {
  EXPECT_EQ(find_horizon(picture(20, {2, 20, 20, 2}), ground, 3, 4).row, -1);
}

TEST(FindHorizon, IsNullWhenTheWindowReachesTheTop) {
  EXPECT_EQ(find_horizon(picture(20, {2, 20, 20, 20}), ground, 0, 4).row, -1);
}

TEST(FindHorizon, RowsUnderALiftedWindowDoNotCount) {
  // A bonnet under the window.
  EXPECT_EQ(find_horizon(picture(20, {0, 1, 20, 20, 0}), ground, 3, 4).row, 0);
}

TEST(FindHorizon, AgreesWithTheRuleInDoubles) {
  std::mt19937 random(5);
  for (int i = 0; i < 3000; ++i) {
    const int rows = 2 + static_cast<int>(random() % 12), top = static_cast<int>(random() % rows),
              end = top + 1 + static_cast<int>(random() % (rows - top));
    std::vector<int> share;
    for (int r = 0; r < rows; ++r)
      share.push_back(static_cast<int>(random() % 21));
    std::optional<int> expected;
    for (int r = 0; r < top; ++r)
      if (!expected || share[r] <= share[*expected])
        expected = r;
    if (expected) {
      double others = 0;
      for (int r = 0; r < end; ++r)
        others += r == *expected ? 0 : share[r] / (end - 1.0);
      bool window_as_poor = false;
      for (int r = top; r < end; ++r)
        window_as_poor |= share[r] <= share[*expected];
      if (window_as_poor || share[*expected] >= others / 2 - 1e-9)
        expected.reset();
    }
    EXPECT_EQ(find_horizon(picture(20, share), ground, top, end).row, expected.value_or(-1));
  }
}

} // namespace
} // namespace terrainseg
