// SPDX-License-Identifier: LGPL-2.1-or-later
#include "freespace/score/cell_scorer.hpp"

#include <algorithm>
#include <cmath>
#include <random>

#include <gtest/gtest.h>

#include "freespace/look/view.hpp"
#include "support/frames.hpp"

namespace terrainseg {
namespace {

using test::Components;
using test::OwnedFrame;

struct Looked {
  GridReader reader;
  Pyramid pyramid;
  Grid grid;
  UprightCoherence coherence;
};

void look(OwnedFrame& frame, int level, Looked& looked) {
  frame.frame().colorimetry = {ColorRange::full, ColorMatrix::bt601};
  looked.pyramid.build(frame.frame(), coarse_plan(frame.frame().format, level));
  const ColorTransform transform = color_transform_of(false, frame.frame().colorimetry);
  looked.grid = looked.reader.read(looked.pyramid, level, transform, {});
  LumaLevels luma;
  luma.read(looked.pyramid, refinement_level(level), level, transform, false);
  looked.coherence.look(luma, looked.grid);
}

OwnedFrame noise(int width, int height, unsigned seed) {
  std::mt19937 random(seed);
  return {PixelFormat::I420, width, height, [random](int, int) mutable {
            return Components{static_cast<std::uint8_t>(random() % 256), 128, 128};
          }};
}

/// A column every `period` pixels, at random heights that all rows share.
OwnedFrame posts(int width, int height) {
  return {PixelFormat::I420, width, height, [](int x, int) {
            return Components{static_cast<std::uint8_t>(60 + 97 * (x / 8) % 150), 128, 128};
          }};
}

/// Written apart, in doubles and by the definition: every sum anew.
double by_definition(const Pyramid& pyramid, const Grid& grid, int row, int column) {
  const int level = std::max(grid.level - 2, 0), cell = 1 << (grid.level - level);
  const Plane plane = pyramid.plane(level, 0);
  const int width = pyramid.width(level), height = pyramid.height(level);
  double sum = 0;
  for (int i = row - 2; i <= row + 2; ++i)
    for (int j = column - 1; j <= column + 1; ++j) {
      const int own_row = std::clamp(i, 0, grid.height - 1), own_column = std::clamp(j, 0, grid.width - 1);
      double most = 0, all = 0;
      for (int x = own_column * cell - cell / 2; x < own_column * cell + cell - cell / 2; ++x) {
        if (x < 0 || x + 1 >= width)
          continue;
        double step = 0;
        for (int block = own_row - 2; block < own_row + 2; ++block)
          for (int y = 0; y < cell; ++y) {
            const int r = std::clamp(block, 0, grid.height - 1) * cell + y;
            if (r >= height)
              continue;
            const double difference = plane.row(r)[x + 1] - plane.row(r)[x];
            step += difference;
            all += std::abs(difference);
          }
        most = std::max(most, std::abs(step));
      }
      const double rows = 4 * cell, steps = rows * cell;
      sum += std::log2(1 + 4 * most / rows) - std::log2(1 + 4 * all / steps);
    }
  return 256 * sum / 15;
}

TEST(Coherence, IsWhatItsDefinitionSays) {
  for (const int level : {0, 1, 2, 3, 4})
    for (const unsigned seed : {1u, 2u}) {
      OwnedFrame frame = noise(203, 141, seed);
      Looked looked;
      look(frame, level, looked);
      const Grid& grid = looked.grid;
      for (int i = 0; i < grid.height; i += 3)
        for (int j = 0; j < grid.width; ++j)
          ASSERT_NEAR(looked.coherence.coherence()[grid.at(i, j)], by_definition(looked.pyramid, grid, i, j),
                      6)
              << level << ' ' << i << ' ' << j;
    }
}

TEST(Coherence, UprightThingsHaveItAndNoiseDoesNot) {
  OwnedFrame upright = posts(320, 240), rough = noise(320, 240, 3);
  Looked of_posts, of_noise;
  look(upright, 3, of_posts);
  look(rough, 3, of_noise);
  const std::size_t middle = of_posts.grid.at(15, 20);
  EXPECT_GT(of_posts.coherence.coherence()[middle], of_noise.coherence.coherence()[middle] + 128);
  CellScores posts_score(of_posts.grid.size(), 320), noise_score = posts_score;
  of_posts.coherence.weigh(of_posts.grid, posts_score);
  of_noise.coherence.weigh(of_noise.grid, noise_score);
  EXPECT_LT(posts_score[middle], 250) << "less than its weight alone takes off";
  EXPECT_GT(noise_score[middle], posts_score[middle]);
}

TEST(Coherence, SaysNothingWithoutContrast) {
  OwnedFrame flat(PixelFormat::I420, 160, 120, [](int, int) { return Components{90, 120, 130}; });
  Looked looked;
  look(flat, 3, looked);
  CellScores score(looked.grid.size(), 320);
  looked.coherence.weigh(looked.grid, score);
  for (int i = 0; i < looked.grid.height; ++i) {
    const bool near_by = i >= looked.grid.height * 2 / 3;
    for (int j = 0; j < looked.grid.width; ++j)
      ASSERT_EQ(score[looked.grid.at(i, j)], near_by ? 250 - 64 : 250);
  }
}

TEST(Coherence, TheNearestGroundGetsNoBonus) {
  OwnedFrame frame = noise(320, 240, 4);
  Looked looked;
  look(frame, 3, looked);
  CellScores score(looked.grid.size(), 0);
  looked.coherence.weigh(looked.grid, score);
  int most_far = -1000;
  for (int j = 0; j < looked.grid.width; ++j) {
    most_far = std::max<int>(most_far, score[looked.grid.at(10, j)]);
    ASSERT_LT(score[looked.grid.at(25, j)], 0);
  }
  EXPECT_GT(most_far, 0);
}

} // namespace
} // namespace terrainseg
