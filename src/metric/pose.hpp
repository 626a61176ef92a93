// SPDX-License-Identifier: LGPL-2.1-or-later
// The vehicle's attitude over time, at the time of a frame.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "metric/mount.hpp"

namespace terrainseg::metric {

/// Attitude of the camera as a whole (not on top of the mount's) at a running time. Signs as in mount.hpp.
struct Pose {
  std::int64_t time = 0; ///< running time, nanoseconds
  double roll = 0, pitch = 0;
  std::optional<double> yaw, height; ///< those of the mount where absent
};

/// What is wrong with a pose, or nullptr: NaN, a pitch over 80 degrees, a height that is none.
const char* flaw_of(const Pose& pose);

class PoseTrack {
 public:
  /// Poses may come out of order; the oldest of `capacity` goes. One at a time that is there replaces it.
  void add(const Pose& pose);
  void clear() { poses_.clear(); }

  /// The pose at `time`: between two poses on a straight line, else the nearest; nothing when that is farther
  /// away than `longest_gap` - stale, or in the future.
  std::optional<Pose> at(std::int64_t time) const;

  /// Forgets all poses when there is room for no other and even the oldest is later than `time` by more than
  /// longest_gap: they came from a clock that was wrong, and would keep out those that are right.
  void forget_future(std::int64_t time);

  static constexpr std::size_t capacity = 512;             ///< 2.5 s at 200 Hz
  static constexpr std::int64_t longest_gap = 100'000'000; ///< nanoseconds

 private:
  std::vector<Pose> poses_; ///< by time
};

/// The mount with the attitude of the moment.
Mount with_pose(Mount mount, const Pose& pose);

} // namespace terrainseg::metric
