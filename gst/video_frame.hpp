// SPDX-License-Identifier: LGPL-2.1-or-later
// GStreamer's video frames as the core sees them.
#pragma once

#include <gst/video/video.h>

#include <optional>

#include "terrainseg/frame.hpp"

/// Caps of every format that is read and drawn natively. 32767: the core's longest side.
#define TERRAINSEG_VIDEO_CAPS                                                                                \
  "video/x-raw, format = (string) { I420, YV12, NV12, NV21, Y42B, Y444, YUY2, UYVY, RGB, BGR, RGBx, BGRx, "  \
  "xRGB, xBGR, RGBA, BGRA, ARGB, ABGR }, width = (int) [ 1, 32767 ], height = (int) [ 1, 32767 ], "          \
  "framerate = (fraction) [ 0, max ]"

namespace terrainseg {

/// Nothing for a format that TERRAINSEG_VIDEO_CAPS does not name.
std::optional<PixelFormat> pixel_format_of(GstVideoFormat format);
GstVideoFormat gst_format_of(PixelFormat format);

/// Range and matrix as the core tells them apart; what GStreamer does not know is taken as it guesses itself.
Colorimetry colorimetry_of(const GstVideoInfo& info);

/// Views of a mapped frame of a native format; valid while it is mapped.
Frame view_of(const GstVideoFrame& frame);
MutableFrame mutable_view_of(const GstVideoFrame& frame);

/// Maps a frame for as long as it lives.
class MappedFrame {
 public:
  MappedFrame(const GstVideoInfo& info, GstBuffer* buffer, GstMapFlags flags) {
    // NO_REF: the caller holds the buffer, and a second reference would make it unwritable.
    mapped_ = gst_video_frame_map(
        &frame_, &info, buffer,
        static_cast<GstMapFlags>(static_cast<int>(flags) | GST_VIDEO_FRAME_MAP_FLAG_NO_REF));
  }
  ~MappedFrame() {
    if (mapped_)
      gst_video_frame_unmap(&frame_);
  }
  MappedFrame(const MappedFrame&) = delete;
  MappedFrame& operator=(const MappedFrame&) = delete;
  /// False when the buffer is shorter than its caps say, or not accessible.
  explicit operator bool() const { return mapped_; }
  const GstVideoFrame& operator*() const { return frame_; }
  const GstVideoFrame* operator->() const { return &frame_; }

 private:
  GstVideoFrame frame_{};
  bool mapped_ = false;
};

} // namespace terrainseg
