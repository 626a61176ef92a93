// SPDX-License-Identifier: LGPL-2.1-or-later
// Estimates, metres and video as ROS 2 messages: which topics a frame has, for recordings and for DDS.
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
  std::string body_frame = "base_link";        ///< of scan, points and grid
  std::string camera_frame = "camera_optical"; ///< of mask, pictures and camera info
  double grid_resolution = 0.1;                ///< metres a cell
  std::optional<metric::Camera> camera;        ///< without it no camera info
  std::optional<metric::Mount> mount;          ///< without it no transform
};

/// What the messages of one frame are made of.
struct MessageFrame {
  std::uint64_t time = 0; ///< nanoseconds since 1970, or since the stream began
  const Estimate* estimate = nullptr;
  const MetricEstimate* metric = nullptr;
  ByteView video;                 ///< an H.264 access unit; empty = none
  ByteView picture;               ///< a JPEG file; empty = none
  std::optional<bool> near_clear; ///< what the near-range sensor reports; nothing = unknown
};

/// `tf` is the attitude of the moment, `tf_static` that of the mount.
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
MessageType type_of(Topic topic);

/// Takes the messages.
class MessageOutlet {
 public:
  virtual ~MessageOutlet() = default;
  /// A topic that is not wanted is not encoded.
  virtual bool wants(Topic topic) = 0;
  /// False ends the frame: the message could not be written.
  virtual bool put(Topic topic, std::uint64_t time, ByteView message) = 0;
};

class TerrainMessages {
 public:
  explicit TerrainMessages(MessageOptions options) : options_(std::move(options)) {}
  /// Puts the messages of a frame into `out`. False when the outlet returned false.
  [[nodiscard]] bool add(const MessageFrame& frame, MessageOutlet& out);

 private:
  bool add_metric(MessageOutlet& out, const Header& body, const MetricEstimate& metric);
  bool add_camera(MessageOutlet& out, const Header& camera, int width, int height);
  bool add_transform(MessageOutlet& out, const Header& body, const MetricEstimate* metric);
  bool add_pictures(MessageOutlet& out, const Header& camera, const MessageFrame& frame);
  bool add_diagnostics(MessageOutlet& out, const Header& header, const MessageFrame& frame);

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
