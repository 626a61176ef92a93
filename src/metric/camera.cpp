// SPDX-License-Identifier: LGPL-2.1-or-later
#include "metric/camera.hpp"

#include <cmath>
#include <numbers>

namespace terrainseg::metric {
namespace {

constexpr int most_rounds = 200;
constexpr double close_enough = 1e-9;

/// Radial factor and tangential shift at an undistorted point (Brown-Conrady).
struct BrownConrady {
  double radial, dx, dy;
};

BrownConrady brown_conrady(const Camera& camera, const ImagePoint& p) {
  const auto& k = camera.coefficients;
  const double r2 = p.x * p.x + p.y * p.y;
  const double radial =
      (1 + r2 * (k[0] + r2 * (k[1] + r2 * k[4]))) / (1 + r2 * (k[5] + r2 * (k[6] + r2 * k[7])));
  return {radial, 2 * k[2] * p.x * p.y + k[3] * (r2 + 2 * p.x * p.x),
          k[2] * (r2 + 2 * p.y * p.y) + 2 * k[3] * p.x * p.y};
}

double fisheye_angle(const Camera& camera, double theta) {
  const auto& k = camera.coefficients;
  const double t2 = theta * theta;
  return theta * (1 + t2 * (k[0] + t2 * (k[1] + t2 * (k[2] + t2 * k[3]))));
}

std::optional<ImagePoint> undistort_brown_conrady(const Camera& camera, const ImagePoint& seen) {
  ImagePoint p = seen;
  for (int round = 0; round < most_rounds; ++round) {
    const BrownConrady at = brown_conrady(camera, p);
    if (!(at.radial > 0))
      return std::nullopt;
    const ImagePoint next{(seen.x - at.dx) / at.radial, (seen.y - at.dy) / at.radial};
    const double moved = std::hypot(next.x - p.x, next.y - p.y);
    p = next;
    if (moved < close_enough)
      return p;
  }
  return std::nullopt;
}

std::optional<ImagePoint> undistort_equidistant(const Camera& camera, const ImagePoint& seen) {
  const double target = std::hypot(seen.x, seen.y);
  if (target < close_enough)
    return seen;
  // Bisection: the polynomial rises up to the picture's edge, or it is no model of a lens there.
  double low = 0, high = std::numbers::pi / 2;
  if (fisheye_angle(camera, high) <= target)
    return std::nullopt;
  for (int round = 0; round < most_rounds && high - low > 1e-12; ++round) {
    const double middle = (low + high) / 2;
    (fisheye_angle(camera, middle) < target ? low : high) = middle;
  }
  const double theta = (low + high) / 2, factor = std::tan(theta) / target;
  return ImagePoint{seen.x * factor, seen.y * factor};
}

} // namespace

std::pair<const char*, std::size_t> lens_of(const Camera& camera) {
  if (camera.distortion == Distortion::equidistant)
    return {"equidistant", 4};
  const auto& k = camera.coefficients;
  return k[5] != 0 || k[6] != 0 || k[7] != 0 ? std::pair{"rational_polynomial", std::size_t{8}}
                                             : std::pair{"plumb_bob", std::size_t{5}};
}

std::string flaw_of(const Camera& camera) {
  for (double number : {camera.fx, camera.fy, camera.cx, camera.cy})
    if (!std::isfinite(number))
      return "a number of the camera matrix is not finite: calibrate again";
  for (double number : camera.coefficients)
    if (!std::isfinite(number))
      return "a distortion coefficient is not finite: calibrate again";
  if (camera.width < 1 || camera.height < 1 || camera.width > 32767 || camera.height > 32767)
    return "the picture size " + std::to_string(camera.width) + "x" + std::to_string(camera.height) +
           " is not within 1..32767: state the size of the pictures that were calibrated on";
  if (camera.fx <= 0 || camera.fy <= 0)
    return "a focal length is not above 0: calibrate again";
  if (std::abs(camera.cx - camera.width / 2.0) > camera.width ||
      std::abs(camera.cy - camera.height / 2.0) > camera.height)
    return "the principal point lies far outside the picture: is the calibration that of another picture "
           "size?";
  return {};
}

Camera scaled(const Camera& camera, int width, int height) {
  Camera result = camera;
  const double sx = static_cast<double>(width) / camera.width,
               sy = static_cast<double>(height) / camera.height;
  result.width = width;
  result.height = height;
  result.fx = camera.fx * sx;
  result.fy = camera.fy * sy;
  result.cx = (camera.cx + 0.5) * sx - 0.5;
  result.cy = (camera.cy + 0.5) * sy - 0.5;
  return result;
}

std::optional<ImagePoint> undistort(const Camera& camera, double u, double v) {
  const ImagePoint seen{(u - camera.cx) / camera.fx, (v - camera.cy) / camera.fy};
  if (camera.distortion == Distortion::equidistant)
    return undistort_equidistant(camera, seen);
  return camera.undistorted() ? seen : undistort_brown_conrady(camera, seen);
}

ImagePoint distort(const Camera& camera, const ImagePoint& ray) {
  ImagePoint seen = ray;
  if (camera.distortion == Distortion::equidistant) {
    const double r = std::hypot(ray.x, ray.y);
    const double factor = r < close_enough ? 1 : fisheye_angle(camera, std::atan(r)) / r;
    seen = {ray.x * factor, ray.y * factor};
  } else {
    const BrownConrady at = brown_conrady(camera, ray);
    seen = {ray.x * at.radial + at.dx, ray.y * at.radial + at.dy};
  }
  return {seen.x * camera.fx + camera.cx, seen.y * camera.fy + camera.cy};
}

} // namespace terrainseg::metric
