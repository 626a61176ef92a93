// SPDX-License-Identifier: LGPL-2.1-or-later
#include "exchange/mavlink_stream.hpp"

#include <algorithm>

namespace terrainseg {
namespace {

constexpr std::int64_t second = 1'000'000'000;
constexpr std::int64_t obstacle_period = second / 15, heartbeat_period = second;
constexpr std::int64_t tolerance =
    second / 500; ///< tolerance for rounded time stamps (some containers have milliseconds)
/// Times beyond 146 years are limited to this, to avoid overflow of sums.
constexpr std::int64_t latest = std::int64_t{1} << 62;
/// Frames may come in coding order. A larger step back is a restart of the stream.
constexpr std::int64_t most_reordering = second / 4;

/// Whether a message is due, and when the next one is. The times are on a grid, so the mean rate is right for
/// every frame rate.
bool is_due(std::optional<std::int64_t>& next, std::int64_t time, std::int64_t period) {
  if (next && time + tolerance < *next)
    return false;
  const bool late = !next || time - *next > period;
  next = (late ? time : *next) + period;
  return true;
}

} // namespace

std::span<const std::uint8_t> MavlinkStream::at(std::int64_t time, std::uint64_t time_us,
                                                const MetricEstimate* metric, const MavlinkOptions& options) {
  time = std::clamp(time, -latest, latest);
  if (last_ && time < *last_ - most_reordering)
    restart();
  if (!last_ || time > *last_)
    last_ = time;
  bytes_.clear();
  if (metric) {
    view_ = mavlink_view(metric->bearings).value_or(view_);
    if (!fan_)
      fan_ = metric->fan.beams > 0 ? mavlink_view(metric->fan) : mavlink_view(metric->bearings);
    range_min_ = metric->fan.beams > 0 ? metric->fan.range_min : metric->range_min;
    range_max_ = metric->range_max;
  }
  if (!is_due(next_obstacle_, time, obstacle_period))
    return {};
  if (is_due(next_heartbeat_, time, heartbeat_period))
    append_heartbeat(bytes_, options.sender, sequence_);
  ObstacleDistance message = obstacle_distance(view_, metric ? metric->ranges : std::span<const float>(),
                                               metric ? metric->bearings : std::span<const float>(),
                                               options.layout, options.unknown, range_min_, range_max_, fan_);
  message.time_us = time_us;
  append_obstacle_distance(bytes_, message, options.sender, sequence_);
  return bytes_;
}

} // namespace terrainseg
