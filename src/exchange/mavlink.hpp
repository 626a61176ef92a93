// SPDX-License-Identifier: LGPL-2.1-or-later
// MAVLink 2 messages that an autopilot avoids obstacles by: OBSTACLE_DISTANCE (id 330) and HEARTBEAT (id 0)
// out, ATTITUDE (id 30) in. Layouts: the MAVLink common message set
// (https://mavlink.io/en/messages/common.html).
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "exchange/metric_estimate.hpp"

namespace terrainseg {

/// How the 72 sectors of OBSTACLE_DISTANCE lie around the vehicle.
enum class MavlinkLayout : std::uint8_t {
  portable, ///< 5 degrees each, sector 0 straight ahead, clockwise: ArduPilot and PX4
  fine,     ///< all over the field of view, from its left edge on: ArduPilot only
};

/// What a sector says of which nothing is known although the camera looks there.
enum class MavlinkUnknown : std::uint8_t {
  obstacle, ///< an obstacle at the least distance: an autopilot takes no word for a free way
  nothing,  ///< 65535
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
  float angle_offset = 0;                                 ///< of sector 0, degrees to the right of ahead
};

/// Where a camera looks: from its leftmost to its rightmost column, degrees clockwise from ahead.
struct MavlinkView {
  double left = 0, right = 0;
};
/// Nothing when no bearing is known.
std::optional<MavlinkView> mavlink_view(std::span<const float> bearings);
/// All that a fan covers.
MavlinkView mavlink_view(const ScanFan& fan);

/// Sectors from the columns of a boundary (metres; radians counter-clockwise; NaN unknown, +infinity free),
/// each the least of its columns; one between two columns the least of both. Nothing is nearer than `min_m`:
/// it counts as there. Sectors outside the view are 65535; one within it with an unknown column and no nearer
/// obstacle, or without any column, is as `unknown` says. The sectors of the fine layout cover `fan`, else
/// the view; columns outside are in its outermost sectors.
ObstacleDistance obstacle_distance(const MavlinkView& view, std::span<const float> ranges,
                                   std::span<const float> bearings, MavlinkLayout layout,
                                   MavlinkUnknown unknown, double min_m, double max_m,
                                   const std::optional<MavlinkView>& fan = {});

/// Appends one frame; `sequence` counts on.
void append_obstacle_distance(std::vector<std::uint8_t>& out, const ObstacleDistance& message,
                              const MavlinkSender& sender, std::uint8_t& sequence);

/// Appends a heartbeat of an onboard controller without an autopilot that is active (type 18, autopilot 8,
/// status 4).
void append_heartbeat(std::vector<std::uint8_t>& out, const MavlinkSender& sender, std::uint8_t& sequence);

} // namespace terrainseg
