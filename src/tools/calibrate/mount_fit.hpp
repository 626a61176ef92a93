// SPDX-License-Identifier: LGPL-2.1-or-later
// Fits height, pitch and roll of a camera to ground points at measured distances.
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "metric/mount.hpp"
#include "tools/calibrate/files.hpp"

namespace terrainseg::calibrate {

/// The known part of the mount.
struct Known {
  std::optional<double> height, roll;
  double yaw = 0, x = 0, y = 0; ///< copied to the mount
};

/// Residual of one point.
struct Residual {
  double rows = 0; ///< pixels by which the point is below its row according to the mount
  std::optional<double>
      measured; ///< distance of its pixel according to the mount, metres; nothing above the horizon
};

struct MountFit {
  metric::Mount mount; ///< pitch_error: that of the fit, at least the mount's default of half a degree
  std::vector<Residual> residuals;
  double root_mean_square = 0; ///< of the residuals, rows
  /// One standard deviation each, for an error of one row per point; 0 = given, not fitted.
  double height_error = 0, pitch_error = 0, roll_error = 0;
  bool roll_found = false;
  /// A second height that fits as well: two distances d1 and d2 cannot tell h from d1 d2 / h.
  std::optional<double> other_height;
};

/// Angle of a ray below the horizontal, radians.
double descent(const metric::Mount& mount, const metric::ImagePoint& ray);

/// Least squares of the angles of the points below the horizontal, so that a pixel has the same weight near
/// and far. Two points give height and pitch; four points on both sides of the picture also give the roll
/// (two if the height is known). Throws std::runtime_error with the remedy if the points are not sufficient
/// or fit no mount.
MountFit fit_mount(const metric::Camera& camera, std::span<const MeasuredPoint> points, const Known& known);

} // namespace terrainseg::calibrate
