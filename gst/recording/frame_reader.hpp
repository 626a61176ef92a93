// SPDX-License-Identifier: LGPL-2.1-or-later
// What the sinks of recordings and of ROS 2 share: the class, and reading a buffer with its metadata, metres
// and encoded picture.
#pragma once

#include <gst/base/gstbasesink.h>

#include <array>
#include <optional>
#include <string>

#include "recording/terrain_messages.hpp"
#include "support/buffers.hpp"
#include "support/element.hpp"
#include "support/estimate_meta.hpp"
#include "support/metric_meta.hpp"

namespace terrainseg {

enum class PictureKind : std::uint8_t { raw, h264, jpeg };
PictureKind kind_of(const GstCaps* caps);

/// Adds the pad for raw, H.264 and JPEG video. Upstream need not map or copy pixels: none are read.
void init_message_sink_class(gpointer klass);

/// The settings of both sinks.
struct MessageSettings {
  InternedName source;
  std::string camera_info, mount;
  std::string frame_id = recording::MessageOptions().body_frame;
  std::string camera_frame_id = recording::MessageOptions().camera_frame;
  double grid_resolution = recording::MessageOptions().grid_resolution;
};
/// The rows of a table whose struct has MessageSettings at the end of the path, with the blurbs that differ.
template <auto... path>
constexpr std::array<Property<OwnerOf<path...>>, 6> message_rows(const char* camera_info, const char* mount,
                                                                 const char* grid_resolution) {
  return {{
      source_row<path..., &MessageSettings::source>(),
      {"camera-info", "Camera info", camera_info, property_before_start,
       field<path..., &MessageSettings::camera_info>()},
      {"mount", "Mount", mount, property_before_start, field<path..., &MessageSettings::mount>()},
      {"frame-id", "Frame id", "Name of the vehicle's coordinate frame in the messages",
       property_before_start, field<path..., &MessageSettings::frame_id>()},
      {"camera-frame-id", "Camera frame id", "Name of the camera's optical coordinate frame in the messages",
       property_before_start, field<path..., &MessageSettings::camera_frame_id>()},
      {"grid-resolution", "Grid resolution", grid_resolution, property_before_start,
       field<path..., &MessageSettings::grid_resolution>(0.01, 10)},
  }};
}
/// What messages are made with, calibration included. Returns nothing after posting an error.
std::optional<recording::MessageOptions> read_options(GstElement* element, const MessageSettings& settings);

/// Reads a buffer. The data is valid until the reader is destroyed.
class FrameReader {
 public:
  FrameReader(GstBuffer* buffer, PictureKind kind, const char* source);

  /// The error in the metadata, or nullptr.
  const char* flaw() const { return estimate_.error() ? estimate_.error() : metric_.error(); }
  bool has_estimate() const { return static_cast<bool>(estimate_); }
  /// For the log.
  const char* content() const {
    return metric_ && estimate_ ? "with terrain and metres" : estimate_ ? "with terrain" : "without terrain";
  }
  /// Whether an H.264 picture refers to a later one (B-frame), which players of messages do not show.
  bool has_b_frame() const { return recording::inspect_h264(frame(0).video).b_slice; }
  recording::MessageFrame frame(std::uint64_t time) const;

 private:
  PictureKind kind_;
  MappedBuffer picture_; ///< not mapped if it is raw
  EstimateReader estimate_;
  MetricReader metric_;
};

} // namespace terrainseg
