// SPDX-License-Identifier: LGPL-2.1-or-later
// What the sinks of recordings and of ROS 2 share: the class, and reading a buffer with its metadata, metres
// and encoded picture.
#pragma once

#include <gst/base/gstbasesink.h>

#include "recording/terrain_messages.hpp"
#include "support/estimate_meta.hpp"
#include "support/metric_meta.hpp"

namespace terrainseg {

enum class PictureKind : std::uint8_t { raw, h264, jpeg };
PictureKind kind_of(const GstCaps* caps);

/// Virtual functions of such a sink.
struct MessageSinkFunctions {
  void (*set_property)(GObject*, guint, const GValue*, GParamSpec*);
  void (*get_property)(GObject*, guint, GValue*, GParamSpec*);
  void (*finalize)(GObject*);
  gboolean (*start)(GstBaseSink*);
  gboolean (*stop)(GstBaseSink*);
  gboolean (*set_caps)(GstBaseSink*, GstCaps*);
  GstFlowReturn (*render)(GstBaseSink*, GstBuffer*);
};
/// Sets the functions, the pad for raw, H.264 and JPEG video, the metadata of the element (static strings),
/// and the property `source` with the id `source_id`. Upstream need not map or copy pixels: none are read.
void init_message_sink_class(gpointer klass, const MessageSinkFunctions& functions, const char* name,
                             const char* classification, const char* description, guint source_id);

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
