// SPDX-License-Identifier: LGPL-2.1-or-later
// MAVLink 2 messages for obstacle avoidance: OBSTACLE_DISTANCE (id 330) and HEARTBEAT (id 0). Layouts: the
// MAVLink common message set (https://mavlink.io/en/messages/common.html).
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "exchange/metric_estimate.hpp"

namespace terrainseg {

/// Directions of the 72 sectors of OBSTACLE_DISTANCE.
enum class MavlinkLayout : std::uint8_t {
  portable, ///< 5 degrees each, clockwise, sector 0 straight ahead; for ArduPilot and PX4
  fine,     ///< cover the field of view from its left edge; for ArduPilot only
};

/// What is sent for a visible sector of unknown range.
enum class MavlinkUnknown : std::uint8_t {
  obstacle, ///< an obstacle at the shortest distance, because an autopilot takes a missing value for free
            ///< space
  nothing,  ///< 65535 (unknown)
};

struct MavlinkSender {
  std::uint8_t system_id = 1;
  std::uint8_t component_id = 196; ///< MAV_COMP_ID_OBSTACLE_AVOIDANCE
};

inline constexpr int mavlink_sectors = 72;
inline constexpr std::uint16_t mavlink_unknown_distance = 65535;

struct ObstacleDistance {
  std::uint64_t time_us = 0;                              ///< UNIX time or time since boot
  std::array<std::uint16_t, mavlink_sectors> distances{}; ///< cm; above max = free; 65535 = unknown
  std::uint16_t min_distance = 0, max_distance = 0;       ///< cm
  std::uint8_t increment = 5;                             ///< degrees, clockwise, where increment_f is 0
  float increment_f = 0;                                  ///< degrees
  float angle_offset = 0; ///< direction of sector 0, degrees to the right of straight ahead
};

/// Field of view, from the leftmost to the rightmost column, degrees clockwise from straight ahead.
struct MavlinkView {
  double left = 0, right = 0;
};
/// Returns nothing if no bearing is known.
std::optional<MavlinkView> mavlink_view(std::span<const float> bearings);
/// Returns the smallest view that contains all directions of a fan.
MavlinkView mavlink_view(const ScanFan& fan);

/// Computes sectors from the columns of a boundary (ranges in metres, NaN = unknown, +infinity = free;
/// bearings in radians, counter-clockwise). A sector gets the shortest range of its columns; a sector between
/// two columns the shorter of both. Ranges below `min_m` count as `min_m`. Sectors outside the view are
/// 65535. A visible sector without a column, or with an unknown column and no nearer obstacle, is set as
/// `unknown` says. The sectors of the fine layout cover `fan`, or the view without a fan; columns outside
/// count for its outermost sectors.
ObstacleDistance obstacle_distance(const MavlinkView& view, std::span<const float> ranges,
                                   std::span<const float> bearings, MavlinkLayout layout,
                                   MavlinkUnknown unknown, double min_m, double max_m,
                                   const std::optional<MavlinkView>& fan = {});

/// Appends one frame and increments `sequence`.
void append_obstacle_distance(std::vector<std::uint8_t>& out, const ObstacleDistance& message,
                              const MavlinkSender& sender, std::uint8_t& sequence);

/// Appends a HEARTBEAT: an active onboard controller without an autopilot (type 18, autopilot 8, status 4).
void append_heartbeat(std::vector<std::uint8_t>& out, const MavlinkSender& sender, std::uint8_t& sequence);

struct MavlinkOptions {
  MavlinkLayout layout = MavlinkLayout::portable;
  MavlinkUnknown unknown = MavlinkUnknown::obstacle;
  MavlinkSender sender;
};

/// Chooses the frames of a video stream for which messages are sent, and what is sent for frames without
/// known ranges.
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
