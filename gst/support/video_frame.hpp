// SPDX-License-Identifier: LGPL-2.1-or-later
// Converts GStreamer's video frames to the core's.
#pragma once

#include <gst/base/gstbasetransform.h>
#include <gst/video/video.h>

#include <optional>
#include <string>

#include "support/buffers.hpp"
#include "terrainseg/frame.hpp"

/// Caps fields after the name of each natively supported format. 32767 is the core's maximum side.
#define TERRAINSEG_VIDEO_FIELDS                                                                              \
  ", format = (string) { I420, YV12, NV12, NV21, Y42B, Y444, YUY2, UYVY, RGB, BGR, RGBx, BGRx, xRGB, xBGR, " \
  "RGBA, BGRA, ARGB, ABGR, NV16, NV61, NV24, YVYU, VYUY, GRAY8, GRAY16_LE, P010_10LE, I420_10LE, "           \
  "I422_10LE }, width = (int) [ 1, 32767 ], height = (int) [ 1, 32767 ], framerate = (fraction) [ 0, max ]"
#define TERRAINSEG_VIDEO_CAPS "video/x-raw" TERRAINSEG_VIDEO_FIELDS
/// The same in DMABuf memory; a format without a modifier is linear there.
#define TERRAINSEG_DMABUF_CAPS "video/x-raw(memory:DMABuf)" TERRAINSEG_VIDEO_FIELDS

namespace terrainseg {

/// Of no format and size.
inline GstVideoInfo no_video() noexcept {
  GstVideoInfo info;
  gst_video_info_init(&info);
  return info;
}

/// Returns nothing for a format that is not in TERRAINSEG_VIDEO_CAPS.
std::optional<PixelFormat> pixel_format_of(GstVideoFormat format);

/// Adds pads `sink` and `src` for those formats, in either memory.
void add_video_pad_templates(GstElementClass* element_class);

/// gst_video_info_from_caps(), which forgets that the range is full where the caps name no matrix, as
/// decoders of many cameras do; this keeps it.
bool read_video_info(GstVideoInfo& info, const GstCaps* caps);
/// Converts range and matrix; unknown values are guessed as GStreamer does.
Colorimetry colorimetry_of(const GstVideoInfo& info);

/// Whether a stream with these caps may have progressive frames. In mixed streams each buffer has a flag.
bool may_be_progressive(const GstVideoInfo& info);
/// Whether the picture in `buffer` is a frame and not two fields.
bool is_progressive(const GstVideoInfo& info, const GstBuffer* buffer);
/// Posts an error: `element` does not support interlaced pictures. `where` is a debug detail. Returns
/// GST_FLOW_ERROR.
GstFlowReturn report_interlaced(gpointer element, const char* where);

/// GstBaseTransform::propose_allocation: the answer of the base class, which asks downstream. Any stride and
/// offset are supported. Crops must be in the pixels, because GstVideoCropMeta is not supported.
template <gpointer& parent_class>
gboolean propose_video_allocation(GstBaseTransform* transform, GstQuery* decide_query, GstQuery* query) {
  if (!GST_BASE_TRANSFORM_CLASS(parent_class)->propose_allocation(transform, decide_query, query))
    return FALSE;
  guint index = 0;
  while (gst_query_find_allocation_meta(query, GST_VIDEO_CROP_META_API_TYPE, &index))
    gst_query_remove_nth_allocation_meta(query, index);
  if (!gst_query_find_allocation_meta(query, GST_VIDEO_META_API_TYPE, nullptr))
    gst_query_add_allocation_meta(query, GST_VIDEO_META_API_TYPE, nullptr);
  return TRUE;
}

/// Maps a frame for its lifetime. Validates caps and GstVideoMeta against the mapped memory. The frame has
/// the size of `info`; if a GstVideoMeta describes a larger picture, it is the upper left part.
class MappedFrame {
 public:
  MappedFrame(const GstVideoInfo& info, GstBuffer* buffer, GstMapFlags flags);
  ~MappedFrame();
  MappedFrame(const MappedFrame&) = delete;
  MappedFrame& operator=(const MappedFrame&) = delete;

  /// Returns false if the frame cannot be read: see error().
  explicit operator bool() const { return error_.empty(); }
  /// The error as the end of a sentence; empty if the buffer holds a frame of that size and format.
  const std::string& error() const { return error_; }
  const GstVideoFrame& frame() const { return frame_; }
  /// For a native format, and for GRAY8, whose only plane is the first.
  Frame view() const;
  MutableFrame mutable_view() const;

 private:
  GstVideoFrame frame_{};
  bool mapped_ = false;
  std::string error_;
};

/// Posts an error: `frame`, mapped from `buffer`, cannot be read. Returns GST_FLOW_ERROR.
GstFlowReturn report_unusable(gpointer element, GstBuffer* buffer, const MappedFrame& frame);

/// A GRAY8 picture (a mask) with a GstVideoMeta, referenced and mapped for reading for its lifetime.
class MappedMask {
 public:
  explicit MappedMask(GstBuffer* buffer);
  /// nullptr if the mask can be read.
  const char* error() const { return error_; }
  GrayView view() const;
  GstBuffer* buffer() const { return buffer_.get(); }

 private:
  OwnedBuffer buffer_;
  std::optional<MappedFrame> frame_;
  const char* error_ = nullptr;
};

} // namespace terrainseg
