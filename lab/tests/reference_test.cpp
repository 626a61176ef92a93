// SPDX-License-Identifier: LGPL-2.1-or-later
// The unmodified algorithm against cases small enough to work out by hand.
#include <algorithm>
#include <cmath>
#include <random>

#include <gtest/gtest.h>
#include <opencv2/imgproc.hpp>

#include "lab/reference/reference_engine.hpp"
#include "lab/reference/scoring.hpp"

namespace terrainseg::reference {
namespace {

Gaussian gaussian(const Eigen::Vector3d& mean, const Eigen::Vector3d& variance, double mass) {
  return {mean, variance.asDiagonal(), mass};
}

TrainingColors colors_of(const std::vector<Eigen::Vector3d>& list) {
  TrainingColors colors;
  for (const Eigen::Vector3d& c : list)
    colors.push_back(c[0], c[1], c[2]);
  return colors;
}

TEST(Gaussian, SeparationAddsTheCovariances) {
  // (6, 0, 0) apart, variances 5 + 4 along it: 36 / 9.
  EXPECT_DOUBLE_EQ(separation(gaussian({10, 0, 0}, {5, 1, 1}, 1), gaussian({4, 0, 0}, {4, 1, 1}, 1)), 4);
}

TEST(Gaussian, SeparationHeedsTheCorrelation) {
  // Sum of covariances {{2, 1}, {1, 2}} has the inverse {{2, -1}, {-1, 2}} / 3: along (1, 1) the squared
  // distance is 2/3, across, along (1, -1), it is 2.
  Gaussian a, b;
  a.covariance << 2, 1, 0, 1, 2, 0, 0, 0, 1;
  b.mean = {1, 1, 0};
  EXPECT_NEAR(separation(a, b), 2.0 / 3, 1e-12);
  b.mean = {1, -1, 0};
  EXPECT_NEAR(separation(a, b), 2, 1e-12);
}

TEST(Gaussian, SeparationOfSingularModelsIsInfinite) {
  EXPECT_TRUE(std::isinf(separation(gaussian({0, 0, 0}, {0, 1, 1}, 1), gaussian({1, 0, 0}, {0, 1, 1}, 1))));
}

TEST(Gaussian, MergeWeighsByMass) {
  const Gaussian m = merged(gaussian({10, 20, 30}, {4, 8, 12}, 3), gaussian({18, 20, 26}, {8, 8, 4}, 1));
  EXPECT_EQ(m.mean, Eigen::Vector3d(12, 20, 29));
  EXPECT_EQ(m.covariance, Eigen::Matrix3d(Eigen::Vector3d(5, 8, 10).asDiagonal()));
  EXPECT_EQ(m.mass, 4);
}

TEST(Gaussian, WhiteningIsTheInverseCovariance) {
  Gaussian model;
  model.mean = {100, 90, 80};
  model.covariance << 40, 12, 5, 12, 30, 7, 5, 7, 20;
  const Eigen::Vector3d color(111, 87, 95);
  const Eigen::Vector3d off = color - model.mean;
  EXPECT_NEAR(Whitening(model).squared_distance(color), off.dot(model.covariance.inverse() * off), 1e-10);
}

TEST(Mixture, NullSlotsAreFilledBeforeTheLightestIsReplaced) {
  Mixture mixture(2);
  EXPECT_TRUE(mixture.empty());
  EXPECT_TRUE(mixture.heaviest(0.3).empty());
  mixture.learn({gaussian({0, 0, 0}, {1, 1, 1}, 5)}, 1, 1000);
  mixture.learn({gaussian({100, 0, 0}, {1, 1, 1}, 9)}, 1, 1000);
  ASSERT_EQ(mixture.heaviest(0).size(), 2U);
  mixture.learn({gaussian({200, 0, 0}, {1, 1, 1}, 1)}, 1, 1000);
  EXPECT_EQ(mixture.models()[0].mean[0], 200);
  EXPECT_EQ(mixture.models()[0].mass, 1);
  EXPECT_EQ(mixture.models()[1].mean[0], 100);
}

TEST(Mixture, TheNearestOfSeveralMatchesIsUpdated) {
  Mixture mixture(3);
  // Both match a model at 10 with variances 100 + 100: 100/200 and 25/200; with each other they do not
  // meet, since they are learned with variance 1.
  mixture.learn({gaussian({0, 0, 0}, {1, 1, 1}, 7), gaussian({15, 0, 0}, {1, 1, 1}, 6)}, 1, 1000);
  mixture.learn({gaussian({10, 0, 0}, {199, 199, 199}, 2)}, 1, 1000);
  EXPECT_EQ(mixture.models()[0].mass, 7);
  EXPECT_EQ(mixture.models()[1].mass, 8);
  EXPECT_DOUBLE_EQ(mixture.models()[1].mean[0], (15 * 6 + 10 * 2) / 8.0);
}

TEST(Mixture, AMatchAtTheThresholdStillCounts) {
  Mixture mixture(2);
  mixture.learn({gaussian({0, 0, 0}, {2, 2, 2}, 4)}, 1, 1000);
  mixture.learn({gaussian({2, 0, 0}, {2, 2, 2}, 4)}, 1, 1000); // 4 / (2 + 2) = 1
  EXPECT_EQ(mixture.heaviest(0).size(), 1U);
  EXPECT_EQ(mixture.models()[0].mass, 8);
}

TEST(Mixture, HeaviestFirstWhateverTheOrder) {
  // One slot: the light cluster comes last and, without a match, takes the slot.
  Mixture mixture(1);
  mixture.learn({gaussian({0, 0, 0}, {1, 1, 1}, 1), gaussian({100, 0, 0}, {1, 1, 1}, 9)}, 1, 1000);
  EXPECT_EQ(mixture.models()[0].mean[0], 0);
}

TEST(Mixture, MassIsCappedSoThatLearningGoesOn) {
  Mixture mixture(2);
  for (int i = 0; i < 1000; ++i)
    mixture.learn({gaussian({50, 50, 50}, {9, 9, 9}, 10)}, 1, 40);
  EXPECT_EQ(mixture.models()[0].mass, 40);
  mixture.learn({gaussian({52, 50, 50}, {9, 9, 9}, 10)}, 1, 40);
  EXPECT_NEAR(mixture.models()[0].mean[0], 50 + 2 * 10.0 / 50, 1e-9);
}

TEST(Mixture, OnlyModelsAboveTheShareScore) {
  Mixture mixture(4);
  mixture.learn({gaussian({0, 0, 0}, {1, 1, 1}, 100), gaussian({50, 0, 0}, {1, 1, 1}, 30),
                 gaussian({100, 0, 0}, {1, 1, 1}, 29)},
                1, 1000);
  EXPECT_EQ(mixture.heaviest(0.3).size(), 2U);
}

TEST(Clusters, TwoGroupsAreFoundWithTheirCovariance) {
  std::vector<Eigen::Vector3d> list;
  for (int i = 0; i < 3; ++i)
    for (const Eigen::Vector3d& off : {Eigen::Vector3d(1, 1, 0), Eigen::Vector3d(-1, -1, 0)})
      list.push_back(Eigen::Vector3d(20, 20, 20) + off);
  for (const Eigen::Vector3d& off : {Eigen::Vector3d(2, 0, 0), Eigen::Vector3d(-2, 0, 0)})
    list.push_back(Eigen::Vector3d(200, 10, 90) + off);
  const Clustering found = cluster(colors_of(list), 2, 20, 1);
  ASSERT_EQ(found.clusters.size(), 2U);
  const std::uint8_t first = found.members[0];
  for (int i = 0; i < 8; ++i)
    EXPECT_EQ(found.members[static_cast<std::size_t>(i)] == first, i < 6);
  const Gaussian& big = found.clusters[first];
  const Gaussian& small = found.clusters[1 - first];
  EXPECT_EQ(big.mass, 6);
  EXPECT_EQ(big.mean, Eigen::Vector3d(20, 20, 20));
  Eigen::Matrix3d expected;
  expected << 1, 1, 0, 1, 1, 0, 0, 0, 0;
  EXPECT_EQ(big.covariance, expected);
  EXPECT_EQ(small.mass, 2);
  EXPECT_EQ(small.covariance(0, 0), 4);
}

TEST(Clusters, OneColourIsOneCluster) {
  const Clustering found = cluster(colors_of(std::vector<Eigen::Vector3d>(50, {7, 8, 9})), 3, 20, 1);
  ASSERT_EQ(found.clusters.size(), 1U);
  EXPECT_EQ(found.clusters[0].mass, 50);
  EXPECT_EQ(found.clusters[0].mean, Eigen::Vector3d(7, 8, 9));
}

TEST(Clusters, NothingIsNoCluster) {
  EXPECT_TRUE(cluster({}, 3, 20, 1).clusters.empty());
}

TEST(Clusters, TheResultIsAFixedPointOfLloyd) {
  // Every pixel belongs to the centre that is nearest among the final means, and masses add up.
  std::mt19937 random(7);
  std::vector<Eigen::Vector3d> list;
  for (int i = 0; i < 3000; ++i) {
    const double base = i % 3 * 70.0;
    list.push_back({base + random() % 20, base + random() % 20, 30.0 + random() % 20});
  }
  const Clustering found = cluster(colors_of(list), 3, 100, 5);
  ASSERT_EQ(found.clusters.size(), 3U);
  double mass = 0;
  for (const Gaussian& c : found.clusters)
    mass += c.mass;
  EXPECT_EQ(mass, 3000);
  for (std::size_t i = 0; i < list.size(); ++i) {
    const double own = (list[i] - found.clusters[found.members[i]].mean).squaredNorm();
    for (const Gaussian& c : found.clusters)
      ASSERT_LE(own, (list[i] - c.mean).squaredNorm() + 1e-9);
  }
}

TEST(Window, PaperRuleIsPowersOfTwo) {
  EXPECT_EQ(window_in({640, 480}, {}), cv::Rect(256, 416, 128, 64));
  EXPECT_EQ(window_in({639, 480}, {}), cv::Rect(287, 448, 64, 32)); // 639 / 5 = 127
  EXPECT_EQ(window_in({1280, 720}, {.bottom = 20}), cv::Rect(512, 572, 256, 128));
}

TEST(Window, ShareRuleAndClipping) {
  EXPECT_EQ(window_in({1000, 400}, {.power_of_two_window = false}), cv::Rect(350, 340, 300, 60));
  EXPECT_EQ(window_in({100, 50}, {.width = 60, .height = 20, .bottom = 40, .x = 70}),
            cv::Rect(70, 0, 30, 10));
  EXPECT_TRUE(window_in({100, 50}, {.bottom = 60}).empty());
}

TEST(Window, PrefilterDropsTheOddPixel) {
  cv::Mat frame(10, 10, CV_8UC3, cv::Scalar(100, 100, 100));
  frame.at<cv::Vec3b>(5, 5) = {100, 100, 200};
  cv::Mat kept;
  window_pixels(frame, {0, 0, 10, 10}, 0, kept);
  EXPECT_EQ(cv::countNonZero(kept), 100);
  window_pixels(frame, {0, 0, 10, 10}, 1, kept);
  EXPECT_EQ(cv::countNonZero(kept), 99);
  EXPECT_EQ(kept.at<std::uint8_t>(5, 5), 0);
}

TEST(Range, TheProfileOfAnExponentialFloorIsFound) {
  cv::Mat depth(100, 40, CV_16UC1, cv::Scalar(0));
  for (int y = 40; y < 100; ++y)
    depth.row(y).setTo(std::lround(1500 * std::exp(1.8 * (99.5 - y) / 100)));
  const auto floor = fit_floor(depth, {10, 80, 20, 20}, 0.1);
  ASSERT_TRUE(floor);
  EXPECT_NEAR(floor->a, 1.5, 0.002);
  EXPECT_NEAR(floor->b, 1.8, 0.01);
}

TEST(Range, AnObstacleBesideTheWindowDoesNotBendTheFit) {
  cv::Mat depth(100, 40, CV_16UC1);
  for (int y = 0; y < 100; ++y)
    depth.row(y).setTo(std::lround(1500 * std::exp(1.8 * (99.5 - y) / 100)));
  depth({0, 40, 12, 40}).setTo(900);
  const auto floor = fit_floor(depth, {14, 80, 20, 20}, 0.1);
  ASSERT_TRUE(floor);
  EXPECT_NEAR(floor->b, 1.8, 0.01);
  const cv::Mat chosen = floor_pixels(depth, *floor, 0.1, 2.5);
  EXPECT_EQ(chosen.at<std::uint8_t>(60, 5), 0);    // the obstacle
  EXPECT_EQ(chosen.at<std::uint8_t>(90, 5), 255);  // floor below it
  EXPECT_EQ(chosen.at<std::uint8_t>(60, 20), 0);   // floor, but 3.1 m away
  EXPECT_EQ(chosen.at<std::uint8_t>(75, 20), 255); // floor at 2.35 m
}

TEST(Range, TooLittleDepthIsNoFloor) {
  EXPECT_FALSE(fit_floor(cv::Mat::zeros(100, 40, CV_16UC1), {0, 0, 40, 100}, 0.1));
  cv::Mat one_row = cv::Mat::zeros(100, 200, CV_16UC1);
  one_row.row(90).setTo(1000);
  EXPECT_FALSE(fit_floor(one_row, {0, 80, 200, 20}, 0.1));
  EXPECT_FALSE(fit_floor(one_row, {300, 80, 200, 20}, 0.1));
}

TEST(Scoring, EveryPixelIsLabelledByItsLeastDistance) {
  std::mt19937 random(3);
  cv::Mat frame(9, 37, CV_8UC3);
  for (int i = 0; i < frame.rows * frame.cols * 3; ++i)
    frame.data[i] = static_cast<std::uint8_t>(random());
  std::vector<Gaussian> models(2);
  models[0].mean = {40, 80, 120};
  models[0].covariance << 900, 200, 100, 200, 700, 50, 100, 50, 800;
  models[1].mean = {200, 180, 160};
  models[1].covariance << 400, -100, 0, -100, 900, 300, 0, 300, 1600;
  constexpr double thresholds[] = {0.5, 1, 2, 3, 4, 5, 6, 8};
  cv::Mat masks[std::size(thresholds)];
  for (std::size_t i = 0; i < std::size(thresholds); ++i)
    label_pixels(frame, models, thresholds[i], masks[i]);
  for (int y = 0; y < frame.rows; ++y)
    for (int x = 0; x < frame.cols; ++x) {
      const auto p = frame.at<cv::Vec3b>(y, x);
      double least = 1e300;
      for (const Gaussian& m : models) {
        const Eigen::Vector3d off = Eigen::Vector3d(p[0], p[1], p[2]) - m.mean;
        least = std::min(least, off.dot(m.covariance.inverse() * off));
      }
      for (std::size_t i = 0; i < std::size(thresholds); ++i)
        ASSERT_EQ(masks[i].at<std::uint8_t>(y, x), least <= thresholds[i] * thresholds[i] ? 255 : 0);
    }
}

TEST(Scoring, WithoutModelsNothingIsTerrain) {
  const cv::Mat frame(3, 3, CV_8UC3, cv::Scalar(1, 2, 3));
  cv::Mat mask;
  label_pixels(frame, {}, 3, mask);
  EXPECT_EQ(cv::countNonZero(mask), 0);
}

TEST(Scoring, OneDilationAndTwoErosions) {
  cv::Mat mask = cv::Mat::zeros(12, 12, CV_8UC1);
  mask({3, 3, 6, 6}).setTo(255);
  mask.at<std::uint8_t>(5, 5) = 0; // a hole that the dilation closes
  mask.at<std::uint8_t>(0, 11) = 255;
  CleanUp().smooth(mask, 1, 2);
  // 6x6 grows to 8x8, shrinks to 4x4; the speck in the corner is gone.
  EXPECT_EQ(cv::countNonZero(mask), 16);
  EXPECT_EQ(cv::countNonZero(mask({4, 4, 4, 4})), 16);
}

TEST(Scoring, OnlyAreasThatTouchTheTrainingPixelsStay) {
  cv::Mat mask = cv::Mat::zeros(8, 8, CV_8UC1), training = cv::Mat::zeros(8, 8, CV_8UC1);
  mask({0, 4, 3, 4}).setTo(255);
  mask({5, 0, 3, 3}).setTo(255);
  mask.at<std::uint8_t>(3, 3) = 255; // joined by its corner
  training.at<std::uint8_t>(7, 0) = 255;
  training.at<std::uint8_t>(7, 7) = 255; // not terrain: keeps nothing
  CleanUp().keep_connected(mask, training);
  EXPECT_EQ(cv::countNonZero(mask), 13);
  EXPECT_EQ(mask.at<std::uint8_t>(3, 3), 255);
  EXPECT_EQ(mask.at<std::uint8_t>(1, 6), 0);
}

/// Ground of one noisy colour below row 30, another colour above, and an obstacle on the ground.
cv::Mat two_colors(std::uint32_t seed) {
  std::mt19937 random(seed);
  cv::Mat frame(60, 160, CV_8UC3);
  for (int y = 0; y < frame.rows; ++y)
    for (int x = 0; x < frame.cols; ++x) {
      const bool obstacle = x >= 20 && x < 40 && y >= 35 && y < 50;
      const int noise = static_cast<int>(random() % 21) - 10;
      const cv::Vec3i base = y < 30     ? cv::Vec3i(220, 180, 120)
                             : obstacle ? cv::Vec3i(40, 40, 160)
                                        : cv::Vec3i(90, 100, 110);
      frame.at<cv::Vec3b>(y, x) = cv::Vec3b(cv::Vec3i(base[0] + noise, base[1] + noise, base[2] + noise));
    }
  return frame;
}

TEST(ReferenceEngine, LearnsAndLabelsAPlainScene) {
  ReferenceEngine engine;
  for (std::uint32_t i = 0; i < 3; ++i)
    engine.process(two_colors(i));
  const ReferenceResult& result = engine.result();
  EXPECT_TRUE(result.learned);
  EXPECT_EQ(result.clusters.size(), 3U);
  EXPECT_EQ(result.mask.at<std::uint8_t>(55, 100), 255);
  EXPECT_EQ(result.mask.at<std::uint8_t>(40, 30), 0);
  EXPECT_EQ(result.mask.at<std::uint8_t>(10, 100), 0);
  // Ground is 30 rows of 160 less 20 x 15; the erosion takes a rim of one pixel.
  EXPECT_NEAR(cv::countNonZero(result.mask), 30 * 160 - 300, 300);
}

TEST(ReferenceEngine, RepeatsToTheBit) {
  ReferenceEngine a, b;
  for (std::uint32_t i = 0; i < 4; ++i) {
    const cv::Mat frame = two_colors(i);
    EXPECT_EQ(cv::norm(a.process(frame).mask, b.process(frame).mask, cv::NORM_L1), 0);
  }
  for (std::size_t m = 0; m < a.result().models.size(); ++m)
    EXPECT_EQ(a.result().models[m].mean, b.result().models[m].mean);
}

TEST(ReferenceEngine, AMaskStandsInForTheWindow) {
  ReferenceEngine engine;
  const cv::Mat frame = two_colors(1);
  cv::Mat training = cv::Mat::zeros(frame.size(), CV_8UC1);
  training({50, 2, 60, 20}).setTo(200); // the "sky"
  training({0, 0, 160, 1}).setTo(127);  // below 128: does not train
  const ReferenceResult& result = engine.process(frame, training);
  EXPECT_TRUE(result.window.empty());
  EXPECT_EQ(cv::countNonZero(result.training), 1200);
  EXPECT_EQ(result.mask.at<std::uint8_t>(10, 100), 255);
  EXPECT_EQ(result.mask.at<std::uint8_t>(55, 100), 0);
}

TEST(ReferenceEngine, UnknownUntilSomethingIsLearned) {
  ReferenceSettings settings;
  settings.learning = false;
  ReferenceEngine engine(settings);
  const cv::Mat frame = two_colors(1);
  EXPECT_EQ(cv::countNonZero(engine.process(frame).mask != 128), 0);
  settings.learning = true;
  engine.configure(settings);
  EXPECT_GT(cv::countNonZero(engine.process(frame).mask == 255), 1000);
  engine.reset();
  settings.learning = false;
  engine.configure(settings);
  EXPECT_EQ(cv::countNonZero(engine.process(frame).mask != 128), 0);
}

TEST(ReferenceEngine, TooFewTrainingPixelsStarve) {
  ReferenceEngine engine;
  cv::Mat training = cv::Mat::zeros(60, 160, CV_8UC1);
  training({0, 59, 47, 1}).setTo(255); // one short of 16 x 3
  EXPECT_TRUE(engine.process(two_colors(1), training).starved);
  EXPECT_FALSE(engine.result().learned);
  training.at<std::uint8_t>(58, 0) = 255;
  EXPECT_FALSE(engine.process(two_colors(1), training).starved);
}

TEST(ReferenceEngine, ConstantAndTinyFramesAreSafe) {
  ReferenceEngine engine;
  const cv::Mat black = cv::Mat::zeros(60, 160, CV_8UC3);
  EXPECT_EQ(cv::countNonZero(engine.process(black).mask == 255), 60 * 160);
  ReferenceEngine tiny;
  EXPECT_TRUE(tiny.process(cv::Mat(1, 1, CV_8UC3, cv::Scalar(5, 5, 5))).starved);
  EXPECT_EQ(tiny.result().mask.at<std::uint8_t>(0, 0), 128);
}

TEST(ReferenceEngine, BadInputIsRefusedByName) {
  ReferenceSettings settings;
  settings.learned_models = 3;
  EXPECT_THROW(ReferenceEngine{settings}, std::invalid_argument);
  settings = {};
  settings.variance_floor = 0;
  EXPECT_THROW(ReferenceEngine{settings}, std::invalid_argument);
  ReferenceEngine engine;
  EXPECT_THROW(engine.process(cv::Mat()), std::invalid_argument);
  EXPECT_THROW(engine.process(cv::Mat(4, 4, CV_8UC1)), std::invalid_argument);
  EXPECT_THROW(engine.process(cv::Mat(4, 4, CV_8UC3), cv::Mat(2, 2, CV_8UC1)), std::invalid_argument);
}

} // namespace
} // namespace terrainseg::reference
