// SPDX-License-Identifier: LGPL-2.1-or-later
#include "freespace/curve/reestimation.hpp"

#include <algorithm>

#include <gtest/gtest.h>

#include "support/grids.hpp"

namespace terrainseg {
namespace {

constexpr int width = 24, height = 20;

// Ground below row 3, a post in columns 8..12 that stands on row 14 and reaches up to row `top`.
struct Place {
  test::OwnedGrid grid = test::gray_grid(width, height);
  CellScores score = CellScores(width * height, 400);
  GridCurve boundary = GridCurve(width, 3);

  explicit Place(int top) {
    for (int i = 0; i < height; ++i)
      for (int j = 0; j < width; ++j) {
        const bool post = in_post(j) && i >= top && i < 14;
        if (i >= 3 && !post)
          continue;
        score[grid.at(i, j)] = -500;
        grid.y[grid.at(i, j)] = static_cast<std::uint8_t>(post ? 30 : 220);
      }
    for (int j = 8; j < 13; ++j)
      boundary[static_cast<std::size_t>(j)] = 14;
  }
  static bool in_post(int j) { return j >= 8 && j < 13; }
  GroundBehind find(int gain = 256) const {
    GroundBehind behind;
    GroundBehindSearch().find(grid, score, boundary, gain, behind);
    return behind;
  }
  void bound(int first, int end, int row) {
    std::fill(boundary.begin() + first, boundary.begin() + end, static_cast<std::uint16_t>(row));
  }
  void expect_behind(std::size_t column, int first, int end) const {
    const GroundBehind behind = find();
    EXPECT_EQ(behind.first[column], first);
    EXPECT_EQ(behind.end[column], end);
  }
};

TEST(GroundBehind, IsFoundOverAPostAndNowhereElse) {
  const GroundBehind behind = Place(9).find();
  ASSERT_TRUE(behind.any);
  for (int j = 0; j < width; ++j) {
    const auto x = static_cast<std::size_t>(j);
    EXPECT_EQ(behind.first[x], Place::in_post(j) ? 3 : 0) << j;
    EXPECT_EQ(behind.end[x], Place::in_post(j) ? 9 : 0) << j;
  }
}

TEST(GroundBehind, WhatHidesAllOfItShowsNone) {
  const GroundBehind behind = Place(3).find();
  EXPECT_FALSE(behind.any);
  EXPECT_EQ(behind.end, GridCurve(width, 0));
}

TEST(GroundBehind, AnotherColourThanBesideItIsNoGround) {
  Place place(9);
  for (int i = 3; i < 9; ++i)
    for (int j = 8; j < 13; ++j)
      place.grid.u[place.grid.at(i, j)] = 170; // a roof that scores as ground
  EXPECT_FALSE(place.find().any);
}

TEST(GroundBehind, WeakScoresAreNotEnough) {
  Place place(9);
  for (auto& s : place.score)
    s = s > 0 ? 100 : s; // a fifth of a nat a cell, less than the margin
  EXPECT_FALSE(place.find().any);
}

TEST(GroundBehind, RowsWithoutGroundOnEitherSideCannotBe) {
  Place place(9);
  place.bound(0, 8, 4); // row 3 is no ground elsewhere
  place.bound(13, width, 4);
  place.expect_behind(10, 4, 9);
}

TEST(GroundBehind, OneSideIsEnough) {
  Place place(9);
  place.bound(13, width, height); // a wall from the post to the edge
  place.expect_behind(8, 3, 9);
}

// A cabinet of the ground's colour in columns 6..14, with dark sides and a dark foot, as high as the ground.
Place cabinet() {
  Place place(9);
  for (int i = 3; i < 14; ++i)
    for (const int j : {6, 7, 13, 14})
      place.score[place.grid.at(i, j)] = -500;
  place.bound(6, 15, 14);
  return place;
}

TEST(GroundBehind, AnIslandInAnObstacleIsNoGround) {
  EXPECT_FALSE(cabinet().find().any);
}

TEST(GroundBehind, IsReachedAcrossOtherGroundBehindObstacles) {
  Place place = cabinet();
  for (int i = 3; i < 8; ++i)
    for (const int j : {13, 14}) // the ground is seen above its right side
      place.score[place.grid.at(i, j)] = 400;
  const GroundBehind behind = place.find();
  for (const std::size_t j : {6u, 7u, 9u, 12u, 13u, 14u})
    EXPECT_EQ(behind.end[j] > 0, j >= 9) << j;
}

// A wall on the left; on the right the boundary ends in a row `beside` before it rises to the ground.
TEST(GroundBehind, TheBoundaryBesideItMayEndOneRowLower) {
  for (const int beside : {8, 9, 10, 11}) {
    Place place(9);
    for (int i = 3; i < 14; ++i)
      for (const int j : {0, 1, 2, 3, 4, 5, 6, 7, 14})
        place.score[place.grid.at(i, j)] = -500;
    place.bound(0, 8, 14);
    place.bound(13, 15, beside);
    EXPECT_EQ(place.find().end[10], beside < 11 ? 9 : 0) << beside;
  }
}

TEST(GroundBehind, IgnoredCellsLendNoColour) {
  Place place(9);
  for (int i = 0; i < height; ++i)
    for (int j = 0; j < width; ++j)
      if (!Place::in_post(j))
        place.grid.ignored[place.grid.at(i, j)] = 1;
  EXPECT_FALSE(place.find().any);
}

TEST(GroundBehind, EmptyAndFullPicturesHaveNone) {
  Place place(9);
  for (const int row : {0, height}) {
    place.boundary.assign(width, static_cast<std::uint16_t>(row));
    EXPECT_FALSE(place.find().any);
  }
}

} // namespace
} // namespace terrainseg
