// SPDX-License-Identifier: LGPL-2.1-or-later
// Stage E against the Mahalanobis distance in doubles, and every format against a look at each pixel.
#include "paper/scoring.hpp"

#include <algorithm>
#include <random>

#include <Eigen/Dense>
#include <gtest/gtest.h>

#include "base/workers.hpp"
#include "learning/terrain_model.hpp"
#include "support/frames.hpp"
#include "terrainseg/estimate.hpp"

namespace terrainseg {
namespace {

TerrainModel random_model(std::mt19937& random) {
  TerrainModel m;
  for (int c = 0; c < 3; ++c) {
    m.mean[c] = static_cast<std::uint16_t>((40 + random() % 170) * 256 + random() % 256);
    m.variance[c] = 16 * 256 + random() % (900 * 256);
  }
  m.mass = 256;
  return m;
}

double least_distance(const std::vector<TerrainModel>& models, const Color& color, int b) {
  double least = 1e18;
  for (const TerrainModel& m : models) {
    if (m.mass == 0)
      continue;
    Eigen::Vector3d d;
    Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
    for (int c = 0; c < 3; ++c) {
      d[c] = bin_centre(color[c], b) - m.mean[c] / 256.0;
      covariance(c, c) = m.variance[c] / 256.0;
    }
    least = std::min(least, d.dot(covariance.inverse() * d));
  }
  return least;
}

TEST(ScoreTable, IsTheLeastMahalanobisDistance) {
  std::mt19937 random(1);
  for (int b : {0, 2, 3, 4, 5, 7})
    for (int threshold_q8 : {256, 512, 768, 1000}) {
      std::vector<TerrainModel> models(5);
      for (int n = 0; n < 4; ++n)
        models[n] = random_model(random); // the fifth stays null
      ScoreTable table;
      table.build(models, threshold_q8, b);
      const double limit = threshold_q8 / 256.0 * threshold_q8 / 256.0;
      for (int i = 0; i < 3000; ++i) {
        const Color color{static_cast<std::uint8_t>(random()), static_cast<std::uint8_t>(random()),
                          static_cast<std::uint8_t>(random())};
        const double expected = least_distance(models, color, b) / limit * kernels::score_limit;
        if (expected < 253)
          EXPECT_NEAR(table.score(color), expected, 1.5 + 1e-6) << b;
        else
          EXPECT_GE(table.score(color), 251) << b;
      }
    }
}

TEST(ScoreTable, WithoutAModelNothingIsTerrain) {
  ScoreTable table;
  table.build(std::vector<TerrainModel>(5), 768, 3);
  EXPECT_EQ(table.score({0, 0, 0}), 255);
}

TEST(ScoreTable, ThresholdZeroTakesTheMeanOnly) {
  TerrainModel m{{100 << 8, 108 << 8, 124 << 8}, {4096, 4096, 4096}, 256};
  ScoreTable table;
  table.build({&m, 1}, 0, 3);
  EXPECT_EQ(table.score({100, 108, 124}), 0);
  EXPECT_EQ(table.score({100, 108, 132}), 255);
}

TEST(ColorTable, HoldsWhatTheComponentsAddUpTo) {
  std::mt19937 random(2);
  for (int b = 1; b <= 7; ++b) {
    std::vector<std::uint8_t> table(kernels::color_table_size(b)), used(kernels::color_table_rows(b));
    for (int round = 0; round < 3; ++round) { // the second build has to clear the first
      kernels::ComponentScores scores;
      scores.bit_shift = b;
      scores.models = 1 + round;
      for (auto& model : scores.entries)
        for (auto& component : model)
          for (auto& entry : component)
            entry = static_cast<std::uint8_t>(random() % 4 == 0 ? random() % 256 : 255);
      kernels::fill_color_table(scores, table.data(), used.data());
      const int side = 256 >> b;
      for (std::size_t i = 0; i < table.size(); ++i) {
        const auto part = [&](std::size_t t) { return static_cast<std::uint8_t>(t % side << b); };
        const int score = kernels::score_of(scores, part(i / side / side), part(i / side), part(i));
        ASSERT_EQ(table[i], score <= kernels::score_limit ? 255 : 0) << b << " " << i;
      }
    }
  }
}

class Label : public testing::TestWithParam<int> {};

TEST_P(Label, EveryPixelGetsTheLabelOfItsColour) {
  const auto format = static_cast<PixelFormat>(GetParam());
  const FormatLayout& layout = layout_of(format);
  std::mt19937 random(3);
  std::vector<TerrainModel> models(3);
  for (auto& m : models)
    m = random_model(random);
  ScoreTable table;
  Workers one(1), three(3);
  for (int b : {3, 4})
    for (auto [width, height] : {std::pair{1, 1}, {2, 3}, {33, 18}, {64, 9}, {2051, 3}, {4101, 2}}) {
      table.build(models, 768, b);
      const auto paint = [](int x, int y) {
        return test::Components{static_cast<std::uint8_t>(test::noise_at(x, y, 0, 8)),
                                static_cast<std::uint8_t>(test::noise_at(x, y, 1, 8)),
                                static_cast<std::uint8_t>(test::noise_at(x, y, 2, 8))};
      };
      const test::OwnedFrame frame(format, width, height, paint, 5);
      const int first_row = height / 4, stride = width + 3;
      std::vector<std::uint8_t> mask(static_cast<std::size_t>(stride) * height, 7), threaded = mask,
                                                                                    expected = mask;
      std::uint64_t count = 0;
      for (int y = 0; y < height; ++y)
        for (int x = 0; x < width; ++x) {
          Color color{};
          color[1] = color[2] = 128;
          for (int c = 0; c < layout.component_count; ++c) {
            const auto& part = layout.components[c];
            color[c] = paint(x >> part.x_shift << part.x_shift, y >> part.y_shift << part.y_shift)[c];
          }
          const bool yes = y >= first_row && table.score(color) <= kernels::score_limit;
          expected[static_cast<std::size_t>(y) * stride + x] = yes ? 255 : 0;
          count += yes;
        }
      EXPECT_EQ(table.label(frame.frame(), first_row, {mask.data(), stride}, one), count);
      EXPECT_EQ(mask, expected);
      EXPECT_EQ(table.label(frame.frame(), first_row, {threaded.data(), stride}, three), count);
      EXPECT_EQ(threaded, expected);
    }
}

INSTANTIATE_TEST_SUITE_P(Formats, Label, testing::Range(0, pixel_format_count));

TEST(MeanCloseness, IsAMeanOverTheWindow) {
  const std::vector<std::uint8_t> scores{255, 255, 255, 10, 20, 255, 30, 41, 255};
  EXPECT_EQ(mean_closeness(scores, 3, {0, 1, 2, 2}), 255 - 25);
  EXPECT_EQ(mean_closeness(scores, 3, {2, 0, 1, 3}), 0);
}

} // namespace
} // namespace terrainseg
