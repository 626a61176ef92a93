// SPDX-License-Identifier: LGPL-2.1-or-later
// The rooms of terrainseg-calibrate against a camera written apart from them.
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <sstream>

#include "metric/camera_info.hpp"
#include "tools/calibrate/files.hpp"
#include "tools/calibrate/horizon_check.hpp"
#include "tools/calibrate/mount_fit.hpp"
#include "tools/calibrate/pictures.hpp"

namespace terrainseg::calibrate {
namespace {

constexpr double degree = std::numbers::pi / 180;

metric::Camera camera_of_vectors(bool bent = false) {
  metric::Camera camera;
  camera.width = 640;
  camera.height = 480;
  camera.fx = camera.fy = 554.25;
  camera.cx = 320.5;
  camera.cy = 240.5;
  if (bent)
    camera.coefficients = {-0.28, 0.07, 0.0002, 0.00002};
  return camera;
}

struct Pixel {
  double u, v;
};

/// Oracle: a point of the ground, ahead and left of the lens's foot, through a camera that is turned by
/// pitch and then rolled; by the axes of the turned camera, not by a matrix.
Pixel seen(const metric::Camera& c, double height, double pitch, double roll, double ahead, double left) {
  // Axes of the optical frame in the body's frame: z along the view, x right, y down, before the roll.
  const double view[3] = {std::cos(pitch), 0, -std::sin(pitch)};
  const double right0[3] = {0, -1, 0}, down0[3] = {-std::sin(pitch), 0, -std::cos(pitch)};
  double right[3], down[3];
  for (int i = 0; i < 3; ++i) { // right side down: right leans towards down
    right[i] = std::cos(roll) * right0[i] + std::sin(roll) * down0[i];
    down[i] = std::cos(roll) * down0[i] - std::sin(roll) * right0[i];
  }
  const double to[3] = {ahead, left, -height};
  const auto along = [&](const double(&axis)[3]) {
    return to[0] * axis[0] + to[1] * axis[1] + to[2] * axis[2];
  };
  const double x = along(right) / along(view), y = along(down) / along(view), r2 = x * x + y * y;
  const auto& k = c.coefficients;
  const double radial = 1 + k[0] * r2 + k[1] * r2 * r2 + k[4] * r2 * r2 * r2;
  return {c.fx * (x * radial + 2 * k[2] * x * y + k[3] * (r2 + 2 * x * x)) + c.cx,
          c.fy * (y * radial + k[2] * (r2 + 2 * y * y) + 2 * k[3] * x * y) + c.cy};
}

MeasuredPoint measured(const metric::Camera& c, double height, double pitch, double roll, double ahead,
                       double left) {
  const Pixel p = seen(c, height, pitch, roll, ahead, left);
  return {p.u, p.v, std::hypot(ahead, left)};
}

TEST(MountFit, TwoPointsGiveHeightAndPitch) {
  for (const bool bent : {false, true})
    for (const double height : {0.2, 0.5, 1.4})
      for (const double pitch : {-2.0, 0.0, 10.0, 25.0}) {
        const auto camera = camera_of_vectors(bent);
        const std::vector<MeasuredPoint> points{
            measured(camera, height, pitch * degree, 0, 3 * height, 0.1),
            measured(camera, height, pitch * degree, 0, 9 * height, -0.3)};
        if (points[0].v > 479 || points[1].v < 0)
          continue;
        const MountFit fit = fit_mount(camera, points, {});
        EXPECT_NEAR(fit.mount.height, height, 1e-5) << pitch;
        EXPECT_NEAR(fit.mount.pitch, pitch * degree, 1e-6) << height;
        EXPECT_EQ(fit.mount.roll, 0);
        EXPECT_FALSE(fit.roll_found);
        EXPECT_NEAR(fit.residuals[1].measured.value_or(0), points[1].distance, 1e-3);
        EXPECT_GT(fit.height_error, 0);
      }
}

TEST(MountFit, MeetsTheVectorsOfTheDesign) {
  // Ranges that another program computed for height 0.5 m, pitch 10 degrees, roll 5 degrees and 0.
  const std::vector<MeasuredPoint> rolled{{100, 350, 1.5634}, {540, 350, 1.2669}};
  const MountFit fit = fit_mount(camera_of_vectors(), rolled, {.height = 0.5, .roll = {}});
  EXPECT_TRUE(fit.roll_found);
  EXPECT_NEAR(fit.mount.roll, 5 * degree, 1e-3);
  EXPECT_NEAR(fit.mount.pitch, 10 * degree, 1e-3);
  const std::vector<MeasuredPoint> level{{320.5, 240.5, 2.8356}, {0, 400, 1.2025}, {639, 300, 2.0119}};
  EXPECT_NEAR(fit_mount(camera_of_vectors(), level, {}).mount.height, 0.5, 1e-3);
  const std::vector<MeasuredPoint> bent{{320.5, 240.5, 2.8356}, {0, 400, 1.1408}, {639, 300, 1.9850}};
  EXPECT_NEAR(fit_mount(camera_of_vectors(true), bent, {}).mount.height, 0.5, 1e-3);
}

TEST(MountFit, PointsOnBothSidesGiveRoll) {
  for (const double roll : {-6.0, 1.0, 4.0}) {
    const auto camera = camera_of_vectors(true);
    std::vector<MeasuredPoint> points;
    for (const auto& [ahead, left] : {std::pair{1.2, 0.5}, {1.2, -0.5}, {3.0, 1.0}, {4.0, -1.5}})
      points.push_back(measured(camera, 0.5, 12 * degree, roll * degree, ahead, left));
    const MountFit fit = fit_mount(camera, points, {});
    EXPECT_TRUE(fit.roll_found);
    EXPECT_NEAR(fit.mount.roll, roll * degree, 1e-6);
    EXPECT_NEAR(fit.mount.height, 0.5, 1e-5);
    const MountFit given = fit_mount(camera, points, {.height = {}, .roll = roll * degree});
    EXPECT_FALSE(given.roll_found);
    EXPECT_NEAR(given.mount.roll, roll * degree, 1e-12);
    EXPECT_NEAR(given.mount.pitch, 12 * degree, 1e-6);
  }
}

TEST(MountFit, ARowOfErrorCostsWhatItSays) {
  const auto camera = camera_of_vectors();
  std::vector<MeasuredPoint> points;
  for (const double ahead : {1.0, 1.5, 2.0, 3.0, 5.0})
    for (const double left : {-0.4, 0.4})
      points.push_back(measured(camera, 0.5, 10 * degree, 0, ahead, left));
  for (std::size_t i = 0; i < points.size(); ++i)
    points[i].v += i % 3 == 0 ? 1 : i % 3 == 1 ? -1 : 0.5;
  const MountFit fit = fit_mount(camera, points, {});
  EXPECT_LT(std::abs(fit.mount.height - 0.5), 3 * fit.height_error);
  EXPECT_LT(std::abs(fit.mount.pitch - 10 * degree), 3 * fit.pitch_error);
  EXPECT_LT(fit.height_error, 0.02);
  EXPECT_GT(fit.root_mean_square, 0.3);
  EXPECT_LT(fit.root_mean_square, 1.1);
}

TEST(MountFit, TheOtherHeightIsTheOneThatIsPrinted) {
  // d1 d2 / h = 12 m. Near 30 m is a third mount, whose near point lies behind the camera's foot.
  const auto camera = camera_of_vectors();
  const std::vector<MeasuredPoint> points{measured(camera, 0.5, 2 * degree, 0, 1.5, 0),
                                          measured(camera, 0.5, 2 * degree, 0, 4.0, 0)};
  const MountFit fit = fit_mount(camera, points, {});
  EXPECT_NEAR(fit.mount.height, 0.5, 1e-4);
  ASSERT_TRUE(fit.other_height);
  EXPECT_NEAR(*fit.other_height, 12, 0.02);
}

TEST(MountFit, TwoDistancesLeaveTwoHeightsAndAThirdOrTheHeightTells) {
  const auto camera = camera_of_vectors();
  std::vector<MeasuredPoint> points{measured(camera, 2.0, 40 * degree, 0, 1.5, 0),
                                    measured(camera, 2.0, 40 * degree, 0, 4.0, 0)};
  // d1 d2 / h = 3: the lower height of the two is the true one.
  MountFit fit = fit_mount(camera, points, {});
  EXPECT_NEAR(fit.mount.height, 2, 1e-4);
  ASSERT_TRUE(fit.other_height);
  EXPECT_NEAR(*fit.other_height, 3, 1e-3);
  fit = fit_mount(camera, points, {.height = 3.0, .roll = {}});
  EXPECT_NEAR(fit.mount.height, 3, 1e-12);
  EXPECT_LT(fit.root_mean_square, 0.01);
  points.push_back(measured(camera, 2.0, 40 * degree, 0, 2.5, 0.5));
  EXPECT_FALSE(fit_mount(camera, points, {}).other_height);
}

std::string error_of(const std::vector<MeasuredPoint>& points, const Known& known = {}) {
  try {
    fit_mount(camera_of_vectors(), points, known);
  } catch (const std::runtime_error& error) {
    return error.what();
  }
  return "none";
}

TEST(MountFit, SaysWhatIsWrong) {
  EXPECT_NE(error_of({{320, 400, 1}}).find("two points are needed"), std::string::npos);
  EXPECT_NE(error_of({{320, 400, 1}, {100, 400, 1.05}}).find("do not determine height and pitch"),
            std::string::npos);
  EXPECT_NE(error_of({{320, 400, 1}, {320, 480, 3}}).find("outside the picture of 640x480"),
            std::string::npos);
  EXPECT_NE(error_of({{320, 400, 1}}, {.height = -1.0, .roll = {}}).find("height must be above 0"),
            std::string::npos);
  // Metres of the second and the third point swapped.
  const auto camera = camera_of_vectors();
  std::vector<MeasuredPoint> points;
  for (const double ahead : {1.0, 2.0, 6.0})
    points.push_back(measured(camera, 0.5, 10 * degree, 0, ahead, 0));
  std::swap(points[1].distance, points[2].distance);
  const std::string wrong = error_of(points);
  EXPECT_NE(wrong.find("the points fit no mount"), std::string::npos) << wrong;
}

TEST(Points, AreReadWholeOrRefusedByName) {
  const auto points = parse_points("# by tape\n\n 320, 400.5 ,1.25 # left foot\r\n-0.5,0,2e1\n");
  ASSERT_EQ(points.size(), 2u);
  EXPECT_EQ(points[0].v, 400.5);
  EXPECT_EQ(points[1].distance, 20);
  for (const char* text :
       {"", "1,2", "1,2,", "1,2,3,4", "1,2,3m", "1,2,nan", "1,2,inf", "1,2,0", "1,2,-3", "1;2;3"})
    EXPECT_THROW(parse_point(text), std::runtime_error) << text;
  try {
    parse_points("1,2,3\nx\n");
    FAIL();
  } catch (const std::runtime_error& error) {
    EXPECT_EQ(std::string(error.what()).rfind("line 2: point 'x'", 0), 0u) << error.what();
  }
}

TEST(Grid, LinesLieWhereTheOracleSeesThem) {
  metric::Mount mount;
  mount.height = 0.7;
  mount.pitch = 15 * degree;
  mount.roll = -3 * degree;
  for (const bool bent : {false, true})
    for (const double ahead : {1.0, 2.0, 10.0})
      for (const double left : {-0.5, 0.0, 0.5}) {
        const auto camera = camera_of_vectors(bent);
        const Pixel expected = seen(camera, 0.7, mount.pitch, mount.roll, ahead, left);
        const auto pixel = pixel_of(camera, mount, {ahead, left});
        ASSERT_TRUE(pixel);
        EXPECT_NEAR(pixel->x, expected.u, 1e-6);
        EXPECT_NEAR(pixel->y, expected.v, 1e-6);
        // The mount's place in the body moves the grid by as much.
        metric::Mount ahead_of_origin = mount;
        ahead_of_origin.x = 0.25;
        const auto moved = pixel_of(camera, ahead_of_origin, {ahead + 0.25, left});
        ASSERT_TRUE(moved);
        EXPECT_NEAR(moved->y, pixel->y, 1e-9);
      }
  EXPECT_FALSE(pixel_of(camera_of_vectors(), mount, {-5, 0}));
}

std::string line(int frame, const std::string& row, int confidence) {
  return R"({"frame":)" + std::to_string(frame) + R"(,"width":640,"height":480,"horizon":{"row":)" + row +
         R"(,"confidence":)" + std::to_string(confidence) + "}}\n";
}

TEST(HorizonCheck, ComparesTheMedianOfConfidentFrames) {
  metric::Mount mount;
  mount.height = 0.5;
  mount.pitch = 10 * degree;
  EXPECT_NEAR(horizon_row(camera_of_vectors(), mount), 142.771, 5e-4); // as in the design's vectors
  std::string text;
  for (int i = 0; i < 41; ++i)
    text += line(i, std::to_string(152 + i % 3 - 1), 200) + line(i, "400", 100) + line(i, "null", 255);
  std::istringstream lines(text);
  const Horizons horizons = read_horizons(lines);
  EXPECT_EQ(horizons.frames, 123u);
  EXPECT_EQ(horizons.rows.size(), 41u);
  const HorizonCheck check = check_horizon(horizons, camera_of_vectors(), mount);
  EXPECT_EQ(check.row, 152);
  // Depression of row 152: pitch + atan((152 - cy) / f).
  EXPECT_NEAR(check.degrees, 10 + std::atan((152 - 240.5) / 554.25) / degree, 0.01);
  // The same camera at half the size: row r of the whole is (r + 0.5) / 2 - 0.5.
  Horizons half{320, 240, 40, std::vector<int>(40, 76)};
  EXPECT_NEAR(check_horizon(half, camera_of_vectors(), mount).expected, (142.771 + 0.5) / 2 - 0.5, 1e-3);
  half.width = 240;
  EXPECT_THROW(check_horizon(half, camera_of_vectors(), mount), std::runtime_error);
  half = {640, 480, 40, std::vector<int>(29, 76)};
  EXPECT_THROW(check_horizon(half, camera_of_vectors(), mount), std::runtime_error);
}

TEST(HorizonCheck, RefusesOtherLines) {
  for (const std::string& text :
       {std::string("{}\n"), std::string("x\n"),
        line(0, "1", 200) + R"({"width":320,"height":240,"horizon":{"row":null}})",
        std::string(R"({"width":1e300,"height":240,"horizon":{"row":null}})"),
        std::string(R"({"width":18446744073709551615,"height":240,"horizon":{"row":null}})"),
        line(0, "2147483647", 200), line(0, "-1e12", 200), line(0, "1.5", 200)}) {
    std::istringstream lines(text);
    EXPECT_THROW(read_horizons(lines), std::runtime_error) << text;
  }
}

TEST(CameraInfo, IsReadBackAsItWasWritten) {
  metric::Camera camera = camera_of_vectors(true);
  camera.fx = 554.1 / 3; // no short decimal
  for (const auto& k : {std::array<double, 8>{0.1, -0.2, 1e-5, 2e-17, 0.3, 0, 0, 0},
                        std::array<double, 8>{0.1, -0.2, 1e-5, 2e-5, 0.3, 0.4, 0.5, 0.6}}) {
    camera.coefficients = k;
    std::string error;
    EXPECT_EQ(metric::read_camera_info(metric::camera_info_file(camera, "front"), error), camera) << error;
  }
  camera.distortion = metric::Distortion::equidistant;
  camera.coefficients = {0.1, -0.02, 0.003, 0.0004};
  std::string error;
  EXPECT_EQ(metric::read_camera_info(metric::camera_info_file(camera, "front"), error), camera) << error;
}

} // namespace
} // namespace terrainseg::calibrate
