// SPDX-License-Identifier: LGPL-2.1-or-later
#include "freespace/curve/refinement.hpp"

#include <gtest/gtest.h>

#include "freespace/look/view.hpp"
#include "support/frames.hpp"

namespace terrainseg {
namespace {

using test::Components;
using test::OwnedFrame;

constexpr int width = 160, height = 128, level = 3;

FrameCurve refined(const test::Painter& paint, const GridCurve& curve, bool snap, int mask_level = 0,
                   PixelFormat format = PixelFormat::I420) {
  OwnedFrame frame(format, width, height, paint);
  frame.frame().colorimetry = {ColorRange::full, ColorMatrix::bt601};
  Pyramid pyramid;
  pyramid.build(frame.frame(), coarse_plan(format, level));
  const ColorTransform transform = color_transform_of(layout_of(format).rgb, frame.frame().colorimetry);
  GridReader reader;
  const Grid grid = reader.read(pyramid, level, transform, {});
  FrameCurve rows;
  Refinement().refine(pyramid, grid, transform, curve, snap, mask_level, width, height, rows);
  return rows;
}

test::Painter edge_at(int row) {
  return [row](int, int y) { return y < row ? Components{200, 100, 150} : Components{90, 128, 128}; };
}

TEST(Refinement, SnapsToTheEdgeWithinACell) {
  // Row 8 of the grid is centred at frame row 64, so that the curve stands at row 60.
  for (int row = 57; row <= 64; ++row)
    for (const PixelFormat format : {PixelFormat::I420, PixelFormat::RGB, PixelFormat::NV12}) {
      const FrameCurve rows = refined(edge_at(row), GridCurve(20, 8), true, 0, format);
      ASSERT_EQ(rows.size(), 160u);
      for (const int r : rows)
        ASSERT_NEAR(r, row, 1) << row; // the refinement's level has half the frame's rows
    }
}

TEST(Refinement, WithoutSnapIsTheCurveBetweenTheCells) {
  for (const int r : refined(edge_at(64), GridCurve(20, 8), false))
    EXPECT_EQ(r, 60);
  GridCurve slope;
  for (int j = 0; j < 20; ++j)
    slope.push_back(static_cast<std::uint16_t>(4 + j / 2));
  const FrameCurve rows = refined(edge_at(64), slope, false);
  for (int x = 1; x < width; ++x)
    EXPECT_GE(rows[x], rows[x - 1]);
}

TEST(Refinement, FollowsTheSidesOfThings) {
  // Above ground from row 24 on stands a thing up to row 104, left or right of `side`. The columns of the
  // grid are centred at 8 j, so that the side is between columns 9 and 10.
  for (int side = 72; side <= 80; ++side)
    for (const bool left : {true, false}) {
      const auto end_of_thing = [&](int x) { return (x < side) == left ? 104 : 24; };
      const auto paint = [&](int x, int y) {
        return y < end_of_thing(x) ? Components{200, 100, 150} : Components{90, 128, 128};
      };
      GridCurve curve(20, left ? 3 : 13);
      std::fill_n(curve.begin(), 10, static_cast<std::uint16_t>(left ? 13 : 3));
      const FrameCurve rows = refined(paint, curve, true);
      for (int x = 0; x < width; ++x)
        if (std::abs(x - side) > 3) {
          ASSERT_NEAR(rows[static_cast<std::size_t>(x)], end_of_thing(x), 1) << side << ' ' << x;
        }
    }
}

TEST(Refinement, AColumnWithoutAnEdgeHasNoSide) {
  // Row 0 says that nothing ends there, as above columns without ground behind an obstacle.
  GridCurve curve(20, 0);
  std::fill_n(curve.begin(), 10, std::uint16_t{13});
  const auto slanted = [](int x, int y) {
    return x < 70 + y / 10 ? Components{200, 100, 150} : Components{90, 128, 128};
  };
  for (const int r : refined(slanted, curve, true))
    EXPECT_TRUE(r == 0 || r > 90) << r;
}

TEST(Refinement, AllAndNothingStayAll) {
  for (const bool snap : {false, true}) {
    EXPECT_EQ(refined(edge_at(64), GridCurve(20, 0), snap), FrameCurve(width, 0));
    EXPECT_EQ(refined(edge_at(64), GridCurve(20, height / 8), snap), FrameCurve(width, height));
  }
}

TEST(Refinement, OneStrayColumnIsOutvoted) {
  GridCurve curve(20, 8);
  const auto paint = [](int x, int y) {
    const int row = x >= 80 && x < 82 ? 66 : 60;
    return y < row ? Components{200, 100, 150} : Components{90, 128, 128};
  };
  for (const int r : refined(paint, curve, true))
    EXPECT_NEAR(r, 60, 1);
}

TEST(Refinement, MaskLevelsSampleTheSameCurve) {
  GridCurve curve;
  for (int j = 0; j < 20; ++j)
    curve.push_back(static_cast<std::uint16_t>(5 + j % 4));
  const FrameCurve whole = refined(edge_at(64), curve, false);
  for (const int mask_level : {1, 2, 3, 5}) {
    const FrameCurve rows = refined(edge_at(64), curve, false, mask_level);
    ASSERT_EQ(rows.size(), static_cast<std::size_t>(subsampled(width, mask_level)));
    for (std::size_t x = 0; x < rows.size(); ++x)
      EXPECT_EQ(rows[x], whole[x << mask_level]);
  }
}

} // namespace
} // namespace terrainseg
