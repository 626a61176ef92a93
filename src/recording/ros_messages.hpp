// SPDX-License-Identifier: LGPL-2.1-or-later
// The ROS 2 messages that are sent: type definitions as text, and values as CDR.
//
// Coordinates as in REP 103: x forward, y left, z up in metres; angles in radians, counter-clockwise.
#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "exchange/metric_estimate.hpp"
#include "metric/camera.hpp"
#include "recording/cdr.hpp"
#include "terrainseg/frame.hpp"

namespace terrainseg::recording {

inline constexpr std::uint64_t second = 1'000'000'000; ///< nanoseconds

/// Rotation as a quaternion x, y, z, w.
using Quaternion = std::array<double, 4>;

inline Quaternion product(const Quaternion& a, const Quaternion& b) {
  return {a[3] * b[0] + a[0] * b[3] + a[1] * b[2] - a[2] * b[1],
          a[3] * b[1] - a[0] * b[2] + a[1] * b[3] + a[2] * b[0],
          a[3] * b[2] + a[0] * b[1] - a[1] * b[0] + a[2] * b[3],
          a[3] * b[3] - a[0] * b[0] - a[1] * b[1] - a[2] * b[2]};
}

/// Rotation by `angle` radians about axis 0 = x, 1 = y, 2 = z.
inline Quaternion about(int axis, double angle) {
  Quaternion q{0, 0, 0, std::cos(angle / 2)};
  q[static_cast<std::size_t>(axis)] = std::sin(angle / 2);
  return q;
}

/// Rz(yaw) Ry(pitch) Rx(roll), radians.
inline Quaternion rotation_of(double yaw, double pitch, double roll) {
  return product(product(about(2, yaw), about(1, pitch)), about(0, roll));
}

/// Time stamp, in nanoseconds since 1970 or since the start of the stream, and name of the coordinate frame.
struct Header {
  std::uint64_t time = 0;
  std::string frame;
};

/// sensor_msgs/msg/LaserScan. NaN = unknown, +infinity = free.
struct LaserScan {
  ScanFan fan;
  double scan_time = 0; ///< seconds since the previous scan, 0 = first scan
  double range_max = 0;
  std::span<const float> ranges; ///< one for each beam
};

/// A point of sensor_msgs/msg/PointCloud2: float32 fields x, y, z, low, high.
struct BoundaryPoint {
  float x, y, z;
  float low, high; ///< range minus and plus one standard deviation, metres
};

struct GridPlace {
  double resolution = 0; ///< metres per cell
  std::uint32_t width = 0, height = 0;
  double x = 0, y = 0; ///< corner of the first cell, metres
  bool operator==(const GridPlace&) const = default;
};
/// nav_msgs/msg/OccupancyGrid.
struct OccupancyGrid : GridPlace {
  std::span<const std::int8_t> cells; ///< rows along x, the first one at y: 0 free, 100 occupied, -1 unknown
};

/// geometry_msgs/msg/TransformStamped, one in tf2_msgs/msg/TFMessage.
struct Transform {
  std::string child;
  std::array<double, 3> translation{};
  Quaternion rotation{0, 0, 0, 1};
};

/// diagnostic_msgs/msg/DiagnosticStatus, one in diagnostic_msgs/msg/DiagnosticArray.
struct DiagnosticStatus {
  static constexpr std::uint8_t ok = 0, warn = 1;
  std::uint8_t level = ok;
  std::string name, message;
  std::vector<std::pair<std::string, std::string>> values;
};

/// sensor_msgs/msg/CompressedImage.
struct JpegFile {
  ByteView bytes;
};

/// foxglove_msgs/msg/CompressedVideo: one access unit, Annex B.
struct H264Picture {
  ByteView bytes;
};

/// A message type: its name, package/msg/Name, and its definition with all types that it uses, as in ros2msg
/// schemas; its hash.
struct MessageType {
  std::string name, text, hash;
};
/// Returns one of the types that are sent or received, by its short name, package/Name.
MessageType message_type(std::string_view name);

/// Each function encodes one message into `out`; it replaces the content.
void encode(Bytes& out, const Header& header, const LaserScan& scan);
void encode(Bytes& out, const Header& header, std::span<const BoundaryPoint> points);
void encode(Bytes& out, const Header& header, const OccupancyGrid& grid);
/// sensor_msgs/msg/CameraInfo of the raw picture: no rectification, no binning, no region of interest.
void encode(Bytes& out, const Header& header, const metric::Camera& camera);
/// sensor_msgs/msg/Image, mono8, rows without padding.
void encode(Bytes& out, const Header& header, const GrayView& picture);
void encode(Bytes& out, const Header& header, const Transform& transform);
void encode(Bytes& out, const Header& header, const DiagnosticStatus& status);
void encode(Bytes& out, const Header& header, const JpegFile& picture);
void encode(Bytes& out, const Header& header, const H264Picture& picture);

} // namespace terrainseg::recording
