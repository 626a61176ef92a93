// SPDX-License-Identifier: LGPL-2.1-or-later
#include "metric/horizon_monitor.hpp"

#include <algorithm>
#include <cmath>

namespace terrainseg::metric {

double horizon_offset(const Mount& mount, const ImagePoint& horizon_ray) {
  const GroundProjection ground(mount);
  const double forward = std::hypot(ground.along(0, horizon_ray), ground.along(1, horizon_ray));
  return std::atan2(ground.along(2, horizon_ray), forward);
}

void HorizonMonitor::add(std::int64_t time, double offset) {
  if (!samples_.empty() && time < samples_.back().time)
    samples_.clear();
  if (!samples_.empty() && time - samples_.back().time < step)
    return;
  const auto young = std::find_if(samples_.begin(), samples_.end(),
                                  [time](const Sample& sample) { return time - sample.time <= span; });
  samples_.erase(samples_.begin(), young);
  samples_.push_back({time, offset});
}

void HorizonMonitor::clear() {
  constexpr std::size_t most_samples = span / step + 2;
  samples_.clear();
  samples_.reserve(most_samples);
  sorted_.reserve(most_samples);
}

std::optional<double> HorizonMonitor::median() const {
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

bool HorizonMonitor::disagrees() const {
  const auto offset = median();
  return offset && std::abs(*offset) > most;
}

} // namespace terrainseg::metric
