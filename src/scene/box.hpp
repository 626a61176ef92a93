// SPDX-License-Identifier: LGPL-2.1-or-later
// Upright boxes and the outlines of their shadows.
#pragma once

#include <algorithm>
#include <array>
#include <span>

#include "scene/world.hpp"

namespace terrainseg::scene {

// An upright box, rotated about its vertical axis.
struct Box {
  Vec3 base;
  float half_x, half_z, low, high;
  float cos_yaw, sin_yaw;

  Vec3 side() const { return {cos_yaw, 0, -sin_yaw}; }
  Vec3 ahead() const { return {sin_yaw, 0, cos_yaw}; }
  Vec3 corner(float x, float y, float z) const { return base + side() * x + ahead() * z + Vec3{0, y, 0}; }
};

inline Box box_of(const Thing& thing, float low, float high) {
  return {thing.base, thing.half_x, thing.half_z, low, high, thing.cos_yaw, thing.sin_yaw};
}

/// Returns the point where light that passes `point` meets the ground. `along` is the horizontal distance
/// that light travels per metre of height.
inline Vec3 cast_of(const Vec3& point, const Vec3& along) {
  return Vec3{point.x, 0, point.z} + along * point.y;
}

/// Computes the convex hull of ground points; reorders the points. Returns the number of corners.
inline int hull_of(std::span<Vec3> points, std::array<Vec3, 16>& corners) {
  const int last = static_cast<int>(points.size()) - 1;
  std::sort(points.begin(), points.end(),
            [](const Vec3& a, const Vec3& b) { return a.x < b.x || (a.x == b.x && a.z < b.z); });
  const auto turn = [](const Vec3& o, const Vec3& a, const Vec3& b) {
    return (a.x - o.x) * (b.z - o.z) - (a.z - o.z) * (b.x - o.x);
  };
  int count = 0;
  for (int pass = 0; pass < 2; ++pass) {
    const int start = count;
    for (int i = 0; i <= last; ++i) {
      const Vec3& point = points[pass ? last - i : i];
      while (count >= start + 2 && turn(corners[count - 2], corners[count - 1], point) <= 0)
        --count;
      corners[count++] = point;
    }
    --count; // the next pass begins with the last point
  }
  return count;
}

/// The outline of a box's shadow on the ground.
inline int cast_hull(const Box& box, const Vec3& along, std::array<Vec3, 16>& corners) {
  std::array<Vec3, 8> points;
  for (int i = 0; i < 8; ++i)
    points[i] = cast_of(box.corner(i & 1 ? box.half_x : -box.half_x, i & 4 ? box.high : box.low,
                                   i & 2 ? box.half_z : -box.half_z),
                        along);
  return hull_of(points, corners);
}

} // namespace terrainseg::scene
