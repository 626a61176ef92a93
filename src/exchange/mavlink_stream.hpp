// SPDX-License-Identifier: LGPL-2.1-or-later
// Chooses the frames of a video stream for which MAVLink messages are sent, and what is sent for frames
// without known ranges.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "exchange/mavlink.hpp"
#include "exchange/metric_estimate.hpp"

namespace terrainseg {

struct MavlinkOptions {
  MavlinkLayout layout = MavlinkLayout::portable;
  MavlinkUnknown unknown = MavlinkUnknown::obstacle;
  MavlinkSender sender;
};

class MavlinkStream {
 public:
  /// Returns the MAVLink frames for a video frame: OBSTACLE_DISTANCE at most 15 times a second of `time`
  /// (stream time, nanoseconds), for every frame at lower rates; before it once a second a HEARTBEAT. Empty
  /// if no message is due. Valid until the next call. `metric` is nullptr if the ranges of this frame are
  /// unknown; the view is then the last known one, or the half circle ahead before the first one.
  std::span<const std::uint8_t> at(std::int64_t time, std::uint64_t time_us, const MetricEstimate* metric,
                                   const MavlinkOptions& options);
  /// Restarts the time: the next frame is sent. The view and the sequence number are kept.
  void restart() { next_obstacle_ = next_heartbeat_ = last_ = std::nullopt; }

 private:
  std::optional<std::int64_t> next_obstacle_, next_heartbeat_, last_;
  MavlinkView view_{-90, 90};
  std::optional<MavlinkView> fan_; ///< view of the fine layout, from the first frame with metres
  double range_min_ = 0.2, range_max_ = 8;
  std::uint8_t sequence_ = 0;
  std::vector<std::uint8_t> bytes_;
};

} // namespace terrainseg
