// SPDX-License-Identifier: LGPL-2.1-or-later
// terrainseg-eval metres: its figures by hand, and ranges against the world that the scene draws.
#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include <gtest/gtest.h>

#include "lab/eval/metres.hpp"
#include "metric/free_space_ranges.hpp"
#include "scene/camera.hpp"
#include "scene/world.hpp"

namespace terrainseg::eval {
namespace {

using scene::Kind;
using scene::Motion;

constexpr double free_range = std::numeric_limits<double>::infinity();
constexpr double unknown_range = std::numeric_limits<double>::quiet_NaN();

TEST(RangeErrors, FiguresByHand) {
  RangeErrors errors;
  for (int percent = 0; percent <= 8; ++percent) // of 4 m: 0 .. 32 % too long
    errors.add(4, 4 * (1 + 0.04 * percent));
  errors.add(4, free_range);
  errors.add(4, 2);
  errors.add(4, unknown_range);
  errors.add(25, 25);
  errors.add(free_range, 3);
  const auto figures = errors.figures(2);
  ASSERT_TRUE(figures);
  EXPECT_EQ(figures->columns, 11u);
  EXPECT_NEAR(figures->median, 20, 1e-9);
  EXPECT_NEAR(figures->p90, 50, 1e-9);
  EXPECT_NEAR(figures->too_long, 100.0 * 4 / 11, 1e-9) << "24, 28, 32 % and free";
  for (const std::size_t empty : {0, 1, 3, 4})
    EXPECT_FALSE(errors.figures(empty)) << RangeErrors::name(empty);
  RangeErrors both;
  both.add(errors);
  both.add(errors);
  EXPECT_EQ(both.figures(2)->columns, 22u);
  EXPECT_NEAR(both.figures(2)->too_long, figures->too_long, 1e-9);
  EXPECT_EQ(RangeErrors::name(2), "3 - 5 m");
}

TEST(RangeErrors, MostlyFreeIsNoNumber) {
  RangeErrors errors;
  for (int i = 0; i < 3; ++i)
    errors.add(4, i < 1 ? 4 : free_range);
  EXPECT_TRUE(std::isinf(errors.figures(2)->median));
}

/// Rows from below: labels of one column.
std::vector<std::uint8_t> column_of(std::initializer_list<int> from_below) {
  std::vector<std::uint8_t> column(from_below.begin(), from_below.end());
  std::reverse(column.begin(), column.end());
  return column;
}

TEST(Metres, WhereTheLabelsEnd) {
  const auto end = [](const std::vector<std::uint8_t>& column) {
    return true_end({{column.data(), 1}, 1, static_cast<int>(column.size())}, 0);
  };
  const TrueEnd plain = end(column_of({1, 1, 2, 0, 1, 3}));
  EXPECT_EQ(plain.row, 3);
  EXPECT_EQ(plain.seen, 3);
  const TrueEnd kerb = end(column_of({1, 255, 2, 2, 3, 3}));
  EXPECT_EQ(kerb.row, 2);
  EXPECT_EQ(kerb.seen, 2);
  const TrueEnd rim = end(column_of({1, 1, 255, 255, 0, 0}));
  EXPECT_EQ(rim.row, 4);
  EXPECT_EQ(rim.seen, 2);
  EXPECT_EQ(end(column_of({0, 1, 1, 3, 3, 3})).row, 6) << "no ground at the lower edge";
}

/// The test vectors of a camera of 640x480 that were worked out with another program.
TEST(Metres, GroundOfAPixel) {
  constexpr double degree = 3.14159265358979323846 / 180;
  const scene::View level{0.5, 554.25, 10 * degree, 0, 320.5, 240.5};
  EXPECT_NEAR(ground_range(level, 320.5, 240.5), 2.8356, 5e-5);
  EXPECT_NEAR(ground_range(level, 0, 400), 1.2025, 5e-5);
  EXPECT_NEAR(ground_range(level, 320.5, 150), 39.4376, 5e-4);
  EXPECT_TRUE(std::isinf(ground_range(level, 320.5, 142)));
  scene::View rolled = level;
  rolled.roll = 5 * degree;
  EXPECT_NEAR(ground_range(rolled, 100, 350), 1.5634, 5e-5);
  EXPECT_NEAR(ground_range(rolled, 540, 350), 1.2669, 5e-5);
}

/// Columns of all spans, and how many of them read too long.
std::pair<double, double> columns_of(const RangeErrors& errors) {
  double all = 0, too_long = 0;
  for (std::size_t span = 0; span < RangeErrors::spans; ++span)
    if (const auto figures = errors.figures(span)) {
      all += static_cast<double>(figures->columns);
      too_long += figures->too_long / 100 * static_cast<double>(figures->columns);
    }
  return {all, too_long};
}

/// The largest 90th percentile of a case up to ten metres, percent.
double largest_p90(const RangeErrors& errors) {
  double largest = 0;
  for (std::size_t span = 0; RangeErrors::ends[span] <= 10; ++span)
    if (const auto figures = errors.figures(span))
      largest = std::max(largest, figures->p90);
  return largest;
}

TEST(Metres, GeometryAloneIsUnderOnePercent) {
  for (const Motion motion : {Motion::straight, Motion::bumpy})
    for (const Kind kind : {Kind::road, Kind::corridor}) {
      MetricDrive drive;
      drive.scene.kind = kind;
      drive.scene.motion = motion;
      drive.scene.seed = 7;
      drive.width = 320;
      drive.height = 180;
      drive.warm_up = 2;
      drive.frames = 16;
      drive.step = 3;
      const MetricErrors errors = measure(drive);
      EXPECT_LT(largest_p90(errors[0]), 0.1) << metric_cases[0].name;
      EXPECT_GT(columns_of(errors[0]).first, 100);
      if (motion == Motion::bumpy) {
        EXPECT_GT(largest_p90(errors[2]), 5) << metric_cases[2].name << ": a bump is a wrong metre";
      }
      // The sign of what is told: a camera that is told to look lower sees things nearer.
      EXPECT_LE(columns_of(errors[3]).second, columns_of(errors[4]).second);
    }
}

/// Both walls of a corridor are planes beside its middle: how far a point on their foot lies from the camera
/// sidewards needs none of the camera's angles but its heading.
TEST(Metres, TheFootOfAWallIsWhereTheWallStands) {
  constexpr int width = 1280, height = 720;
  for (const Motion motion : {Motion::straight, Motion::bumpy}) {
    scene::Settings settings{Kind::corridor, scene::Light::day, motion, 5, 0};
    scene::Renderer renderer(settings, width, height);
    scene::Picture picture(PixelFormat::I420, width, height);
    const scene::Path path(settings);
    const double half_width = scene::place_of(settings).half_width;
    metric::FreeSpaceRanges ranges;
    long columns = 0;
    double largest = 0;
    for (const std::uint64_t number : {11u, 47u}) {
      renderer.render(number, picture);
      const scene::View view = renderer.view_of(number);
      const scene::Camera world = scene::moment_of(settings, path, number, width, height).camera;
      const double heading = std::atan2(world.forward.x, world.forward.z); // positive to the right
      metric::Camera camera{width, height, view.focal, view.focal, view.center_x, view.center_y};
      metric::Mount mount;
      mount.height = view.height;
      mount.pitch = view.pitch;
      mount.roll = view.roll;
      ranges.adapt(camera, width, height, {0, 0, width, height}, width);
      std::vector<std::uint16_t> rows;
      for (int x = 0; x < width; ++x)
        rows.push_back(static_cast<std::uint16_t>(true_end(picture.labels(), x).row));
      const metric::RangeColumns& read = ranges.measure(rows, false, mount, 10);
      for (std::size_t i = 0; i < rows.size(); ++i) {
        const double to_right = std::sin(heading - read.bearings[i]);
        if (rows[i] == height || !std::isfinite(read.ranges[i]) || std::abs(to_right) < 0.05)
          continue; // a wall that cuts the lower edge stands nearer than what is seen
        const double to_wall = to_right > 0 ? half_width - world.position.x : half_width + world.position.x;
        const double truth = to_wall / std::abs(to_right);
        if (truth > 10)
          continue;
        ++columns;
        largest = std::max(largest, std::abs(read.ranges[i] / truth - 1));
      }
    }
    EXPECT_GT(columns, 500);
    // Half a row is 0.7 % at ten metres: what a boundary in whole rows cannot say.
    EXPECT_LT(largest, 0.01);
  }
}

TEST(Metres, WordsThatMakeNoSense) {
  EXPECT_ANY_THROW(run_metres({"--places", "0"}));
  EXPECT_ANY_THROW(run_metres({"drive"}));
}

} // namespace
} // namespace terrainseg::eval
