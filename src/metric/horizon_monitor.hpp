// SPDX-License-Identifier: LGPL-2.1-or-later
// Whether the horizon in the picture is where the mount has it. A hint for people only: in a wood or a
// corridor the horizon row is no vanishing line, so no attitude is taken from it.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "metric/mount.hpp"

namespace terrainseg::metric {

/// Radians by which the camera looks lower than the mount says when a ray through the horizon row is level:
/// positive = the picture's horizon is higher up than it should be.
double horizon_offset(const Mount& mount, const ImagePoint& horizon_ray);

/// The median of the last ten seconds.
class HorizonMonitor {
 public:
  static constexpr std::int64_t span = 10'000'000'000;         ///< nanoseconds
  static constexpr std::int64_t step = 50'000'000;             ///< at most one sample in this time
  static constexpr double most = 3.14159265358979323846 / 180; ///< a degree

  /// `time` is in nanoseconds; a jump backwards clears the samples. Call it only for frames with a confident
  /// horizon.
  void add(std::int64_t time, double offset);
  /// Removes all samples and reserves memory, so that add() does not allocate.
  void clear();
  /// Radians; nothing before ten seconds are nearly full.
  std::optional<double> median() const;
  bool disagrees() const;

 private:
  struct Sample {
    std::int64_t time;
    double offset;
  };
  std::vector<Sample> samples_; ///< by time, not older than `span`
  mutable std::vector<double> sorted_;
};

} // namespace terrainseg::metric
