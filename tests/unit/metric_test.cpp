// SPDX-License-Identifier: LGPL-2.1-or-later
// From pixels to metres: against computed points, OpenCV's camera models, and geometry written apart.
#include <gtest/gtest.h>

#include <bit>
#include <chrono>
#include <cmath>
#include <limits>
#include <numbers>
#include <opencv2/calib3d.hpp>

#include "kernel_harness.hpp"
#include "metric/camera_info.hpp"
#include "metric/free_space_ranges.hpp"
#include "metric/horizon_monitor.hpp"
#include "metric/pose.hpp"

namespace terrainseg::metric {
namespace {

/// Direction in which a ray leaves the body's origin: that of the ground point, or of the ray itself.
double bearing_of(const GroundProjection& ground, const ImagePoint& ray) {
  const auto point = ground(ray);
  return point ? std::atan2(point->y, point->x) : std::atan2(ground.along(1, ray), ground.along(0, ray));
}

constexpr double degree = std::numbers::pi / 180;

Camera pinhole() {
  return {640, 480, 554.25, 554.25, 320.5, 240.5, Distortion::brown_conrady, {}};
}
Camera barrel() {
  Camera camera = pinhole();
  camera.coefficients = {-0.28, 0.07, 0.0002, 0.00002};
  return camera;
}
Mount low_mount(double roll_degrees = 0) {
  Mount mount;
  mount.height = 0.5;
  mount.pitch = 10 * degree;
  mount.roll = roll_degrees * degree;
  return mount;
}

TEST(Metric, PointsOfTheGround) {
  struct Row {
    double u, v, roll;
    bool distorted;
    double x, y, range, bearing;
  };
  // 640x480, height 0.5 m, pitch 10 degrees: computed in doubles with another program.
  for (const Row& row :
       {Row{320.5, 240.5, 0, false, 2.8356, 0, 2.8356, 0}, Row{320.5, 400, 0, false, 1.0227, 0, 1.0227, 0},
        Row{0, 400, 0, false, 1.0227, 0.6326, 1.2025, 31.740},
        Row{639, 300, 0, false, 1.7292, -1.0285, 2.0119, -30.743},
        Row{320.5, 150, 0, false, 39.4376, 0, 39.4376, 0},
        Row{100, 350, 5, false, 1.4350, 0.6203, 1.5634, 23.378},
        Row{540, 350, 5, false, 1.1765, -0.4699, 1.2669, -21.773},
        Row{0, 400, 0, true, 0.9257, 0.6667, 1.1408, 35.762},
        Row{639, 300, 0, true, 1.6509, -1.1021, 1.9850, -33.728}}) {
    const auto ray = undistort(row.distorted ? barrel() : pinhole(), row.u, row.v);
    ASSERT_TRUE(ray);
    const GroundProjection ground(low_mount(row.roll));
    const auto point = ground(*ray);
    ASSERT_TRUE(point);
    EXPECT_NEAR(point->x, row.x, 6e-5) << row.u << ", " << row.v;
    EXPECT_NEAR(point->y, row.y, 6e-5);
    EXPECT_NEAR(std::hypot(point->x, point->y), row.range, 6e-5);
    EXPECT_NEAR(bearing_of(ground, *ray) / degree, row.bearing, 6e-4);
  }
  EXPECT_FALSE(
      GroundProjection(low_mount())(*undistort(pinhole(), 320.5, 142))); // the horizon is row 142.771
  EXPECT_TRUE(GroundProjection(low_mount())(*undistort(pinhole(), 320.5, 143)));
}

TEST(Metric, YawAndPlaceOfTheCamera) {
  Mount mount = low_mount();
  mount.yaw = 90 * degree;
  mount.x = 0.3;
  mount.y = -0.1;
  const auto point = GroundProjection(mount)(*undistort(pinhole(), 320.5, 240.5));
  ASSERT_TRUE(point);
  EXPECT_NEAR(point->x, 0.3, 1e-9);
  EXPECT_NEAR(point->y, -0.1 + 0.5 / std::tan(10 * degree), 1e-9);
}

TEST(Metric, TheVanishingRowIsThatOfLevelRays) {
  for (const double pitch : {-20.0, 0.0, 10.0, 35.0})
    for (const double roll : {0.0, 15.0}) {
      Mount mount = low_mount();
      mount.pitch = pitch * degree;
      mount.roll = roll * degree;
      const double row = pinhole().cy - pinhole().fy * std::tan(mount.pitch) / std::cos(mount.roll);
      EXPECT_NEAR(*vanishing_row(mount, pinhole()), row, 1e-6) << pitch << ' ' << roll;
      for (const Distortion lens : {Distortion::brown_conrady, Distortion::equidistant}) {
        Camera camera = lens == Distortion::equidistant ? pinhole() : barrel();
        camera.distortion = lens;
        const auto bent = vanishing_row(mount, camera);
        ASSERT_TRUE(bent);
        const auto ray = undistort(camera, camera.cx, *bent);
        ASSERT_TRUE(ray);
        EXPECT_NEAR(GroundProjection(mount).along(2, *ray), 0, 1e-3);
      }
    }
  Mount upwards = low_mount(); // no level ray before a camera that lies on its side
  upwards.roll = 90 * degree;
  EXPECT_FALSE(vanishing_row(upwards, pinhole()));
  Camera folded = pinhole();
  folded.coefficients = {-5, 0, 0, 0};
  Mount down = low_mount();
  down.pitch = 60 * degree;
  EXPECT_FALSE(vanishing_row(down, folded)) << "the lens shows no such ray";
}

TEST(Metric, LensesAreThoseOfOpenCv) {
  const cv::TermCriteria until(cv::TermCriteria::COUNT | cv::TermCriteria::EPS, 500, 1e-15);
  Camera rational = barrel(), fisheye = pinhole();
  rational.coefficients = {0.2, -0.1, 0.001, -0.0005, 0.02, 0.05, 0.01, 0.003};
  fisheye.distortion = Distortion::equidistant;
  fisheye.coefficients = {-0.02, 0.004, -0.003, 0.0006};
  for (const Camera& camera : {barrel(), rational, fisheye}) {
    const cv::Mat matrix =
        (cv::Mat_<double>(3, 3) << camera.fx, 0, camera.cx, 0, camera.fy, camera.cy, 0, 0, 1);
    for (double u = 0; u < 640; u += 53)
      for (double v = 0; v < 480; v += 37) {
        std::vector<cv::Point2d> in{{u, v}}, out;
        if (camera.distortion == Distortion::equidistant)
          cv::fisheye::undistortPoints(
              in, out, matrix,
              std::vector<double>(camera.coefficients.begin(), camera.coefficients.begin() + 4));
        else
          cv::undistortPoints(in, out, matrix,
                              std::vector<double>(camera.coefficients.begin(), camera.coefficients.end()),
                              cv::noArray(), cv::noArray(), until);
        const auto ray = undistort(camera, u, v);
        ASSERT_TRUE(ray);
        EXPECT_NEAR(ray->x, out[0].x, 1e-6) << u << ", " << v;
        EXPECT_NEAR(ray->y, out[0].y, 1e-6);
        const ImagePoint back = distort(camera, *ray);
        EXPECT_NEAR(back.x, u, 1e-5);
        EXPECT_NEAR(back.y, v, 1e-5);
      }
  }
}

TEST(Metric, NoRayWhereTheLensHasNone) {
  Camera wide = pinhole();
  wide.distortion = Distortion::equidistant;
  wide.fx = wide.fy = 100; // 320 pixels from the centre are 183 degrees
  EXPECT_FALSE(undistort(wide, 0, 240));
  EXPECT_TRUE(undistort(wide, 200, 240));
  Camera folded = pinhole();
  folded.coefficients = {-5, 0, 0, 0};
  EXPECT_FALSE(undistort(folded, 0, 0));
}

TEST(Metric, PicturesOfAnotherSizeAreTheSameCamera) {
  const Camera half = scaled(barrel(), 320, 240);
  for (double u : {0.0, 100.0, 319.0}) {
    // The centre of a pixel that is twice as wide lies between two of the larger picture.
    const auto small = undistort(half, u, 50), large = undistort(barrel(), 2 * u + 0.5, 100.5);
    ASSERT_TRUE(small && large);
    EXPECT_NEAR(small->x, large->x, 1e-12);
    EXPECT_NEAR(small->y, large->y, 1e-12);
  }
}

// Column by column with the functions above, rounded.
TEST(Metric, RangesOfABoundary) {
  constexpr int columns = 201;
  std::vector<std::uint16_t> boundary(columns);
  for (int i = 0; i < columns; ++i)
    boundary[i] =
        static_cast<std::uint16_t>(100 + (i * 37) % 381); // 100 lies over the horizon, 480 = no free space
  for (const Camera& camera : {pinhole(), barrel()})
    for (double roll : {0.0, -4.0}) {
      const Mount mount = low_mount(roll);
      FreeSpaceRanges ranges;
      const Rectangle region{10, 0, 620, 480};
      ranges.adapt(camera, 640, 480, region, columns);
      const RangeColumns& found = ranges.measure(boundary, false, mount, 8);
      ASSERT_EQ(found.ranges.size(), std::size_t{columns});
      for (int i = 0; i < columns; ++i) {
        const double u = region.x + (i + 0.5) * region.width / columns - 0.5;
        const auto ray = undistort(camera, u, boundary[i] - 0.5);
        ASSERT_TRUE(ray);
        const auto range_at = [&](double more_pitch) {
          Mount tilted = mount;
          tilted.pitch += more_pitch;
          const auto point = GroundProjection(tilted)(*ray);
          return point ? std::hypot(point->x, point->y) : std::numeric_limits<double>::infinity();
        };
        const double error = std::hypot(0.5 * degree, 0.005 * 480 / camera.fy);
        const auto expect = [&](float is, double should) {
          if (should > 8)
            EXPECT_TRUE(std::isinf(is)) << i << ": " << is << " for " << should;
          else
            EXPECT_NEAR(is, should, 0.0006 + 2e-4 * should) << i;
        };
        expect(found.ranges[i], range_at(0));
        expect(found.low[i], range_at(error));
        expect(found.high[i], range_at(-error));
        EXPECT_NEAR(found.bearings[i], bearing_of(GroundProjection(mount), *ray), 0.0006 * degree + 1e-5);
        EXPECT_LE(found.low[i], found.ranges[i]);
        EXPECT_GE(found.high[i], found.ranges[i]);
      }
    }
}

// Bit by bit those of the plain target, with a wide lens and a last block of one column, too.
TEST(Metric, EveryTargetGivesTheSameRanges) {
  Camera wide = pinhole();
  wide.fx = wide.fy = 120;
  const Mount mount = low_mount(-4);
  for (const Camera& camera : {barrel(), wide})
    for (const int columns : {1, 63, 65, 320, 640}) {
      std::vector<std::uint16_t> boundary(static_cast<std::size_t>(columns));
      for (std::size_t i = 0; i < boundary.size(); ++i)
        boundary[i] = static_cast<std::uint16_t>(100 + i * 37 % 381);
      FreeSpaceRanges ranges;
      ranges.adapt(camera, 640, 480, {0, 0, 640, 480}, columns);
      std::vector<std::vector<std::uint32_t>> of_targets;
      testing::on_every_target([&] {
        const RangeColumns& found = ranges.measure(boundary, false, mount, 8);
        std::vector<std::uint32_t>& bits = of_targets.emplace_back();
        for (const auto* values : {&found.ranges, &found.bearings, &found.low, &found.high})
          for (const float value : *values)
            bits.push_back(std::bit_cast<std::uint32_t>(value));
      });
      ASSERT_FALSE(of_targets.empty());
      for (const auto& bits : of_targets)
        EXPECT_EQ(bits, of_targets.front()) << columns;
    }
}

// Straight down a column the arc tangent of a neighbour is far away: each bearing is its own.
TEST(Metric, BearingsOfAWideLens) {
  Camera wide = pinhole();
  wide.fx = wide.fy = 40;
  const Mount mount = low_mount();
  FreeSpaceRanges ranges;
  ranges.adapt(wide, 640, 480, {0, 0, 640, 480}, 80);
  const RangeColumns& found = ranges.measure(std::vector<std::uint16_t>(80, 400), false, mount, 8);
  for (int i = 0; i < 80; ++i) {
    const auto ray = undistort(wide, (i + 0.5) * 8 - 0.5, 399.5);
    ASSERT_TRUE(ray);
    EXPECT_NEAR(found.bearings[static_cast<std::size_t>(i)], bearing_of(GroundProjection(mount), *ray),
                0.0006 * degree + 2e-7)
        << i;
  }
}

// Its columns lie on both sides of half a turn.
TEST(Metric, BearingsOfACameraThatLooksBack) {
  for (const double yaw : {180.0, -180.0, 179.0, -178.0}) {
    Mount mount = low_mount();
    mount.yaw = yaw * degree;
    FreeSpaceRanges ranges;
    ranges.adapt(pinhole(), 640, 480, {0, 0, 640, 480}, 320);
    const RangeColumns& found = ranges.measure(std::vector<std::uint16_t>(320, 400), false, mount, 8);
    for (int i = 0; i < 320; ++i) {
      const auto ray = undistort(pinhole(), (i + 0.5) * 2 - 0.5, 399.5);
      ASSERT_TRUE(ray);
      const double is = found.bearings[static_cast<std::size_t>(i)];
      EXPECT_LE(std::abs(is), std::numbers::pi + 1e-6) << yaw << ", " << i;
      EXPECT_NEAR(std::remainder(is - bearing_of(GroundProjection(mount), *ray), 2 * std::numbers::pi), 0,
                  0.0006 * degree + 2e-7);
    }
  }
}

TEST(Metric, UnknownIsNoDistance) {
  FreeSpaceRanges ranges;
  ranges.adapt(pinhole(), 640, 480, {0, 0, 640, 480}, 64);
  const std::vector<std::uint16_t> boundary(64, 300), short_one(63, 300);
  for (const RangeColumns& unknown :
       {ranges.measure(boundary, true, low_mount(), 8), ranges.measure(short_one, false, low_mount(), 8)})
    for (std::size_t i = 0; i < 64; ++i)
      EXPECT_TRUE(std::isnan(unknown.ranges[i]) && std::isnan(unknown.bearings[i]) &&
                  std::isnan(unknown.low[i]) && std::isnan(unknown.high[i]));
  EXPECT_FALSE(std::isnan(ranges.measure(boundary, false, low_mount(), 8).ranges[0]));
}

TEST(Metric, TablesFollowTheLayout) {
  FreeSpaceRanges ranges;
  ranges.adapt(pinhole(), 640, 480, {0, 0, 640, 480}, 64);
  const float before = ranges.measure(std::vector<std::uint16_t>(64, 300), false, low_mount(), 8).ranges[32];
  ranges.adapt(pinhole(), 1280, 960, {0, 0, 1280, 960}, 64);
  EXPECT_NEAR(ranges.measure(std::vector<std::uint16_t>(64, 600), false, low_mount(), 8).ranges[32], before,
              0.005);
}

TEST(Metric, TablesAreMadeOnlyWhenSomethingChanges) {
  using Clock = std::chrono::steady_clock;
  FreeSpaceRanges ranges;
  const auto begin = Clock::now();
  ranges.adapt(barrel(), 1920, 1080, {0, 0, 1920, 1080}, 1920);
  const auto made = Clock::now();
  for (int i = 0; i < 100; ++i)
    ranges.adapt(barrel(), 1920, 1080, {0, 0, 1920, 1080}, 1920);
  EXPECT_LT(Clock::now() - made, made - begin);
}

TEST(Metric, WhereTheErrorReachesAFifth) {
  const Camera camera = pinhole();
  const Mount mount = low_mount();
  const double limit = expected_range_limit(mount, camera, 480),
               error = angle_error(mount, camera, 0.005 * 480);
  // d(range)/d(angle) = d^2 / h
  EXPECT_NEAR(limit * limit / mount.height * error / limit, 0.2, 1e-9);
  EXPECT_NEAR(limit, 10.3, 0.2);
}

TEST(Mount, Text) {
  std::string error;
  const auto mount =
      parse_mount("height=0.5, pitch=10deg,roll=-0.02,yaw=+1e-3,x=0.2,y=-.1,pitch-error=1deg", error);
  ASSERT_TRUE(mount) << error;
  EXPECT_EQ(mount->height, 0.5);
  EXPECT_NEAR(mount->pitch, 10 * degree, 1e-15);
  EXPECT_EQ(mount->roll, -0.02);
  EXPECT_EQ(mount->yaw, 1e-3);
  EXPECT_EQ(mount->y, -0.1);
  EXPECT_NEAR(mount->pitch_error, degree, 1e-15);
  EXPECT_EQ(parse_mount("height=1,pitch_error=0.25", error).value().pitch_error, 0.25);
  EXPECT_EQ(read_mount("height: 1\npitch-error: 0.25\n", error).value().pitch_error, 0.25);
  EXPECT_EQ(read_mount("mount: {height: 1, pitch_error: 0.25}\n", error).value().pitch_error, 0.25);
  for (const char* wrong :
       {"", "pitch=0.1", "height=0", "height=-1", "height=nan", "height=inf", "height=1,pitch=90deg",
        "height=1,pitch=10", "height=1m", "height", "height=1,tilt=3", "height=1,height=1",
        "height=1,pitch_error=0.1,pitch-error=0.1", "height=1deg", "height=1,,", "height=1e300"}) {
    error.clear();
    EXPECT_FALSE(parse_mount(wrong, error)) << wrong;
    EXPECT_FALSE(error.empty()) << wrong;
  }
}

TEST(CameraInfo, ThreeForms) {
  std::string error;
  const auto ros = read_camera_info(
      "image_width: 640\nimage_height: 480\ncamera_name: front\ncamera_matrix:\n  rows: 3\n  cols: 3\n"
      "  data: [554.25, 0, 320.5, 0, 554.25, 240.5, 0, 0, 1]\ndistortion_model: plumb_bob\n"
      "distortion_coefficients:\n  rows: 1\n  cols: 5\n  data: [-0.28, 0.07, 0.0002, 2.0e-05, 0.000000]\n",
      error);
  ASSERT_TRUE(ros) << error;
  EXPECT_EQ(*ros, barrel());
  const auto kalibr = read_camera_info("cam0:\n  cam_overlaps: []\n  camera_model: pinhole\n  "
                                       "distortion_coeffs: [-0.28, 0.07, 0.0002, 2.0e-05]\n"
                                       "  distortion_model: radtan\n  intrinsics: [554.25, 554.25, 320.5, "
                                       "240.5]\n  resolution: [640, 480]\n  rostopic: /cam0/image_raw\n",
                                       error);
  ASSERT_TRUE(kalibr) << error;
  EXPECT_EQ(*kalibr, barrel());
  const auto opencv =
      read_camera_info("%YAML:1.0\n---\nimage_width: 640\nimage_height: 480\ncamera_matrix: "
                       "!!opencv-matrix\n   rows: 3\n   cols: 3\n   dt: d\n"
                       "   data: [ 554.25, 0., 320.5, 0., 554.25, 240.5, 0., 0., 1. "
                       "]\ndistortion_coefficients: !!opencv-matrix\n   rows: 5\n   cols: 1\n   dt: d\n"
                       "   data: [ -0.28, 0.07, 0.0002, 2.0e-05, 0. ]\n",
                       error);
  ASSERT_TRUE(opencv) << error;
  EXPECT_EQ(*opencv, barrel());
}

void expect_refused(const std::string& text, const char* says) {
  std::string error;
  EXPECT_FALSE(read_camera_info(text, error)) << text.substr(0, 200);
  EXPECT_NE(error.find(says), std::string::npos) << text.substr(0, 200) << "\n -> " << error;
}

TEST(CameraInfo, WhatCannotBeRead) {
  const std::string sizes = "image_width: 640\nimage_height: 480\n";
  const std::string good = sizes + "camera_matrix: {data: [500, 0, 320, 0, 500, 240, 0, 0, 1]}\n";
  std::string error;
  ASSERT_TRUE(read_camera_info(good, error)) << error;
  expect_refused("", "no keys");
  expect_refused("- 1\n- 2\n", "no keys");
  expect_refused("image_width: [", "YAML");
  expect_refused("image_width: 640\n", "image_height is missing");
  expect_refused(good + "distortion_model: omni\n", "omni");
  expect_refused(good + "distortion_coefficients: {data: [1, 2, x]}\n", "not a number");
  expect_refused(good + "distortion_coefficients: {data: [0, 0, 0, 0, 0, 0, 0, 0, 1]}\n", "thin prism");
  expect_refused("image_width: 0\nimage_height: 480\n", "image_width");
  expect_refused("image_width: 640.5\nimage_height: 480\n", "image_width");
  expect_refused(sizes + "camera_matrix: {data: [500, 0]}\n", "not 9");
  expect_refused(sizes + "camera_matrix: {data: [.nan, 0, 320, 0, 500, 240, 0, 0, 1]}\n", "number");
  expect_refused(sizes + "camera_matrix: {data: [nan, 0, 320, 0, 500, 240, 0, 0, 1]}\n", "finite");
  expect_refused(sizes + "camera_matrix: {data: [-1, 0, 320, 0, 500, 240, 0, 0, 1]}\n", "focal");
  expect_refused(sizes + "camera_matrix: {data: [500, 0, 9320, 0, 500, 240, 0, 0, 1]}\n", "principal");
  expect_refused(std::string(5000, '['), "nested");
  expect_refused(std::string(5000, ' ') + "a: 1", "indented");
  expect_refused(std::string(2 << 20, 'a'), "1 MiB");
}

/// A message of ROS 2 as `ros2 topic echo` prints it.
std::string echoed(const std::string& more, const char* d = "-0.28\n- 0.07\n- 0.0002\n- 2.0e-05\n- 0.0") {
  return "header:\n  stamp:\n    sec: 1\n    nanosec: 2\n  frame_id: camera_optical\nheight: 480\nwidth: "
         "640\n"
         "distortion_model: plumb_bob\nd:\n- " +
         std::string(d) +
         "\nk:\n- 554.25\n- 0.0\n- 320.5\n- 0.0\n- 554.25\n- 240.5\n- 0.0\n- 0.0\n- 1.0\nr:\n- 1.0\np:\n- "
         "1.0\n" +
         more + "---\n";
}

TEST(CameraInfo, EverySpellingIsOneName) {
  std::string error;
  const std::string none = "binning_x: 0\nbinning_y: 0\nroi:\n  x_offset: 0\n  y_offset: 0\n  height: 0\n  "
                           "width: 0\n  do_rectify: false\n";
  for (const std::string& text :
       {echoed(none),
        echoed("binning_x: 1\nbinning_y: 1\nroi: {x_offset: 0, y_offset: 0, height: 480, width: 640}\n"),
        std::string("width: 640\nheight: 480\nK: [554.25, 0, 320.5, 0, 554.25, 240.5, 0, 0, 1]\n"
                    "D: [-0.28, 0.07, 0.0002, 2.0e-05, 0]\n"),
        std::string("image_Width: 640\nimage_Height: 480\ncameraMatrix: {data: [554.25, 0, 320.5, 0, 554.25, "
                    "240.5, 0, 0, 1]}\nDistortion_Coefficients: {data: [-0.28, 0.07, 0.0002, 2.0e-05]}\n")}) {
    const auto camera = read_camera_info(text, error);
    ASSERT_TRUE(camera) << text << error;
    EXPECT_EQ(*camera, barrel());
  }
  expect_refused(echoed("K: [554.25, 0, 320.5, 0, 554.25, 240.5, 0, 0, 1]\n"), "state the same");
  expect_refused(echoed("image_width: 640\n"), "state the same");
}

TEST(CameraInfo, ARegionIsItsOwnCamera) {
  std::string error;
  const auto part =
      read_camera_info(echoed("roi: {x_offset: 160, y_offset: 200, width: 320, height: 240}\n"), error);
  ASSERT_TRUE(part) << error;
  EXPECT_EQ(part->width, 320);
  EXPECT_EQ(part->height, 240);
  // A pixel of the part and the same pixel of the whole have one ray.
  const auto in_part = undistort(*part, 100, 150), in_whole = undistort(barrel(), 260, 350);
  EXPECT_NEAR(in_part->x, in_whole->x, 1e-9);
  EXPECT_NEAR(in_part->y, in_whole->y, 1e-9);
  const auto binned = read_camera_info(
      echoed("binning_x: 2\nbinning_y: 4\nroi: {x_offset: 160, y_offset: 200, width: 320, height: 240}\n"),
      error);
  ASSERT_TRUE(binned) << error;
  EXPECT_EQ(binned->width, 160);
  EXPECT_EQ(binned->height, 60);
  // The middle of a super-pixel of 2 x 4.
  const auto in_binned = undistort(*binned, 50, 37), in_pixels = undistort(*part, 100.5, 149.5);
  EXPECT_NEAR(in_binned->x, in_pixels->x, 1e-9);
  EXPECT_NEAR(in_binned->y, in_pixels->y, 1e-9);
  for (const char* wrong :
       {"roi: {x_offset: 400, y_offset: 0, width: 320, height: 240}\n", "roi: {x_offset: 4}\n",
        "roi: {x_offset: 0, y_offset: 0, width: 0, height: 240}\n",
        "roi: {x_offset: -4, width: 320, height: 240}\n", "roi: [1, 2, 3, 4]\n",
        "roi: {x_offset: 0.5, width: 320, height: 240}\n"})
    expect_refused(echoed(wrong), "roi");
  expect_refused(echoed("binning_x: -1\n"), "binning_x");
  expect_refused(echoed("binning_x: 1000\n"), "binning");
}

TEST(CameraInfo, WhatChangesTheMeaningIsAppliedOrRefused) {
  std::string error;
  const std::string sizes = "image_width: 640\nimage_height: 480\n";
  const std::string good = sizes + "camera_matrix: {data: [500, 0, 320, 0, 500, 240, 0, 0, 1]}\n";
  const auto fisheye =
      read_camera_info(good + "fisheye_model: 1\ndistortion_coefficients: {data: [0.1, 0, 0, 0]}\n", error);
  ASSERT_TRUE(fisheye) << error;
  EXPECT_EQ(fisheye->distortion, Distortion::equidistant);
  EXPECT_EQ(read_camera_info(good + "fisheye_model: 0\n", error).value().distortion,
            Distortion::brown_conrady);
  expect_refused(good + "fisheye_model: 1\ndistortion_model: plumb_bob\n", "contradict");
  expect_refused(good + "fisheye_model: maybe\n", "fisheye_model");
  expect_refused(sizes + "k: [500, 2, 320, 0, 500, 240, 0, 0, 1]\n", "skew");
  expect_refused(sizes + "k: [500, 0, 0, 0, 500, 0, 320, 240, 1]\n", "column");
  expect_refused(sizes + "k: [500, 0, 320, 0, 500, 240, 0, 0, 0]\n", "column");
  expect_refused(good + "distortion_model: plumb_bob\nd: [0.1, 0, 0, 0, 0, 0.1, 0, 0]\n", "at most 5");
  expect_refused(good + "distortion_model: equidistant\nd: [0.1, 0, 0, 0, 0.1]\n", "at most 4");
  expect_refused(good + "d: [0.1]\n", "four or more");
  ASSERT_TRUE(read_camera_info(good + "d: []\n", error)) << error;
  ASSERT_TRUE(read_camera_info(
      good + "distortion_model: rational_polynomial\nd: [0.1, 0, 0, 0, 0, 0.1, 0, 0]\n", error));
  const std::string kalibr =
      "cam0: {camera_model: pinhole, intrinsics: [500, 500, 320, 240], resolution: [640, 480], ";
  expect_refused(kalibr + "distortion_model: none, distortion_coeffs: [0.1, 0, 0, 0]}\n", "none");
  ASSERT_TRUE(read_camera_info(kalibr + "distortion_model: none}\n", error)) << error;
  ASSERT_TRUE(read_camera_info(kalibr + "distortion_model: none, distortion_coeffs: []}\n", error)) << error;
  expect_refused("cam0: {camera_model: omni, intrinsics: [500, 500, 320, 240], resolution: [640, 480]}\n",
                 "omni");
  expect_refused(kalibr + "distortion_model: fov, distortion_coeffs: [1, 0, 0, 0]}\n", "fov");
}

TEST(CameraInfo, MountFileComesBack) {
  Mount mount = low_mount(3);
  mount.x = 0.25;
  std::string error;
  const auto back = read_mount(mount_file(mount), error);
  ASSERT_TRUE(back) << error;
  EXPECT_EQ(*back, mount);
  EXPECT_FALSE(read_mount("height: [1]\n", error));
  EXPECT_FALSE(read_mount("pitch: 0.1\n", error));
  EXPECT_NE(error.find("height is missing"), std::string::npos);
}

TEST(Pose, BetweenTwoAndStale) {
  constexpr std::int64_t ms = 1'000'000;
  PoseTrack track;
  EXPECT_FALSE(track.at(0));
  track.add({2000 * ms, 0.3, 0.2, 3.1, 0.6});
  track.add({1950 * ms, 0.1, 0.1, -3.1, 0.5}); // out of order
  const auto middle = track.at(1975 * ms);
  ASSERT_TRUE(middle);
  EXPECT_NEAR(middle->roll, 0.2, 1e-12);
  EXPECT_NEAR(middle->pitch, 0.15, 1e-12);
  EXPECT_NEAR(*middle->height, 0.55, 1e-12);
  EXPECT_NEAR(std::abs(*middle->yaw), std::numbers::pi, 1e-9); // the short way, over the back
  EXPECT_EQ(track.at(2100 * ms)->roll, 0.3);
  EXPECT_FALSE(track.at(2101 * ms));        // stale
  EXPECT_FALSE(track.at(1849 * ms));        // all of them lie in the future
  track.add({2000 * ms, 0.4, 0.2, {}, {}}); // replaced
  EXPECT_EQ(track.at(2050 * ms)->roll, 0.4);
  EXPECT_EQ(with_pose(low_mount(), *track.at(2050 * ms)).height, 0.5); // the mount's own
}

// A frame's time may be anything: a difference beyond 2^63 is none that is near.
TEST(Pose, BetweenTwoSoundOnesIsSound) {
  PoseTrack track;
  track.add({0, 0, 0, std::nullopt, 0.1});
  track.add({50'000'000, 0, 0, std::nullopt, 1e-300});
  for (const std::int64_t time : {0, 1, 25'000'000, 49'999'999, 50'000'000}) {
    const auto pose = track.at(time);
    ASSERT_TRUE(pose);
    EXPECT_EQ(flaw_of(*pose), nullptr) << time;
  }
  EXPECT_EQ(track.at(50'000'000)->height, 1e-300);
}

TEST(Pose, AFrameFarFromEveryPose) {
  constexpr auto lowest = std::numeric_limits<std::int64_t>::min(),
                 highest = std::numeric_limits<std::int64_t>::max();
  PoseTrack track;
  track.add({2941325464, 0, 0.1, {}, {}});
  for (const std::int64_t time : {std::int64_t{-9223372036854775683}, lowest, highest})
    EXPECT_FALSE(track.at(time)) << time;
  track.add({highest, 0, 0.1, {}, {}});
  EXPECT_FALSE(track.at(lowest));
  EXPECT_FALSE(track.at(-1));
  EXPECT_TRUE(track.at(highest - PoseTrack::longest_gap));
}

TEST(Pose, KeepsTheNewest) {
  PoseTrack track;
  for (int i = 0; i < 2000; ++i)
    track.add({i * 1'000'000'000ll, i * 1e-4, 0, {}, {}});
  EXPECT_FALSE(track.at(1400 * 1'000'000'000ll));
  EXPECT_NEAR(track.at(1999 * 1'000'000'000ll)->roll, 0.1999, 1e-12);
  EXPECT_NEAR(track.at((2000 - static_cast<int>(PoseTrack::capacity)) * 1'000'000'000ll)->roll,
              (2000 - static_cast<int>(PoseTrack::capacity)) * 1e-4, 1e-12);
  track.add({5, 0, 0, {}, {}});
  EXPECT_FALSE(track.at(5)) << "older than all that are kept";
}

TEST(Pose, AWrongClockIsForgotten) {
  constexpr std::int64_t second = 1'000'000'000;
  PoseTrack track;
  const auto size = static_cast<int>(PoseTrack::capacity);
  for (int i = 0; i < size - 1; ++i)
    track.add({5000 * second + i, 0, 0, {}, {}});
  track.forget_future(second);
  EXPECT_TRUE(track.at(5000 * second)) << "there is room for those that are right";
  track.add({5000 * second + size, 0, 0, {}, {}});
  track.forget_future(5000 * second - PoseTrack::longest_gap);
  EXPECT_TRUE(track.at(5000 * second));
  track.forget_future(second);
  EXPECT_FALSE(track.at(5000 * second));
}

Mount pitched_mount(double degrees) {
  Mount mount = low_mount();
  mount.pitch = degrees * degree;
  return mount;
}

TEST(HorizonMonitor, OffsetOfARow) {
  // The horizon row of the test vectors: 142.771 at 10 degrees.
  const auto offset = [](double v, double pitch) {
    return horizon_offset(pitched_mount(pitch), *undistort(pinhole(), 320.5, v)) / degree;
  };
  EXPECT_NEAR(offset(142.771, 10), 0, 1e-3);
  EXPECT_NEAR(offset(142.771, 12), -2, 1e-3) << "lower in the picture than the mount has it";
  EXPECT_NEAR(offset(142.771, 7), 3, 1e-3);
}

TEST(HorizonMonitor, MedianOfTenSeconds) {
  constexpr std::int64_t ms = 1'000'000;
  HorizonMonitor monitor;
  for (int i = 0; i < 8900; i += 33)
    monitor.add(i * ms, 2 * degree);
  EXPECT_FALSE(monitor.median()) << "nine seconds are not full";
  EXPECT_FALSE(monitor.disagrees());
  for (int i = 8900; i < 9200; i += 33)
    monitor.add(i * ms, i % 2 ? 0 : 2 * degree);
  EXPECT_NEAR(monitor.median().value_or(0), 2 * degree, 1e-12);
  EXPECT_TRUE(monitor.disagrees());
  for (int i = 9200; i < 20000; i += 33)
    monitor.add(i * ms, -0.9 * degree);
  EXPECT_NEAR(monitor.median().value_or(0), -0.9 * degree, 1e-12) << "what is older is forgotten";
  EXPECT_FALSE(monitor.disagrees());
  monitor.add(5 * ms, -3 * degree);
  EXPECT_FALSE(monitor.median()) << "a jump backwards begins anew";
}

TEST(Metric, RaysToPlacesAreThoseBack) {
  Mount mount;
  mount.height = 0.7;
  mount.pitch = 0.2;
  mount.roll = -0.1;
  mount.yaw = 0.3;
  mount.x = 0.4;
  mount.y = -0.2;
  const GroundProjection ground(mount);
  for (const double x : {1.0, 3.0, 40.0})
    for (const double y : {-0.8, 0.0, 0.5}) {
      const auto ray = ground.ray_to({x, y});
      ASSERT_TRUE(ray);
      const auto back = ground(*ray);
      ASSERT_TRUE(back);
      EXPECT_NEAR(back->x, x, 1e-9 * x);
      EXPECT_NEAR(back->y, y, 1e-9 * x);
    }
  EXPECT_FALSE(ground.ray_to({-3, 0})) << "behind the camera";
}

TEST(Metric, NearestGround) {
  FreeSpaceRanges ranges;
  ranges.adapt(pinhole(), 640, 480, {0, 0, 640, 480}, 640);
  // Row 479.5 ahead: h / tan (p + atan (yn)).
  const double ahead = 0.5 / std::tan(10 * degree + std::atan((479.5 - 240.5) / 554.25));
  EXPECT_NEAR(ranges.nearest(low_mount()), ahead, 2e-4);
  EXPECT_EQ(ranges.nearest(pitched_mount(-40)), std::numeric_limits<double>::infinity()) << "only sky";
}

TEST(Metric, GroundThatIsNotSeenIsNotFree) {
  FreeSpaceRanges ranges;
  ranges.adapt(pinhole(), 640, 480, {0, 0, 640, 480}, 3);
  // Nothing is free in the second column, and the nearest row lies 0.8 m ahead, beyond the limit.
  const std::vector<std::uint16_t> boundary{300, 480, 300};
  const RangeColumns& measured = ranges.measure(boundary, false, low_mount(), 0.5);
  EXPECT_TRUE(std::isinf(measured.ranges[0]));
  EXPECT_TRUE(std::isnan(measured.ranges[1]));
  EXPECT_TRUE(std::isnan(measured.low[1]) && std::isnan(measured.high[1]));
  EXPECT_TRUE(std::isinf(measured.ranges[2]));
}

TEST(Pose, NonsenseIsNamed) {
  EXPECT_EQ(flaw_of(Pose{0, 0.1, 0.1, {}, {}}), nullptr);
  for (const Pose& wrong : {Pose{0, NAN, 0, {}, {}}, Pose{0, 0, INFINITY, {}, {}}, Pose{-1, 0, 0, {}, {}},
                            Pose{0, 0, 1.5, {}, {}}, Pose{0, 4, 0, {}, {}}, Pose{0, 0, 0, NAN, {}},
                            Pose{0, 0, 0, {}, 0.0}, Pose{0, 0, 0, {}, -1.0}})
    EXPECT_NE(flaw_of(wrong), nullptr);
}

} // namespace
} // namespace terrainseg::metric
