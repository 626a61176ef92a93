// SPDX-License-Identifier: LGPL-2.1-or-later
// Converts estimates, metres and video to ROS 2 messages, for recordings and for DDS.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "exchange/metric_estimate.hpp"
#include "metric/mount.hpp"
#include "recording/free_space_shapes.hpp"
#include "recording/h264_unit.hpp"
#include "terrainseg/estimate.hpp"

namespace terrainseg::recording {

struct MessageOptions {
  std::string body_frame = "base_link";        ///< frame id of scan, points and grid
  std::string camera_frame = "camera_optical"; ///< frame id of mask, pictures and camera info
  double grid_resolution = 0.1;                ///< metres per cell
  std::optional<metric::Camera> camera;        ///< nothing = no camera info
  std::optional<metric::Mount> mount;          ///< nothing = no transform
};

struct MessageFrame {
  std::uint64_t time = 0; ///< nanoseconds since 1970, or since the start of the stream
  const Estimate* estimate = nullptr;
  const MetricEstimate* metric = nullptr;
  ByteView video;                 ///< an H.264 access unit; empty = none
  ByteView picture;               ///< a JPEG file; empty = none
  std::optional<bool> near_clear; ///< report of the near-range sensor; nothing = unknown
};

/// `tf` has the attitude of the frame, `tf_static` that of the mount.
enum class Topic : std::uint8_t {
  scan,
  points,
  grid,
  mask,
  camera_info,
  video,
  picture,
  tf,
  tf_static,
  diagnostics
};
inline constexpr std::size_t topic_count = 10;
/// A topic's usual name, to which a vehicle's prefix may be added unless it begins with a slash, and its
/// type, package/Name.
struct TopicKind {
  const char *name, *type;
};
inline constexpr TopicKind topic_kinds[topic_count] = {
    {"terrain/scan", "sensor_msgs/LaserScan"},
    {"terrain/points", "sensor_msgs/PointCloud2"},
    {"terrain/grid", "nav_msgs/OccupancyGrid"},
    {"terrain/mask", "sensor_msgs/Image"},
    {"camera/camera_info", "sensor_msgs/CameraInfo"},
    {"camera/video", "foxglove_msgs/CompressedVideo"},
    {"camera/image/compressed", "sensor_msgs/CompressedImage"},
    {"/tf", "tf2_msgs/TFMessage"},
    {"/tf_static", "tf2_msgs/TFMessage"},
    {"/diagnostics", "diagnostic_msgs/DiagnosticArray"}};
inline MessageType type_of(Topic topic) {
  return message_type(topic_kinds[static_cast<std::size_t>(topic)].type);
}

/// Receives the messages.
class MessageOutlet {
 public:
  virtual ~MessageOutlet() = default;
  /// Whether a topic is needed. Other topics are not encoded.
  virtual bool wants(Topic topic) = 0;
  /// May throw if the message cannot be written; this ends the frame.
  virtual void put(Topic topic, std::uint64_t time, ByteView message) = 0;
};

class TerrainMessages {
 public:
  explicit TerrainMessages(MessageOptions options) : options_(std::move(options)) {}
  void add(const MessageFrame& frame, MessageOutlet& out);

 private:
  template <class Content> void send(MessageOutlet& out, Topic topic, const Header& header, Content content);
  void add_metric(MessageOutlet& out, const Header& body, const MetricEstimate& metric);
  void add_transform(MessageOutlet& out, const Header& body, const MetricEstimate* metric);
  void add_diagnostics(MessageOutlet& out, const Header& header, const MessageFrame& frame);

  const MessageOptions options_;
  Bytes message_;
  ParameterSets parameter_sets_;
  Beams beams_;
  FreeSpaceGrid grid_;
  std::vector<BoundaryPoint> points_;
  std::optional<std::uint64_t> last_scan_;
  DiagnosticStatus status_;
  std::optional<std::uint64_t> last_status_;
};

} // namespace terrainseg::recording
