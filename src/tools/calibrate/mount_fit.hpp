// SPDX-License-Identifier: LGPL-2.1-or-later
// Height, pitch and roll of a camera from points of the ground at measured distances.
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "metric/mount.hpp"
#include "tools/calibrate/points.hpp"

namespace terrainseg::calibrate {

/// What is known of the mount without the points.
struct Known {
  std::optional<double> height, roll;
  double yaw = 0, x = 0, y = 0; ///< written to the mount as they are
};

/// How well one point is met.
struct Residual {
  double rows = 0;                ///< pixels by which the point lies below where it should
  std::optional<double> measured; ///< metres that the mount gives its pixel; nothing over the horizon
};

struct MountFit {
  metric::Mount mount; ///< pitch_error: that of the fit, at least the mount's usual half a degree
  std::vector<Residual> residuals;
  double root_mean_square = 0; ///< of the residuals, rows
  /// One standard deviation each, when a pixel is read to one row; 0 = was given, not found.
  double height_error = 0, pitch_error = 0, roll_error = 0;
  bool roll_found = false;
  /// Another height that meets the points as well: distances d1 and d2 alone do not tell h from d1 d2 / h.
  std::optional<double> other_height;
};

/// Least squares over the angles by which the points lie below the horizontal: an error of a pixel weighs the
/// same near and far. Two points give height and pitch, four on both sides of the picture roll as well
/// (two where the height is known).
/// Throws std::runtime_error that says what to do when the points do not tell, or do not fit any mount.
MountFit fit_mount(const metric::Camera& camera, std::span<const MeasuredPoint> points, const Known& known);

} // namespace terrainseg::calibrate
