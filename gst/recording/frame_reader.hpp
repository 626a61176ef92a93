// SPDX-License-Identifier: LGPL-2.1-or-later
// Reads metadata, metres and an encoded picture from a buffer, for the sinks of recordings and ROS 2.
#pragma once

#include <gst/gst.h>

#include "recording/terrain_messages.hpp"
#include "support/estimate_meta.hpp"
#include "support/metric_meta.hpp"

namespace terrainseg {

enum class PictureKind : std::uint8_t { raw, h264, jpeg };
PictureKind kind_of(const GstCaps* caps);
#define TERRAINSEG_MESSAGE_CAPS                                                                              \
  "video/x-h264, stream-format = (string) byte-stream, alignment = (string) au; image/jpeg; "                \
  "video/x-raw(ANY)"

/// Reads a buffer. The data is valid until the reader is destroyed.
class FrameReader {
 public:
  FrameReader(GstBuffer* buffer, PictureKind kind, const char* source);
  ~FrameReader();
  FrameReader(const FrameReader&) = delete;
  FrameReader& operator=(const FrameReader&) = delete;

  /// The error in the metadata, or nullptr.
  const char* flaw() const { return estimate_.error() ? estimate_.error() : metric_.error(); }
  bool has_estimate() const { return static_cast<bool>(estimate_); }
  bool has_metric() const { return static_cast<bool>(metric_); }
  /// Whether an H.264 picture refers to a later one (B-frame), which players of messages do not show.
  bool has_b_frame() const { return recording::inspect_h264(frame(0).video).b_slice; }
  recording::MessageFrame frame(std::uint64_t time) const;

 private:
  GstBuffer* buffer_;
  PictureKind kind_;
  GstMapInfo map_{};
  bool mapped_ = false;
  EstimateReader estimate_;
  MetricReader metric_;
};

} // namespace terrainseg
