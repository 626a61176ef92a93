// SPDX-License-Identifier: LGPL-2.1-or-later
// GStreamer's video frames as the core sees them.
#pragma once

#include <gst/video/video.h>

#include <optional>
#include <string>

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

/// `sink` and `src` of an element that takes and gives those formats.
void add_video_pad_templates(GstElementClass* element_class);

/// Range and matrix as the core tells them apart; what GStreamer does not know is taken as it guesses itself.
Colorimetry colorimetry_of(const GstVideoInfo& info);

/// Views of a mapped frame of a native format; valid while it is mapped.
Frame view_of(const GstVideoFrame& frame);
MutableFrame mutable_view_of(const GstVideoFrame& frame);

/// Why `buffer` does not hold a frame of `info`: shorter than its caps or its GstVideoMeta say, or another
/// picture altogether. Nothing when it does. Maps nothing, so that it is cheap.
std::optional<std::string> describe_unusable(const GstVideoInfo& info, GstBuffer* buffer);

/// Maps a frame for as long as it lives.
class MappedFrame {
 public:
  /// Check describe_unusable() before.
  MappedFrame(const GstVideoInfo& info, GstBuffer* buffer, GstMapFlags flags);
  ~MappedFrame();
  MappedFrame(const MappedFrame&) = delete;
  MappedFrame& operator=(const MappedFrame&) = delete;
  /// False when the memory is not accessible, or a plane is scattered over several memories.
  explicit operator bool() const { return usable_; }
  const GstVideoFrame& operator*() const { return frame_; }
  const GstVideoFrame* operator->() const { return &frame_; }

 private:
  GstVideoFrame frame_{};
  bool mapped_ = false, usable_ = false;
};

} // namespace terrainseg
