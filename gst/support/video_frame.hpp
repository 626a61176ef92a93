// SPDX-License-Identifier: LGPL-2.1-or-later
// GStreamer's video frames as the core sees them.
#pragma once

#include <gst/base/gstbasetransform.h>
#include <gst/video/video.h>

#include <optional>
#include <string>

#include "terrainseg/frame.hpp"

/// What follows the name in caps of every format that is read and drawn natively. 32767: the core's longest
/// side.
#define TERRAINSEG_VIDEO_FIELDS                                                                              \
  ", format = (string) { I420, YV12, NV12, NV21, Y42B, Y444, YUY2, UYVY, RGB, BGR, RGBx, BGRx, xRGB, xBGR, " \
  "RGBA, BGRA, ARGB, ABGR, NV16, NV61, NV24, YVYU, VYUY, GRAY8, GRAY16_LE, P010_10LE, I420_10LE, "           \
  "I422_10LE }, width = (int) [ 1, 32767 ], height = (int) [ 1, 32767 ], framerate = (fraction) [ 0, max ]"
#define TERRAINSEG_VIDEO_CAPS "video/x-raw" TERRAINSEG_VIDEO_FIELDS
/// The same in memory that devices share; a format without a modifier is linear there.
#define TERRAINSEG_DMABUF_CAPS "video/x-raw(memory:DMABuf)" TERRAINSEG_VIDEO_FIELDS

namespace terrainseg {

/// Nothing for a format that TERRAINSEG_VIDEO_CAPS does not name.
std::optional<PixelFormat> pixel_format_of(GstVideoFormat format);
/// The other way round: tests go through all formats by it.
GstVideoFormat gst_format_of(PixelFormat format);

/// `sink` and `src` of an element that takes and gives those formats, in either memory.
void add_video_pad_templates(GstElementClass* element_class);

/// Range and matrix as the core tells them apart; what GStreamer does not know is taken as it guesses
/// itself.
Colorimetry colorimetry_of(const GstVideoInfo& info);

/// Whether a stream of these caps may hold progressive frames: of mixed ones each buffer says it.
bool may_be_progressive(const GstVideoInfo& info);
/// Whether the picture in `buffer` is one frame and not two fields.
bool is_progressive(const GstVideoInfo& info, const GstBuffer* buffer);
/// Posts that `element` cannot take two fields in one picture; `where` tells developers how it knows.
void report_interlaced(gpointer element, const char* where);

/// GstBaseTransform::propose_allocation: what the class above answers, which asks downstream; any stride and
/// offset will do, and a crop has to be made in the pixels, because GstVideoCropMeta is not honoured here.
gboolean propose_video_allocation(gpointer parent_class, GstBaseTransform* transform, GstQuery* decide_query,
                                  GstQuery* query);

/// The one way from a buffer to pixels: maps a frame for as long as it lives, and trusts neither its caps
/// nor its GstVideoMeta but the mapped memory alone. The frame has the size of `info`, also where a
/// GstVideoMeta describes a larger picture: then it is that one's upper left part.
class MappedFrame {
 public:
  MappedFrame(const GstVideoInfo& info, GstBuffer* buffer, GstMapFlags flags);
  ~MappedFrame();
  MappedFrame(const MappedFrame&) = delete;
  MappedFrame& operator=(const MappedFrame&) = delete;

  /// False when the frame cannot be read: see error().
  explicit operator bool() const { return error_.empty(); }
  /// Why the buffer does not hold a frame of that size and format, as the rest of a sentence; empty when it
  /// does.
  const std::string& error() const { return error_; }
  const GstVideoFrame& frame() const { return frame_; }
  /// Of a native format, and GRAY8's only plane as the first.
  Frame view() const;
  MutableFrame mutable_view() const;

 private:
  GstVideoFrame frame_{};
  bool mapped_ = false;
  std::string error_;
};

/// Posts that `frame`, mapped from `buffer`, cannot be read.
void report_unusable(gpointer element, GstBuffer* buffer, const MappedFrame& frame);

/// A GRAY8 picture that its GstVideoMeta describes (a mask), mapped for reading as long as it lives.
class MappedMask {
 public:
  explicit MappedMask(GstBuffer* buffer);
  /// nullptr when the mask can be read.
  const char* error() const { return error_; }
  GrayView view() const;

 private:
  std::optional<MappedFrame> frame_;
  const char* error_ = nullptr;
};

} // namespace terrainseg
