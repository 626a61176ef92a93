// SPDX-License-Identifier: LGPL-2.1-or-later
#include "video_frame.hpp"

#include <algorithm>
#include <cstdlib>
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

namespace {

std::string number(gsize value) {
  return std::to_string(value);
}

/// What a picture needs of a plane.
struct PlaneNeed {
  gsize row_bytes = 0, rows = 0;
};

PlaneNeed need_of(const GstVideoInfo& info, guint plane) {
  gint components[GST_VIDEO_MAX_COMPONENTS];
  gst_video_format_info_component(info.finfo, plane, components);
  PlaneNeed need;
  for (gint component : components) {
    if (component < 0)
      break;
    const gsize samples = GST_VIDEO_INFO_COMP_WIDTH(&info, component);
    const gsize step = GST_VIDEO_INFO_COMP_PSTRIDE(&info, component);
    need.row_bytes = std::max(need.row_bytes, samples * step); // whole pixels: terrainseg::row_bytes()
    need.rows = GST_VIDEO_INFO_COMP_HEIGHT(&info, component);
  }
  return need;
}

/// Whether a plane whose first row starts `offset` bytes into `size` bytes lies in them. With a negative
/// stride the other rows lie before the first.
bool lies_in(const PlaneNeed& need, gint stride, gsize offset, gsize size) {
  const auto step = static_cast<gsize>(std::abs(static_cast<long>(stride)));
  if (need.rows > 1 && step < need.row_bytes)
    return false;
  const gsize reach = step * (need.rows - 1);
  if (stride < 0 && offset < reach)
    return false;
  const gsize span = need.row_bytes + (stride > 0 ? reach : 0);
  return offset <= size && span <= size - offset;
}

std::optional<std::string> describe_misfit(const GstVideoInfo& info, const GstVideoMeta& meta) {
  if (meta.format != GST_VIDEO_INFO_FORMAT(&info))
    return std::string("its GstVideoMeta says ") + gst_video_format_to_string(meta.format) +
           " and its caps say " + gst_video_format_to_string(GST_VIDEO_INFO_FORMAT(&info));
  if (meta.width < static_cast<guint>(GST_VIDEO_INFO_WIDTH(&info)) ||
      meta.height < static_cast<guint>(GST_VIDEO_INFO_HEIGHT(&info)))
    return "its GstVideoMeta says " + number(meta.width) + "x" + number(meta.height) +
           ", less than its caps say";
  if (meta.n_planes != GST_VIDEO_INFO_N_PLANES(&info))
    return "its GstVideoMeta has " + number(meta.n_planes) + " planes";
  return std::nullopt;
}

} // namespace

std::optional<std::string> describe_unusable(const GstVideoInfo& info, GstBuffer* buffer) {
  const gsize size = gst_buffer_get_size(buffer);
  const GstVideoMeta* meta = gst_buffer_get_video_meta(buffer);
  if (meta) {
    if (auto misfit = describe_misfit(info, *meta))
      return misfit;
  } else if (size < GST_VIDEO_INFO_SIZE(&info)) {
    return "it has " + number(size) + " bytes and its caps need " + number(GST_VIDEO_INFO_SIZE(&info));
  }
  for (guint plane = 0; plane < GST_VIDEO_INFO_N_PLANES(&info); ++plane) {
    const gint stride = meta ? meta->stride[plane] : GST_VIDEO_INFO_PLANE_STRIDE(&info, plane);
    const gsize offset = meta ? meta->offset[plane] : GST_VIDEO_INFO_PLANE_OFFSET(&info, plane);
    if (!lies_in(need_of(info, plane), stride, offset, size))
      return "plane " + number(plane) + " (stride " + std::to_string(stride) + ", offset " + number(offset) +
             ") does not lie in its " + number(size) + " bytes";
  }
  return std::nullopt;
}

void add_video_pad_templates(GstElementClass* element_class) {
  static GstStaticPadTemplate sink =
      GST_STATIC_PAD_TEMPLATE("sink", GST_PAD_SINK, GST_PAD_ALWAYS, GST_STATIC_CAPS(TERRAINSEG_VIDEO_CAPS));
  static GstStaticPadTemplate source =
      GST_STATIC_PAD_TEMPLATE("src", GST_PAD_SRC, GST_PAD_ALWAYS, GST_STATIC_CAPS(TERRAINSEG_VIDEO_CAPS));
  gst_element_class_add_static_pad_template(element_class, &sink);
  gst_element_class_add_static_pad_template(element_class, &source);
}

MappedFrame::MappedFrame(const GstVideoInfo& info, GstBuffer* buffer, GstMapFlags flags) {
  // NO_REF: the caller holds the buffer, and a second reference would make it unwritable.
  mapped_ = gst_video_frame_map(
      &frame_, &info, buffer,
      static_cast<GstMapFlags>(static_cast<int>(flags) | GST_VIDEO_FRAME_MAP_FLAG_NO_REF));
  usable_ = mapped_;
  // With a GstVideoMeta each plane is mapped from where it starts to the end of that memory only.
  for (guint plane = 0; usable_ && plane < GST_VIDEO_FRAME_N_PLANES(&frame_); ++plane) {
    const GstMapInfo& map = frame_.map[frame_.meta ? plane : 0];
    const auto* start = static_cast<const guint8*>(GST_VIDEO_FRAME_PLANE_DATA(&frame_, plane));
    usable_ = lies_in(need_of(info, plane), GST_VIDEO_FRAME_PLANE_STRIDE(&frame_, plane),
                      static_cast<gsize>(start - map.data), map.size);
  }
}

MappedFrame::~MappedFrame() {
  if (mapped_)
    gst_video_frame_unmap(&frame_);
}

} // namespace terrainseg
