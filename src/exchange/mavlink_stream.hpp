// SPDX-License-Identifier: LGPL-2.1-or-later
// The MAVLink messages of a video stream: which of its frames become one, and what those say of which nothing
// is known.
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
  /// The frames to send for a video frame: OBSTACLE_DISTANCE, at most 15 a second of `time` (nanoseconds of
  /// the stream), every frame below that; once a second a HEARTBEAT before it. Empty when it is not time yet.
  /// Valid until the next call. `metric` nullptr: nothing is known of this frame. What the camera looks at is
  /// then as far as it was known last; before that, the half circle ahead.
  std::span<const std::uint8_t> at(std::int64_t time, std::uint64_t time_us, const MetricEstimate* metric,
                                   const MavlinkOptions& options);
  /// Time starts anew: the next frame is sent. The view and the sequence number stay.
  void restart() { next_obstacle_ = next_heartbeat_ = last_ = std::nullopt; }

 private:
  std::optional<std::int64_t> next_obstacle_, next_heartbeat_, last_;
  MavlinkView view_{-90, 90};
  std::optional<MavlinkView> fan_; ///< of the fine layout, from the first metres on
  double range_min_ = 0.2, range_max_ = 8;
  std::uint8_t sequence_ = 0;
  std::vector<std::uint8_t> bytes_;
};

} // namespace terrainseg
