// SPDX-License-Identifier: LGPL-2.1-or-later
#include "freespace/learn/window_teacher.hpp"

#include <array>
#include <random>

#include <gtest/gtest.h>

namespace terrainseg {
namespace {

/// A window of 20 x 10 cells in a grid of 24 x 14, lit but for what is painted.
class OwnShadow : public testing::Test {
 protected:
  static constexpr int width = 24, height = 14;
  static constexpr Rectangle window{2, 4, 20, 10};

  OwnShadow() {
    for (auto& plane : planes)
      plane.assign(static_cast<std::size_t>(width) * height, 0);
    paint({0, 0, width, height}, {160, 128, 130});
    for (int y = window.y; y < window.y + window.height; ++y)
      for (int x = window.x; x < window.x + window.width; ++x)
        cells.push_back({static_cast<std::int16_t>(x), static_cast<std::int16_t>(y)});
  }
  /// With sensor noise of two levels.
  void paint(const Rectangle& where, const Color& color) {
    for (int y = where.y; y < where.y + where.height; ++y)
      for (int x = where.x; x < where.x + where.width; ++x)
        for (std::size_t c = 0; c < 3; ++c)
          planes[c][static_cast<std::size_t>(y * width + x)] =
              static_cast<std::uint8_t>(color[c] + static_cast<int>(random() % 5) - 2);
  }
  Grid grid() const {
    Grid g;
    g.width = width;
    g.height = height;
    for (std::size_t c = 0; c < 3; ++c)
      g.planes[c] = {planes[c].data(), width};
    return g;
  }
  bool leave() { return leave_own_shadow(grid(), window, cells, lit); }
  /// The lower rows of the window in shade.
  void shade(int rows, const Color& color = {70, 131, 127}) {
    paint({window.x, window.y + window.height - rows, window.width, rows}, color);
  }

  std::mt19937 random{7};
  std::array<std::vector<std::uint8_t>, 3> planes;
  std::vector<Cell> cells, lit{{1, 1}};
};

TEST_F(OwnShadow, IsLeft) {
  for (const int rows : {2, 3, 5, 6}) {
    shade(rows);
    ASSERT_TRUE(leave()) << rows;
    EXPECT_EQ(lit.size(), static_cast<std::size_t>(window.width * (window.height - rows)));
    for (const Cell& cell : lit)
      EXPECT_LT(cell.y, window.y + window.height - rows);
  }
}

TEST_F(OwnShadow, OfAMastIsLeftToo) {
  paint({10, 4, 3, 10}, {60, 128, 130}); // as much in the upper half as in the lower
  ASSERT_TRUE(leave());
  EXPECT_EQ(lit.size(), cells.size() - 30);
}

TEST_F(OwnShadow, WhereThereIsNoneNothingChanges) {
  EXPECT_FALSE(leave());
  EXPECT_EQ(lit, std::vector<Cell>({{1, 1}}));
  shade(1); // a tenth: a stone's
  EXPECT_FALSE(leave());
  shade(7); // two fifths are not lit
  EXPECT_FALSE(leave());
  shade(10); // all of it
  EXPECT_FALSE(leave());
}

TEST_F(OwnShadow, IsNoShadeFromAhead) {
  paint({window.x, window.y, window.width, 4}, {70, 131, 127});
  EXPECT_FALSE(leave()) << "a tree's, say, or what stands there";
}

TEST_F(OwnShadow, HasTheGroundsChroma) {
  shade(4, {70, 120, 145});
  EXPECT_FALSE(leave()) << "leaves, or a carpet";
}

TEST_F(OwnShadow, IsNotMerelyDarkerGround) {
  shade(4, {115, 128, 130}); // 1.4 times as bright
  EXPECT_FALSE(leave());
  shade(4, {98, 128, 130}); // 1.6
  EXPECT_TRUE(leave());
  // By night a few levels are noise.
  paint({0, 0, width, height}, {14, 128, 128});
  shade(4, {5, 128, 128});
  EXPECT_FALSE(leave());
}

TEST_F(OwnShadow, IsNoGradient) {
  for (int i = 0; i < window.height; ++i)
    paint({window.x, window.y + i, window.width, 1}, {static_cast<std::uint8_t>(200 - 17 * i), 128, 130});
  EXPECT_FALSE(leave());
}

TEST_F(OwnShadow, NeedsSomeCells) {
  shade(4);
  cells.resize(31);
  EXPECT_FALSE(leave());
  cells.clear();
  EXPECT_FALSE(leave());
}

} // namespace
} // namespace terrainseg
