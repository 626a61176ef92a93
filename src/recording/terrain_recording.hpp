// SPDX-License-Identifier: LGPL-2.1-or-later
// Estimates, metres and video as a ROS 2 recording: what goes under which topic.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "exchange/metric_estimate.hpp"
#include "metric/mount.hpp"
#include "recording/free_space_shapes.hpp"
#include "recording/h264_unit.hpp"
#include "recording/mcap_writer.hpp"
#include "terrainseg/estimate.hpp"

namespace terrainseg::recording {

struct RecordingOptions {
  std::string body_frame = "base_link";        ///< of scan, points and grid
  std::string camera_frame = "camera_optical"; ///< of mask, video and camera info
  double grid_resolution = 0.1;                ///< metres a cell
  std::optional<metric::Camera> camera;        ///< without it no camera info
  std::optional<metric::Mount> mount;          ///< without it no transform
};

/// What is recorded of one frame.
struct RecordedFrame {
  std::uint64_t time = 0; ///< nanoseconds since 1970, or since the stream began
  const Estimate* estimate = nullptr;
  const MetricEstimate* metric = nullptr;
  ByteView video; ///< an H.264 access unit; empty = none
};

class TerrainRecording {
 public:
  TerrainRecording(ByteSink sink, RecordingOptions options);

  /// False when it could not be written: as McapWriter.
  [[nodiscard]] bool add(const RecordedFrame& frame);
  [[nodiscard]] bool flush() { return writer_.flush(); }
  [[nodiscard]] bool finish() { return writer_.finish(); }

  /// The metadata.yaml of a rosbag2 folder in which this recording is the file `name`.
  std::string bag_metadata(const std::string& name) const;
  const McapWriter& writer() const { return writer_; }

 private:
  enum Topic : std::uint8_t { scan, points, grid, mask, camera_info, video, tf, topics };
  bool put(Topic topic, std::uint64_t time);
  bool add_metric(const Header& body, const MetricEstimate& metric);
  bool add_camera(const Header& camera, int width, int height);
  bool add_transform(const Header& body, const MetricEstimate* metric);
  bool add_video(const Header& camera, ByteView unit);

  const RecordingOptions options_;
  McapWriter writer_;
  std::array<std::uint16_t, topics> channels_{};
  Bytes message_;
  ParameterSets parameter_sets_;
  Beams beams_;
  FreeSpaceGrid grid_;
  std::vector<BoundaryPoint> points_;
  std::optional<std::uint64_t> last_scan_;
};

} // namespace terrainseg::recording
