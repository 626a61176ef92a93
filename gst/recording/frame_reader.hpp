// SPDX-License-Identifier: LGPL-2.1-or-later
// What the sinks of recordings and of ROS 2 share: the class, and reading a buffer with its metadata, metres
// and encoded picture.
#pragma once

#include <gst/base/gstbasesink.h>
#include <gst/video/video.h>

#include <array>
#include <optional>
#include <string>
#include <utility>

#include "recording/terrain_messages.hpp"
#include "support/buffers.hpp"
#include "support/calibration_files.hpp"
#include "support/element.hpp"
#include "support/estimate_meta.hpp"

namespace terrainseg {

enum class PictureKind : std::uint8_t { raw, h264, jpeg };
inline PictureKind kind_of(const GstCaps* caps) {
  const GstStructure* structure = gst_caps_get_structure(caps, 0);
  if (gst_structure_has_name(structure, "video/x-h264"))
    return PictureKind::h264;
  return gst_structure_has_name(structure, "image/jpeg") ? PictureKind::jpeg : PictureKind::raw;
}

/// Adds the pad for raw, H.264 and JPEG video. Upstream need not map or copy pixels: none are read.
inline void init_message_sink_class(gpointer klass) {
  add_pad_template(klass, "sink", GST_PAD_SINK,
                   "video/x-h264, stream-format = (string) byte-stream, alignment = (string) au; image/jpeg; "
                   "video/x-raw(ANY)");
  GST_BASE_SINK_CLASS(klass)->propose_allocation = [](GstBaseSink*, GstQuery* query) -> gboolean {
    gst_query_add_allocation_meta(query, GST_VIDEO_META_API_TYPE, nullptr);
    return TRUE;
  };
}

/// The settings of both sinks.
struct MessageSettings {
  InternedName source;
  std::string camera_info, mount;
  recording::MessageOptions options; ///< without the calibration, which is read from the files
};
/// The rows of a table whose struct has MessageSettings at the end of the path, with the blurbs that differ.
template <auto... path>
constexpr std::array<Property<OwnerOf<path...>>, 6> message_rows(const char* camera_info, const char* mount,
                                                                 const char* grid_resolution) {
  constexpr auto options = &MessageSettings::options;
  return {{
      source_row<path..., &MessageSettings::source>(),
      {"camera-info", "Camera info", camera_info, property_before_start,
       field<path..., &MessageSettings::camera_info>()},
      {"mount", "Mount", mount, property_before_start, field<path..., &MessageSettings::mount>()},
      {"frame-id", "Frame id", "Name of the vehicle's coordinate frame in the messages",
       property_before_start, field<path..., options, &recording::MessageOptions::body_frame>()},
      {"camera-frame-id", "Camera frame id", "Name of the camera's optical coordinate frame in the messages",
       property_before_start, field<path..., options, &recording::MessageOptions::camera_frame>()},
      {"grid-resolution", "Grid resolution", grid_resolution, property_before_start,
       field<path..., options, &recording::MessageOptions::grid_resolution>(0.01, 10)},
  }};
}
/// What messages are made with, calibration included. Returns nothing after posting an error.
inline std::optional<recording::MessageOptions> read_options(gpointer element,
                                                             const MessageSettings& settings) {
  recording::MessageOptions options = settings.options;
  const auto flaw = read_calibration(settings.camera_info, settings.mount, options.camera, options.mount);
  if (!flaw)
    return options;
  post_error(element, *flaw);
  return std::nullopt;
}

/// Reads a buffer. The data is valid until the reader is destroyed.
class FrameReader {
 public:
  FrameReader(GstBuffer* buffer, PictureKind kind, const char* source)
      : kind_(kind), picture_(kind == PictureKind::raw ? nullptr : buffer, GST_MAP_READ),
        estimate_(buffer, source), metric_(buffer, source) {}

  /// Returns false after posting an error: an H.264 picture refers to a later one (B-frame), which `players`
  /// of messages do not show. Warns once of invalid metadata, which are not `used`.
  bool check(gpointer element, const char* players, const char* used, bool& warned) const {
    if (recording::inspect_h264(frame(0).video).b_slice) {
      GST_ELEMENT_ERROR(
          element, STREAM, FORMAT,
          ("The H.264 video has B-frames, which %s do not show. Set bframes=0 on x264enc, or the "
           "equivalent property of another encoder.",
           players),
          (nullptr));
      return false;
    }
    const char* flaw = estimate_.error() ? estimate_.error() : metric_.error();
    if (flaw && !std::exchange(warned, true))
      GST_ELEMENT_WARNING(element, STREAM, FORMAT, ("Invalid terrain metadata is not %s: %s.", used, flaw),
                          (nullptr));
    return true;
  }
  bool has_estimate() const { return static_cast<bool>(estimate_); }
  /// For the log.
  const char* content() const {
    return metric_ && estimate_ ? "with terrain and metres" : estimate_ ? "with terrain" : "without terrain";
  }
  recording::MessageFrame frame(std::uint64_t time) const {
    recording::MessageFrame frame;
    frame.time = time;
    frame.estimate = estimate_ ? &estimate_.estimate() : nullptr;
    frame.metric = metric_ ? &metric_.metric() : nullptr;
    if (picture_.data())
      (kind_ == PictureKind::h264 ? frame.video : frame.picture) =
          recording::ByteView(picture_.data(), picture_.size());
    return frame;
  }

 private:
  PictureKind kind_;
  MappedBuffer picture_; ///< not mapped if it is raw
  EstimateReader estimate_;
  MetricReader metric_;
};

} // namespace terrainseg
