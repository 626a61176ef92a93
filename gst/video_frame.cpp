// SPDX-License-Identifier: LGPL-2.1-or-later
#include "video_frame.hpp"

#include <iterator>

namespace terrainseg {
namespace {

// In the order of PixelFormat.
constexpr GstVideoFormat formats[pixel_format_count] = {
    GST_VIDEO_FORMAT_I420, GST_VIDEO_FORMAT_YV12, GST_VIDEO_FORMAT_NV12, GST_VIDEO_FORMAT_NV21,
    GST_VIDEO_FORMAT_Y42B, GST_VIDEO_FORMAT_Y444, GST_VIDEO_FORMAT_YUY2, GST_VIDEO_FORMAT_UYVY,
    GST_VIDEO_FORMAT_RGB,  GST_VIDEO_FORMAT_BGR,  GST_VIDEO_FORMAT_RGBx, GST_VIDEO_FORMAT_BGRx,
    GST_VIDEO_FORMAT_xRGB, GST_VIDEO_FORMAT_xBGR, GST_VIDEO_FORMAT_RGBA, GST_VIDEO_FORMAT_BGRA,
    GST_VIDEO_FORMAT_ARGB, GST_VIDEO_FORMAT_ABGR};

ColorMatrix matrix_of(const GstVideoInfo& info) {
  switch (info.colorimetry.matrix) {
  case GST_VIDEO_COLOR_MATRIX_BT709:
    return ColorMatrix::bt709;
  case GST_VIDEO_COLOR_MATRIX_BT2020:
    return ColorMatrix::bt2020;
  case GST_VIDEO_COLOR_MATRIX_UNKNOWN: // caps name no matrix: the usual one for the size
    return GST_VIDEO_INFO_HEIGHT(&info) > 576 ? ColorMatrix::bt709 : ColorMatrix::bt601;
  default: // FCC and SMPTE 240M differ from 601 and 709 by less than a learned variance
    return info.colorimetry.matrix == GST_VIDEO_COLOR_MATRIX_SMPTE240M ? ColorMatrix::bt709
                                                                       : ColorMatrix::bt601;
  }
}

template <class View> View make_view(const GstVideoFrame& frame) {
  View view;
  view.format = pixel_format_of(GST_VIDEO_FRAME_FORMAT(&frame)).value_or(PixelFormat::I420);
  view.width = GST_VIDEO_FRAME_WIDTH(&frame);
  view.height = GST_VIDEO_FRAME_HEIGHT(&frame);
  view.colorimetry = colorimetry_of(frame.info);
  for (unsigned i = 0; i < GST_VIDEO_FRAME_N_PLANES(&frame) && i < view.planes.size(); ++i)
    view.planes[i] = {static_cast<std::uint8_t*>(GST_VIDEO_FRAME_PLANE_DATA(&frame, i)),
                      GST_VIDEO_FRAME_PLANE_STRIDE(&frame, i)};
  return view;
}

} // namespace

std::optional<PixelFormat> pixel_format_of(GstVideoFormat format) {
  for (int i = 0; i < pixel_format_count; ++i)
    if (formats[i] == format)
      return static_cast<PixelFormat>(i);
  return std::nullopt;
}

GstVideoFormat gst_format_of(PixelFormat format) {
  return formats[static_cast<int>(format)];
}

Colorimetry colorimetry_of(const GstVideoInfo& info) {
  const bool rgb = GST_VIDEO_INFO_IS_RGB(&info);
  const bool full = info.colorimetry.range == GST_VIDEO_COLOR_RANGE_0_255 ||
                    (rgb && info.colorimetry.range == GST_VIDEO_COLOR_RANGE_UNKNOWN);
  // The matrix means nothing for RGB; one value for it keeps equal colour spaces equal.
  return {full ? ColorRange::full : ColorRange::limited, rgb ? ColorMatrix::bt601 : matrix_of(info)};
}

Frame view_of(const GstVideoFrame& frame) {
  Frame view = make_view<Frame>(frame);
  if (GST_BUFFER_PTS_IS_VALID(frame.buffer) && GST_BUFFER_PTS(frame.buffer) <= G_MAXINT64)
    view.pts = static_cast<std::int64_t>(GST_BUFFER_PTS(frame.buffer));
  return view;
}

MutableFrame mutable_view_of(const GstVideoFrame& frame) {
  return make_view<MutableFrame>(frame);
}

} // namespace terrainseg
