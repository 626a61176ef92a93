// SPDX-License-Identifier: LGPL-2.1-or-later
// Whether the horizon in the picture is where the mount has it. A hint for people only: in a wood or a
// corridor the horizon row is no vanishing line, so no attitude is taken from it.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <optional>
#include <vector>

#include "metric/mount.hpp"

namespace terrainseg::metric {

/// Radians by which the camera looks lower than the mount says when a ray through the horizon row is level:
/// positive = the picture's horizon is higher up than it should be.
inline double horizon_offset(const Mount& mount, const ImagePoint& horizon_ray) {
  const GroundProjection ground(mount);
  const double forward = std::hypot(ground.along(0, horizon_ray), ground.along(1, horizon_ray));
  return std::atan2(ground.along(2, horizon_ray), forward);
}

/// The median of the last ten seconds.
class HorizonMonitor {
 public:
  static constexpr std::int64_t span = 10'000'000'000;         ///< nanoseconds
  static constexpr std::int64_t step = 50'000'000;             ///< at most one sample in this time
  static constexpr double most = 3.14159265358979323846 / 180; ///< a degree

  /// `time` is in nanoseconds; a jump backwards clears the samples. Call it only for frames with a confident
  /// horizon.
  void add(std::int64_t time, double offset) {
    if (!samples_.empty() && time < samples_.back().time)
      samples_.clear();
    if (!samples_.empty() && time - samples_.back().time < step)
      return;
    std::erase_if(samples_, [time](const Sample& sample) { return time - sample.time > span; });
    samples_.push_back({time, offset});
  }
  /// Removes all samples and reserves memory, so that add() does not allocate.
  void clear() {
    constexpr std::size_t most_samples = span / step + 2;
    samples_.clear();
    samples_.reserve(most_samples);
    sorted_.reserve(most_samples);
  }
  /// Radians; nothing before ten seconds are nearly full.
  std::optional<double> median() const {
    constexpr std::size_t fewest = 20;
    if (samples_.size() < fewest || samples_.back().time - samples_.front().time < span / 10 * 9)
      return std::nullopt;
    sorted_.clear();
    for (const Sample& sample : samples_)
      sorted_.push_back(sample.offset);
    const auto middle = sorted_.begin() + static_cast<std::ptrdiff_t>(sorted_.size() / 2);
    std::nth_element(sorted_.begin(), middle, sorted_.end());
    return *middle;
  }
  bool disagrees() const {
    const auto offset = median();
    return offset && std::abs(*offset) > most;
  }

 private:
  struct Sample {
    std::int64_t time;
    double offset;
  };
  std::vector<Sample> samples_; ///< by time, not older than `span`
  mutable std::vector<double> sorted_;
};

} // namespace terrainseg::metric
