// SPDX-License-Identifier: LGPL-2.1-or-later
// The learned mixture against equations (13) to (17) transcribed with Eigen.
#include "learning/terrain_model.hpp"

#include <algorithm>
#include <random>

#include <Eigen/Dense>
#include <gtest/gtest.h>

namespace terrainseg {
namespace {

TerrainModel model(double y, double u, double v, double variance, double mass) {
  TerrainModel m;
  m.mean = {static_cast<std::uint16_t>(y * 256), static_cast<std::uint16_t>(u * 256),
            static_cast<std::uint16_t>(v * 256)};
  m.variance.fill(static_cast<std::uint32_t>(variance * 256));
  m.mass = static_cast<std::uint64_t>(mass * 256);
  return m;
}

TerrainModel random_model(std::mt19937& random) {
  TerrainModel m;
  for (int c = 0; c < 3; ++c) {
    m.mean[c] = static_cast<std::uint16_t>(random() % (255 * 256 + 1));
    m.variance[c] = 4096 + random() % (2000 * 256);
  }
  m.mass = (1 + random() % 5000) * 256;
  return m;
}

Eigen::Vector3d mean_of(const TerrainModel& m) {
  return Eigen::Vector3d(m.mean[0], m.mean[1], m.mean[2]) / 256;
}
Eigen::Matrix3d covariance_of(const TerrainModel& m) {
  return Eigen::Matrix3d(Eigen::Vector3d(m.variance[0], m.variance[1], m.variance[2]).asDiagonal()) / 256;
}

TEST(SquaredDistance, IsEquation13) {
  std::mt19937 random(1);
  for (int i = 0; i < 2000; ++i) {
    const TerrainModel a = random_model(random), b = random_model(random);
    const Eigen::Vector3d d = mean_of(a) - mean_of(b);
    const double expected = d.dot((covariance_of(a) + covariance_of(b)).inverse() * d);
    EXPECT_NEAR(static_cast<double>(squared_distance(a, b)) / 65536, expected,
                3.0 / 65536 + expected * 1e-12);
    EXPECT_EQ(squared_distance(a, b), squared_distance(b, a));
  }
}

TEST(NearestMatch, TakesTheNearestWithinTheThreshold) {
  const std::array<TerrainModel, 4> learned{
      model(100, 100, 100, 50, 10), model(104, 100, 100, 50, 10), {}, model(200, 100, 100, 50, 10)};
  EXPECT_EQ(nearest_match(learned, model(101, 100, 100, 50, 1), 256), 0);
  EXPECT_EQ(nearest_match(learned, model(103, 100, 100, 50, 1), 256), 1);
  EXPECT_EQ(nearest_match(learned, model(102, 100, 100, 50, 1), 256), 0); // a tie goes to the lower index
  EXPECT_EQ(nearest_match(learned, model(150, 100, 100, 50, 1), 256), -1);
  EXPECT_EQ(nearest_match(learned, model(210, 100, 100, 50, 1), 256), 3); // distance exactly 1
  EXPECT_EQ(nearest_match(learned, model(210.1, 100, 100, 50, 1), 256), -1);
}

TEST(NearestMatch, ANullModelNeverMatches) {
  const std::array<TerrainModel, 2> learned{};
  EXPECT_EQ(nearest_match(learned, model(0, 0, 0, 50, 1), 4096), -1);
}

TEST(Absorb, IsEquations14To16) {
  std::mt19937 random(2);
  for (int i = 0; i < 2000; ++i) {
    TerrainModel l = random_model(random);
    const TerrainModel t = random_model(random);
    const double wl = static_cast<double>(l.mass) / 256, wt = static_cast<double>(t.mass) / 256;
    const Eigen::Vector3d mean = (mean_of(l) * wl + mean_of(t) * wt) / (wl + wt);
    const Eigen::Matrix3d covariance = (covariance_of(l) * wl + covariance_of(t) * wt) / (wl + wt);
    absorb(l, t);
    EXPECT_LE((mean_of(l) - mean).cwiseAbs().maxCoeff(), 1.0 / 256);
    EXPECT_LE((covariance_of(l) - covariance).cwiseAbs().maxCoeff(), 1.0 / 256);
    EXPECT_DOUBLE_EQ(static_cast<double>(l.mass) / 256, wl + wt);
  }
}

TEST(Absorb, NeverStalls) {
  TerrainModel l = model(100, 120, 140, 400, 1e6);
  const TerrainModel t = model(101, 119, 140, 399, 1);
  for (int i = 0; i < 256; ++i)
    absorb(l, t);
  EXPECT_EQ(l.mean, t.mean);
  EXPECT_EQ(l.variance, t.variance);
}

TEST(Absorb, StaysBetweenTheTwo) {
  std::mt19937 random(3);
  for (int i = 0; i < 500; ++i) {
    const TerrainModel before = random_model(random), t = random_model(random);
    TerrainModel l = before;
    absorb(l, t);
    for (int c = 0; c < 3; ++c) {
      EXPECT_GE(l.mean[c], std::min(before.mean[c], t.mean[c]));
      EXPECT_LE(l.mean[c], std::max(before.mean[c], t.mean[c]));
    }
  }
}

TEST(Learn, FillsNullSlotsThenReplacesTheLightest) {
  std::array<TerrainModel, 3> learned{};
  const std::array<TerrainModel, 1> a{model(20, 20, 20, 20, 30)}, b{model(80, 20, 20, 20, 10)},
      c{model(140, 20, 20, 20, 20)}, d{model(200, 20, 20, 20, 1)};
  learn(learned, a, {});
  learn(learned, b, {});
  EXPECT_EQ(learned[0], a[0]);
  EXPECT_EQ(learned[1], b[0]);
  EXPECT_EQ(learned[2].mass, 0u);
  learn(learned, c, {});
  learn(learned, d, {});
  EXPECT_EQ(learned[0], a[0]);
  EXPECT_EQ(learned[1], d[0]); // b was the lightest
  EXPECT_EQ(learned[2], c[0]);
}

TEST(Learn, OneFramesModelsDoNotReplaceEachOther) {
  std::array<TerrainModel, 5> learned{};
  for (int n = 0; n < 5; ++n)
    learned[n] = model(10 + 10 * n, 250, 250, 16, 1000 + n);
  const std::array<TerrainModel, 3> t{model(100, 20, 20, 16, 60), model(150, 20, 20, 16, 40),
                                      model(200, 20, 20, 16, 20)};
  learn(learned, t, {});
  EXPECT_EQ(learned[0], t[0]);
  EXPECT_EQ(learned[1], t[1]);
  EXPECT_EQ(learned[2], t[2]);
  EXPECT_EQ(learned[4], model(50, 250, 250, 16, 1004));
}

TEST(Learn, MatchesAreMergedByMass) {
  std::array<TerrainModel, 2> learned{model(100, 100, 100, 40, 30), {}};
  const std::array<TerrainModel, 1> t{model(104, 100, 100, 20, 10)};
  learn(learned, t, {});
  EXPECT_EQ(learned[0], model(101, 100, 100, 35, 40));
  EXPECT_EQ(learned[1].mass, 0u);
}

TEST(Learn, TheCapKeepsLearningAlive) {
  std::array<TerrainModel, 2> learned{};
  LearningRule rule;
  rule.mass_cap = 64 * 100 * 256;
  const std::array<TerrainModel, 1> old_light{model(100, 100, 100, 60, 100)};
  for (int i = 0; i < 5000; ++i)
    learn(learned, old_light, rule);
  EXPECT_EQ(learned[0].mass, rule.mass_cap);
  const std::array<TerrainModel, 1> new_light{model(108, 100, 100, 60, 100)};
  for (int i = 0; i < 200; ++i)
    learn(learned, new_light, rule);
  // 200 steps of 1/65 leave exp(-200/65) = 4.6 % of the difference.
  EXPECT_NEAR(learned[0].mean[0] / 256.0, 108 - 8 * std::pow(64.0 / 65, 200), 0.5);
  EXPECT_EQ(learned[1].mass, 0u);
}

TEST(Learn, MassesFade) {
  std::array<TerrainModel, 2> learned{model(100, 100, 100, 20, 3200), {}};
  LearningRule rule;
  rule.forget_shift = 5;
  const std::array<TerrainModel, 1> t{model(200, 100, 100, 20, 10)};
  learn(learned, t, rule);
  EXPECT_EQ(learned[0].mass, 3100u * 256);
  EXPECT_EQ(learned[1].mass, 10u * 256);
}

TEST(Learn, MassesOfYearsDoNotOverflow) {
  TerrainModel l = model(10, 20, 30, 400, 1);
  l.mass = std::uint64_t{1} << 60;
  TerrainModel t = model(250, 20, 30, 16000, 1);
  t.mass = std::uint64_t{1} << 38;
  const TerrainModel before = l;
  absorb(l, t);
  EXPECT_EQ(l.mean[0], before.mean[0] + 1);
  EXPECT_GT(l.mass, before.mass);
}

TEST(ResizeMixture, DropsTheLightest) {
  std::vector<TerrainModel> learned{model(1, 1, 1, 20, 5), model(2, 1, 1, 20, 3), model(3, 1, 1, 20, 9), {}};
  resize_mixture(learned, 2);
  ASSERT_EQ(learned.size(), 2u);
  EXPECT_EQ(learned[0], model(1, 1, 1, 20, 5));
  EXPECT_EQ(learned[1], model(3, 1, 1, 20, 9));
  resize_mixture(learned, 4);
  EXPECT_EQ(learned.size(), 4u);
  EXPECT_EQ(learned[3].mass, 0u);
}

TEST(WellFormed, RefusesWhatLearningCannotRelyOn) {
  Terrain good;
  good.models = {model(1, 2, 3, 20, 5), {}};
  good.negative_colors.resize(color_bins);
  EXPECT_EQ(flaw_of(good), "");
  EXPECT_EQ(flaw_of(Terrain{}), "");
  Terrain bad = good;
  bad.models.resize(max_models + 1);
  EXPECT_NE(flaw_of(bad), "");
  bad = good;
  bad.models[0].variance[2] = 0;
  EXPECT_NE(flaw_of(bad), "");
  bad = good;
  bad.models[0].variance[1] = (65536u << 8) + 1;
  EXPECT_NE(flaw_of(bad), "");
  bad = good;
  bad.negative_colors.resize(color_bins - 1);
  EXPECT_NE(flaw_of(bad), "");
  bad = good;
  bad.terrain_texture.resize(texture_bins + 1);
  EXPECT_NE(flaw_of(bad), "");
}

TEST(Heaviest, IsNoneWhileAllAreNull) {
  std::array<TerrainModel, 3> learned{};
  EXPECT_EQ(heaviest(learned), -1);
  learned[2] = model(1, 1, 1, 20, 5);
  learned[1] = model(1, 1, 1, 20, 6);
  EXPECT_EQ(heaviest(learned), 1);
}

} // namespace
} // namespace terrainseg
