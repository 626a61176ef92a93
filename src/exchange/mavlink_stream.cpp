// SPDX-License-Identifier: LGPL-2.1-or-later
#include "exchange/mavlink_stream.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <numbers>

#include "exchange/bytes.hpp"

namespace terrainseg {
namespace {

constexpr std::uint8_t magic = 0xFD; // start byte of MAVLink 2
constexpr std::size_t header_size = 10;

/// Number of a message and CRC_EXTRA, the byte of its definition that is included in the checksum.
struct MessageKind {
  std::uint32_t id;
  std::uint8_t crc_extra;
};
constexpr MessageKind heartbeat{0, 50}, obstacle{330, 23};

/// CRC-16/MCRF4XX, start value 0xFFFF.
std::uint16_t checksum(std::span<const std::uint8_t> bytes, std::uint16_t crc = 0xFFFF) {
  for (std::uint8_t byte : bytes) {
    std::uint8_t t = static_cast<std::uint8_t>(byte ^ (crc & 0xFF));
    t = static_cast<std::uint8_t>(t ^ (t << 4));
    crc = static_cast<std::uint16_t>((crc >> 8) ^ (t << 8) ^ (t << 3) ^ (t >> 4));
  }
  return crc;
}

/// Writes one frame; `write` appends the payload.
template <class Write>
void append_frame(std::vector<std::uint8_t>& out, MessageKind kind, const MavlinkSender& sender,
                  std::uint8_t& sequence, Write write) {
  const std::size_t start = out.size();
  for (std::uint8_t byte : {magic, std::uint8_t{0}, std::uint8_t{0}, std::uint8_t{0}, sequence++,
                            sender.system_id, sender.component_id})
    out.push_back(byte);
  put_integer(out, kind.id, 3);
  write(out);
  // Trailing zeros are not sent, except the first byte of the payload.
  while (out.size() > start + header_size + 1 && out.back() == 0)
    out.pop_back();
  out[start + 1] = static_cast<std::uint8_t>(out.size() - start - header_size);
  put_integer(out, checksum({&kind.crc_extra, 1}, checksum(std::span(out).subspan(start + 1))));
}

double degrees(double radians) {
  return radians * 180 / std::numbers::pi;
}

/// How the sectors divide the circle.
struct Sectors {
  double start, width; ///< left edge of sector 0 and its width, degrees clockwise
  bool around;         ///< the sectors also cover the directions behind the vehicle

  Sectors(const MavlinkView& view, MavlinkLayout layout) {
    around = layout == MavlinkLayout::portable;
    width = around ? 5 : std::max((view.right - view.left) / mavlink_sectors, 0.01);
    start = around ? -width / 2 : view.left;
  }
  int of(double clockwise) const {
    const int sector = static_cast<int>(std::floor((clockwise - start) / width));
    return around ? (sector % mavlink_sectors + mavlink_sectors) % mavlink_sectors
                  : std::clamp(sector, 0, mavlink_sectors - 1);
  }
  /// In -180..180 for the layout that covers the circle.
  double centre(int sector) const {
    const double angle = start + (sector + 0.5) * width;
    return around && angle > 180 ? angle - 360 : angle;
  }
  bool in_view(int sector, const MavlinkView& view) const {
    const double middle = centre(sector);
    return middle + width / 2 > view.left && middle - width / 2 <= view.right;
  }
};

/// Summary of the columns of one sector.
struct Reading {
  double nearest = std::numeric_limits<double>::infinity(); ///< metres
  bool known = false, doubtful = false;                     ///< has a column with a range; has one without

  void take(float range) {
    if (std::isnan(range)) {
      doubtful = true;
      return;
    }
    known = true;
    nearest = std::min<double>(nearest, range);
  }
  bool empty() const { return !known && !doubtful; }
};

/// Summary of the neighbouring columns to the left and right of a direction, for sectors without a column.
Reading between_columns(std::span<const float> ranges, std::span<const float> bearings, double clockwise) {
  double left = -std::numeric_limits<double>::infinity(), right = -left;
  Reading reading;
  float at_left = 0, at_right = 0;
  for (std::size_t i = 0; i < std::min(ranges.size(), bearings.size()); ++i) {
    const double angle = -degrees(bearings[i]);
    if (angle <= clockwise && angle > left) {
      left = angle;
      at_left = ranges[i];
    } else if (angle > clockwise && angle < right) {
      right = angle;
      at_right = ranges[i];
    }
  }
  if (std::isfinite(left))
    reading.take(at_left);
  if (std::isfinite(right))
    reading.take(at_right);
  return reading;
}

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

std::optional<MavlinkView> mavlink_view(std::span<const float> bearings) {
  MavlinkView view{std::numeric_limits<double>::infinity(), -std::numeric_limits<double>::infinity()};
  for (float bearing : bearings)
    if (std::isfinite(bearing)) {
      view.left = std::min(view.left, -degrees(bearing));
      view.right = std::max(view.right, -degrees(bearing));
    }
  return view.left <= view.right ? std::optional(view) : std::nullopt;
}

MavlinkView mavlink_view(const ScanFan& fan) {
  const double half_beam = fan.increment / 2;
  return {-degrees(fan.angle_max() + half_beam), -degrees(fan.angle_min - half_beam)};
}

ObstacleDistance obstacle_distance(const MavlinkView& view, std::span<const float> ranges,
                                   std::span<const float> bearings, MavlinkLayout layout,
                                   MavlinkUnknown unknown, double min_m, double max_m,
                                   const std::optional<MavlinkView>& fan) {
  ObstacleDistance message;
  message.min_distance = static_cast<std::uint16_t>(std::clamp(std::ceil(min_m * 100), 1.0, 65000.0));
  message.max_distance =
      static_cast<std::uint16_t>(std::clamp(std::floor(max_m * 100), message.min_distance + 1.0, 65001.0));
  const Sectors sectors(fan.value_or(view), layout);
  if (layout == MavlinkLayout::fine) {
    message.increment = 0;
    message.increment_f = static_cast<float>(sectors.width);
    message.angle_offset = static_cast<float>(sectors.start + sectors.width / 2);
  }

  std::array<Reading, mavlink_sectors> readings{};
  for (std::size_t i = 0; i < std::min(ranges.size(), bearings.size()); ++i)
    if (std::isfinite(bearings[i]))
      readings[sectors.of(-degrees(bearings[i]))].take(ranges[i]);
  const std::uint16_t blind =
      unknown == MavlinkUnknown::obstacle ? message.min_distance : mavlink_unknown_distance;
  for (int i = 0; i < mavlink_sectors; ++i) {
    Reading reading = readings[i];
    if (reading.empty() && sectors.in_view(i, view))
      reading = between_columns(ranges, bearings, sectors.centre(i));
    else if (reading.empty()) {
      message.distances[i] = mavlink_unknown_distance;
      continue;
    }
    // Rounded towards the vehicle. Ranges are multiples of a millimetre in single precision: 2.1 m must not
    // become 209 cm.
    const double cm = std::clamp(std::floor(std::round(reading.nearest * 1000) / 10),
                                 message.min_distance + 0.0, message.max_distance + 1.0);
    // Unknown space may contain an obstacle at the shortest distance, or hide one that is visible.
    const bool is_known =
        reading.known &&
        (!reading.doubtful || (unknown == MavlinkUnknown::nothing && cm <= message.max_distance));
    message.distances[i] = is_known ? static_cast<std::uint16_t>(cm) : blind;
  }
  return message;
}

void append_obstacle_distance(std::vector<std::uint8_t>& out, const ObstacleDistance& message,
                              const MavlinkSender& sender, std::uint8_t& sequence) {
  constexpr std::uint8_t sensor_unknown = 4, body_frd = 12;
  append_frame(out, obstacle, sender, sequence, [&](std::vector<std::uint8_t>& payload) {
    put_integer(payload, message.time_us);
    for (std::uint16_t distance : message.distances)
      put_integer(payload, distance);
    put_integer(payload, message.min_distance);
    put_integer(payload, message.max_distance);
    put_integer(payload, sensor_unknown);
    put_integer(payload, message.increment);
    put_integer(payload, std::bit_cast<std::uint32_t>(message.increment_f));
    put_integer(payload, std::bit_cast<std::uint32_t>(message.angle_offset));
    put_integer(payload, body_frd);
  });
}

void append_heartbeat(std::vector<std::uint8_t>& out, const MavlinkSender& sender, std::uint8_t& sequence) {
  append_frame(out, heartbeat, sender, sequence, [](std::vector<std::uint8_t>& payload) {
    put_integer(payload, std::uint32_t{0}); // custom mode
    for (std::uint8_t byte : {18, 8, 0, 4, 3})
      payload.push_back(byte); // type onboard controller, no autopilot, mode 0, active, MAVLink 2
  });
}

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
  const MetricEstimate m = metric ? *metric : MetricEstimate();
  ObstacleDistance message = obstacle_distance(view_, m.ranges, m.bearings, options.layout, options.unknown,
                                               range_min_, range_max_, fan_);
  message.time_us = time_us;
  append_obstacle_distance(bytes_, message, options.sender, sequence_);
  return bytes_;
}

} // namespace terrainseg
