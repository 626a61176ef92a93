// SPDX-License-Identifier: LGPL-2.1-or-later
// Rotations as quaternions x, y, z, w.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>

namespace terrainseg::recording {

using Quaternion = std::array<double, 4>;

inline Quaternion product(const Quaternion& a, const Quaternion& b) {
  return {a[3] * b[0] + a[0] * b[3] + a[1] * b[2] - a[2] * b[1],
          a[3] * b[1] - a[0] * b[2] + a[1] * b[3] + a[2] * b[0],
          a[3] * b[2] + a[0] * b[1] - a[1] * b[0] + a[2] * b[3],
          a[3] * b[3] - a[0] * b[0] - a[1] * b[1] - a[2] * b[2]};
}

/// Rotation by `angle` radians about axis 0 = x, 1 = y, 2 = z.
inline Quaternion about(int axis, double angle) {
  Quaternion q{0, 0, 0, std::cos(angle / 2)};
  q[static_cast<std::size_t>(axis)] = std::sin(angle / 2);
  return q;
}

/// Rz(yaw) Ry(pitch) Rx(roll), radians.
inline Quaternion rotation_of(double yaw, double pitch, double roll) {
  return product(product(about(2, yaw), about(1, pitch)), about(0, roll));
}

} // namespace terrainseg::recording
