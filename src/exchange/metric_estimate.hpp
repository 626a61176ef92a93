// SPDX-License-Identifier: LGPL-2.1-or-later
// The boundary in metres, in addition to an Estimate: for the metadata, text and messages.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <span>

#include "terrainseg/estimate.hpp"

namespace terrainseg {

/// Bits of MetricEstimate::flags.
enum MetricFlag : std::uint32_t {
  metric_flag_pose = 1,    ///< the attitude is from terrainseg-pose events; otherwise from the mount
  metric_flag_horizon = 2, ///< the horizon in the picture disagrees with that attitude
};

/// Position in the picture of the ground at a range straight ahead of the body.
struct RangeTick {
  float range;       ///< metres
  float column, row; ///< fractions of the frame's width and height, from the left and the top
};

/// The geometry of a scan. The same for every frame of a stream.
struct ScanFan {
  double angle_min = 0;    ///< direction of the first beam, the rightmost, radians
  double increment = 0;    ///< from one beam to the next, radians counter-clockwise
  std::uint32_t beams = 0; ///< 0 = the producer of the metres gives no fan
  double range_min = 0;    ///< metres; nearer ranges count as this
  double angle_max() const { return angle_min + (beams - 1.0) * increment; }
  bool operator==(const ScanFan&) const = default;
};
inline constexpr std::uint32_t most_beams = 65536;

/// A fan over all directions with `beams` beams.
inline ScanFan whole_circle(std::uint32_t beams, double range_min) {
  return {-std::numbers::pi, 2 * std::numbers::pi / beams, beams, range_min};
}

/// Views into the memory of the producer. Each has one value per mask column, except the ticks.
struct MetricEstimate {
  /// Range over ground from the body's origin to the end of the free space, metres. +infinity = free up to
  /// range_max, NaN = unknown.
  std::span<const float> ranges;
  std::span<const float> bearings;     ///< radians, counter-clockwise from straight ahead; NaN = unknown
  std::span<const float> low, high;    ///< the range one standard deviation nearer and farther
  double height = 0;                   ///< of the camera over the ground, metres
  double pitch = 0, roll = 0, yaw = 0; ///< radians: positive = looks down, right side down, looks left
  double range_min = 0;                ///< range of the nearest visible ground, metres
  double range_max = 0;                ///< largest reported range, metres
  std::uint32_t flags = 0;
  std::span<const RangeTick> ticks{}; ///< nearest first; for drawing, may be empty
  ScanFan fan{};
};

inline constexpr std::size_t most_ticks = 32;
/// Largest valid distance in metres of an external metric estimate: it is multiplied by 1000 and stored as an
/// integer.
inline constexpr double farthest_metres = 1e9;

/// Checks a metric estimate from an external source. Returns the first error, or nullptr if it is valid.
inline const char* flaw_of(const MetricEstimate& m) {
  const auto all = [](std::span<const float> values, auto good) {
    return std::ranges::all_of(values, [&](float value) { return std::isnan(value) || good(value); });
  };
  const auto are_ranges = [&](std::span<const float> values) {
    return all(values, [](float v) { return v >= 0; });
  };
  const std::size_t columns = m.ranges.size();
  if (columns < 1 || columns > longest_picture_side || m.bearings.size() != columns ||
      m.low.size() != columns || m.high.size() != columns)
    return "ranges, bearings, low and high do not have one float each for every mask column";
  if (!(m.height > 0 && m.height <= farthest_metres))
    return "the camera's height is not above 0 and at most 10^9 m";
  for (const double angle : {m.pitch, m.roll, m.yaw})
    if (!(std::abs(angle) <= 6.2832))
      return "pitch, roll or yaw is not an angle in radians";
  if (!(m.range_max > 0 && m.range_max <= farthest_metres) ||
      !(m.range_min >= 0 && m.range_min <= farthest_metres))
    return "range-min or range-max is not a distance in metres";
  if (!are_ranges(m.ranges) || !are_ranges(m.low) || !are_ranges(m.high))
    return "a range is below 0";
  if (!all(m.bearings, [](float v) { return std::abs(v) <= 3.1416F; }))
    return "a bearing is more than half a turn";
  const ScanFan& fan = m.fan;
  if (fan.beams > most_beams || (fan.beams > 0 && !(std::abs(fan.angle_min) <= 6.2832 && fan.increment > 0 &&
                                                    fan.beams * fan.increment <= 6.2832 &&
                                                    fan.range_min >= 0 && fan.range_min <= farthest_metres)))
    return "the fan of the scans is not within a circle";
  if (m.ticks.size() > most_ticks || !std::ranges::all_of(m.ticks, [](const RangeTick& t) {
        return t.range > 0 && t.range < 10000 && t.column >= 0 && t.column <= 1 && t.row >= 0 && t.row <= 1;
      }))
    return "ticks are too many or lie outside the picture";
  return nullptr;
}

} // namespace terrainseg
