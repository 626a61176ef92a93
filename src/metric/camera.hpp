// SPDX-License-Identifier: LGPL-2.1-or-later
// A calibrated camera: from a pixel of the raw picture to the direction of its ray.
//
// Pixel centres have integer coordinates (as in OpenCV and ROS). Normalised image coordinates (x right, y
// down) are those of the plane at distance 1 before the camera.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <utility>

namespace terrainseg::metric {

/// How the lens departs from a pinhole.
enum class Distortion : std::uint8_t {
  /// Brown-Conrady, ROS `plumb_bob` and `rational_polynomial`, Kalibr `radtan`: k1 k2 p1 p2 [k3 [k4 k5 k6]].
  brown_conrady,
  /// Kannala-Brandt, ROS and Kalibr `equidistant`, OpenCV's fisheye module: k1 k2 k3 k4 over the angle.
  equidistant,
};

/// Direction of a ray: (x, y, 1) in the camera's optical frame.
struct ImagePoint {
  double x = 0, y = 0;
};

struct Camera {
  int width = 0, height = 0; ///< of the pictures it was calibrated on, pixels
  double fx = 0, fy = 0;     ///< focal lengths, pixels
  double cx = 0, cy = 0;     ///< principal point, pixels
  Distortion distortion = Distortion::brown_conrady;
  std::array<double, 8> coefficients{};  ///< those that the model has, the rest 0
  int whole_width = 0, whole_height = 0; ///< of the picture that these are a part of; 0 = they are no part

  bool undistorted() const { return coefficients == std::array<double, 8>{}; }
  bool operator==(const Camera&) const = default;
};

/// The name of a lens model in ROS and the number of its coefficients.
std::pair<const char*, std::size_t> lens_of(const Camera& camera);

/// What is wrong with a calibration and what to do, or an empty text: every number finite, focal lengths and
/// sizes above 0, the principal point within a picture's size of the picture.
std::string flaw_of(const Camera& camera);

/// The same camera for pictures of another size: u' = (u + 0.5) s - 0.5. The sides may be scaled by factors
/// that differ (anamorphic formats); a cut is no scaling and needs a calibration of its own.
Camera scaled(const Camera& camera, int width, int height);

/// Where the ray through pixel (u, v) meets the plane at distance 1. Nothing when the lens model has no such
/// ray: beyond 90 degrees of a fish-eye, or outside the range in which the polynomial can be inverted.
std::optional<ImagePoint> undistort(const Camera& camera, double u, double v);

/// The pixel that shows a ray: the inverse of undistort().
ImagePoint distort(const Camera& camera, const ImagePoint& ray);

} // namespace terrainseg::metric
