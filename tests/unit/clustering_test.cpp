// SPDX-License-Identifier: LGPL-2.1-or-later
// k-means against one step of Lloyd's algorithm in doubles, and the properties that equations (6) to (8)
// imply.
#include "learning/terrain_model.hpp"

#include <algorithm>
#include <cmath>
#include <random>

#include <Eigen/Dense>
#include <gtest/gtest.h>

#include "support/grids.hpp"

namespace terrainseg {
namespace {

/// A grid of one row that holds a list of colours.
struct Samples {
  std::vector<Cell> cells;
  test::OwnedGrid grid;
  explicit Samples(const std::vector<Color>& colors) : grid(static_cast<int>(colors.size()), 1) {
    for (std::size_t i = 0; i < colors.size(); ++i) {
      cells.push_back({static_cast<std::int16_t>(i), 0});
      grid.set(cells[i], colors[i]);
    }
  }
};

std::vector<Color> blob(Color centre, int spread, int count, std::uint32_t seed) {
  std::mt19937 random(seed);
  std::vector<Color> colors;
  for (int i = 0; i < count; ++i) {
    Color color;
    for (int c = 0; c < 3; ++c)
      color[c] = static_cast<std::uint8_t>(
          std::clamp<int>(centre[c] + static_cast<int>(random() % (2 * spread + 1)) - spread, 0, 255));
    colors.push_back(color);
  }
  return colors;
}

ClusterRule rule_of(int clusters, int bit_shift, std::uint32_t seed = 1) {
  const std::uint32_t floor = variance_floor(bit_shift);
  return {clusters, {bit_shift, bit_shift, bit_shift}, {floor, floor, floor}, seed};
}

TrainingModels clustered(const std::vector<Color>& colors, const ClusterRule& rule) {
  const Samples samples(colors);
  ClusterScratch scratch;
  return cluster(samples.grid, samples.cells, rule, scratch);
}

double binned(int value, int b) {
  return b == 0 ? value : std::floor(value / std::exp2(b)) * std::exp2(b) + std::exp2(b - 1);
}

TEST(BinCentre, IsTheMiddleOfTheBin) {
  for (int b = 0; b <= 7; ++b)
    for (int value = 0; value < 256; ++value)
      EXPECT_EQ(bin_centre(value, b), binned(value, b));
}

TEST(VarianceFloor, IsSixteenAndTheQuantisation) {
  for (int b = 0; b <= 7; ++b)
    EXPECT_NEAR(variance_floor(b) / 256.0, 16 + std::exp2(2 * b) / 12, 0.5 / 256 + 1e-9);
}

TEST(Cluster, OneClusterIsMeanAndVarianceOfTheBinCentres) {
  for (int b : {0, 3, 4, 7}) {
    const auto colors = blob({120, 60, 200}, 40, 333, 9);
    const TrainingModels training = clustered(colors, rule_of(1, b));
    ASSERT_EQ(training.count, 1);
    Eigen::Array3d mean = Eigen::Array3d::Zero(), variance = mean;
    const auto point = [b](const Color& c) {
      return Eigen::Array3d(binned(c[0], b), binned(c[1], b), binned(c[2], b));
    };
    for (const Color& color : colors)
      mean += point(color) / colors.size();
    for (const Color& color : colors)
      variance += (point(color) - mean).square() / colors.size();
    variance = variance.max(16 + std::exp2(2 * b) / 12);
    for (int c = 0; c < 3; ++c) {
      EXPECT_NEAR(training.models[0].mean[c] / 256.0, mean[c], 0.51 / 256);
      EXPECT_NEAR(training.models[0].variance[c] / 256.0, variance[c], 2.0 / 256);
    }
    EXPECT_EQ(training.models[0].mass, 333u * 256);
  }
}

TEST(Cluster, TwoBlobsAreFoundFromEverySeed) {
  auto colors = blob({60, 60, 60}, 6, 100, 1);
  const auto other = blob({190, 170, 80}, 6, 60, 2);
  colors.insert(colors.end(), other.begin(), other.end());
  for (std::uint32_t seed = 0; seed < 50; ++seed) {
    const TrainingModels training = clustered(colors, rule_of(2, 3, seed));
    ASSERT_EQ(training.count, 2);
    EXPECT_EQ(training.models[0].mass, 100u * 256);
    EXPECT_EQ(training.models[1].mass, 60u * 256);
    EXPECT_NEAR(training.models[0].mean[0] / 256.0, 60, 4);
    EXPECT_NEAR(training.models[1].mean[2] / 256.0, 80, 4);
  }
}

TEST(Cluster, IsAFixedPointOfLloydsAlgorithm) {
  for (std::uint32_t seed = 1; seed <= 20; ++seed) {
    auto colors = blob({60, 60, 60}, 10, 80, seed);
    for (const Color& color : blob({200, 60, 60}, 10, 60, seed + 100))
      colors.push_back(color);
    for (const Color& color : blob({130, 200, 60}, 10, 40, seed + 200))
      colors.push_back(color);
    const TrainingModels training = clustered(colors, rule_of(3, 3, seed));
    std::array<Eigen::Vector3d, 3> sums;
    std::array<int, 3> counts{};
    sums.fill(Eigen::Vector3d::Zero());
    for (const Color& color : colors) {
      const Eigen::Vector3d z(binned(color[0], 3), binned(color[1], 3), binned(color[2], 3));
      int best = 0;
      double least = 1e18;
      for (int k = 0; k < training.count; ++k) {
        const auto& m = training.models[k].mean;
        const double distance = (z - Eigen::Vector3d(m[0], m[1], m[2]) / 256).squaredNorm();
        if (distance < least) {
          least = distance;
          best = k;
        }
      }
      sums[best] += z;
      ++counts[best];
    }
    for (int k = 0; k < training.count; ++k) {
      EXPECT_EQ(training.models[k].mass, static_cast<std::uint64_t>(counts[k]) * 256) << "seed " << seed;
      for (int c = 0; c < 3; ++c)
        EXPECT_NEAR(training.models[k].mean[c] / 256.0, sums[k][c] / counts[k], 0.51 / 256)
            << "seed " << seed;
    }
  }
}

TEST(Cluster, MassesFallAndAddUp) {
  std::mt19937 random(7);
  for (int k = 1; k <= max_models; ++k) {
    std::vector<Color> colors;
    for (int i = 0; i < 500; ++i)
      colors.push_back({static_cast<std::uint8_t>(random()), static_cast<std::uint8_t>(random()),
                        static_cast<std::uint8_t>(random())});
    const TrainingModels training = clustered(colors, rule_of(k, 3));
    ASSERT_GE(training.count, 1);
    ASSERT_LE(training.count, k);
    std::uint64_t sum = 0;
    for (int i = 0; i < training.count; ++i) {
      sum += training.models[i].mass;
      EXPECT_LE(training.models[i].mass, training.models[std::max(i - 1, 0)].mass);
    }
    EXPECT_EQ(sum, 500u * 256);
  }
}

TEST(Cluster, EmptyClustersAreDropped) {
  const TrainingModels training = clustered(std::vector<Color>(50, Color{100, 110, 120}), rule_of(8, 3));
  ASSERT_EQ(training.count, 1);
  EXPECT_EQ(training.models[0].mass, 50u * 256);
  EXPECT_EQ(training.models[0].mean, (std::array<std::uint16_t, 3>{100 << 8, 108 << 8, 124 << 8}));
  EXPECT_EQ(training.models[0].variance[0], variance_floor(3));
}

TEST(Cluster, KThreeLives) {
  // Drawn from the whole colour cube, 1.01 clusters would live on average.
  int live = 0;
  for (std::uint32_t seed = 0; seed < 100; ++seed)
    live += clustered(blob({110, 124, 132}, 20, 128, seed), rule_of(3, 3, seed)).count;
  EXPECT_GT(live, 280);
}

TEST(Cluster, RepeatsBitForBit) {
  const auto colors = blob({100, 100, 100}, 60, 400, 3);
  const TrainingModels a = clustered(colors, rule_of(4, 3, 42)), b = clustered(colors, rule_of(4, 3, 42));
  EXPECT_EQ(a.models, b.models);
}

TEST(Cluster, NothingIn) {
  EXPECT_EQ(clustered({}, rule_of(3, 3)).count, 0);
}

} // namespace
} // namespace terrainseg
