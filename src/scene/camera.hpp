// SPDX-License-Identifier: LGPL-2.1-or-later
// Pose of the rover over time, and the pinhole projection of its camera.
#pragma once

#include <algorithm>
#include <vector>

#include "scene/arithmetic.hpp"
#include "scene/scene.hpp"

namespace terrainseg::scene {

/// The world repeats after this many metres forward, without a seam in textures and objects.
inline constexpr float world_length = 2048;

/// The line that the rover follows: x = at(z), metres.
class Path {
 public:
  Path(const Settings& settings);
  float at(float z) const {
    const float position = (z + margin) * samples_per_metre;
    const int i = std::clamp(floor_of(position), 0, static_cast<int>(table_.size()) - 2);
    return mix(table_[i], table_[i + 1], clamp01(position - static_cast<float>(i)));
  }

 private:
  static constexpr float margin = 64, samples_per_metre = 1;
  std::vector<float> table_;
};

struct Camera {
  Vec3 position;
  Vec3 right, down, forward; ///< unit vectors of the picture's axes
  float focal = 1;           ///< pixels
  Vec3 step_x, step_y;       ///< difference between the rays of neighbouring pixels
  float center_x = 0, center_y = 0;

  Vec3 ray(float x, float y) const { ///< ray through a pixel; its forward component is 1
    return forward + step_x * (x - center_x) + step_y * (y - center_y);
  }
  /// The point of the ground under a ray that points down.
  Vec3 on_ground(const Vec3& ray) const { return position + ray * (position.y / -ray.y); }
  float depth(const Vec3& point) const { return dot(point - position, forward); }
  /// The camera of the reflection in the ground: below the ground, looking up.
  Camera mirrored() const;
  /// Row of horizontal rays at the middle of the width, rounded; -1 outside the picture.
  int horizon_row(int height) const;
};

/// Seconds since the start of the world, and the pose at that time.
struct Moment {
  double seconds = 0;
  Camera camera;
};

Moment moment_of(const Settings& settings, const Path& path, std::uint64_t number, int width, int height);

} // namespace terrainseg::scene
