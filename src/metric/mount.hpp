// SPDX-License-Identifier: LGPL-2.1-or-later
// How a camera stands over the ground, and where rays meet it.
//
// Frames are those of REP 103: the body's x forward, y left, z up, in metres; angles in radians. Positive
// pitch = the camera looks down, positive roll = its right side is down, positive yaw = it looks to the left.
// The ground is the plane z = 0 below the body's origin.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "metric/camera.hpp"

namespace terrainseg::metric {

struct Mount {
  double height = 0;                   ///< of the camera over the ground, metres, above 0
  double pitch = 0, roll = 0, yaw = 0; ///< radians
  double x = 0, y = 0;                 ///< of the camera in the body's frame, metres
  /// One standard deviation of what pitch is not known by (vibration, suspension, the calibration), radians.
  double pitch_error = 0.5 * 3.14159265358979323846 / 180;
  bool operator==(const Mount&) const = default;
};

/// What is wrong with a mount and what to do, or an empty text.
std::string flaw_of(const Mount& mount);

/// Reads `height=0.5,pitch=10deg,x=0.2`: comma-separated keys height, pitch, roll, yaw, x, y, pitch-error (or
/// pitch_error); metres, and radians or, with the suffix `deg`, degrees. On an error nothing, and `error`
/// says what and where.
std::optional<Mount> parse_mount(std::string_view text, std::string& error);

/// A ray this little below the horizontal meets the ground a million camera heights away: over the horizon.
inline constexpr double least_descent = 1e-6;

/// A point of the ground in the body's frame, metres.
struct GroundPoint {
  double x = 0, y = 0;
};

/// Rotates rays of the camera into the body's frame: b = Rz(yaw) Ry(pitch) Rx(roll) (1, -x, -y).
class GroundProjection {
 public:
  explicit GroundProjection(const Mount& mount);
  /// Where a ray meets the ground; nothing at and above the horizon.
  std::optional<GroundPoint> operator()(const ImagePoint& ray) const;
  /// The ray that shows a point of the ground; nothing when it lies behind the camera.
  std::optional<ImagePoint> ray_to(const GroundPoint& point) const;
  /// The body's forward, left and upward parts of a ray: 0, 1, 2.
  double along(int axis, const ImagePoint& ray) const {
    const auto& row = rotation_[axis];
    return row[0] - row[1] * ray.x - row[2] * ray.y;
  }
  /// What along() weighs 1, -x and -y of a ray by.
  const std::array<double, 3>& row(int axis) const { return rotation_[axis]; }
  double height() const { return height_; }
  double x() const { return x_; }
  double y() const { return y_; }

 private:
  std::array<std::array<double, 3>, 3> rotation_;
  double height_, x_, y_;
};

/// Row of the picture in which level rays are seen at the principal point's column: the vanishing line of
/// level ground, may lie outside the picture. Nothing where the lens shows no such ray.
std::optional<double> vanishing_row(const Mount& mount, const Camera& camera);
/// The same in Q8, as Frame::vanishing_row has it, at most four heights of the picture from its top: what is
/// farther is as good as straight up or down.
std::optional<std::int32_t> vanishing_row_q8(const Mount& mount, const Camera& camera);

} // namespace terrainseg::metric
