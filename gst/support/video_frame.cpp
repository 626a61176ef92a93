// SPDX-License-Identifier: LGPL-2.1-or-later
#include "support/video_frame.hpp"

#include <algorithm>
#include <cstdlib>
#include <iterator>
#include <utility>

#include "support/element.hpp"
#include "terrainseg/estimate.hpp"

namespace terrainseg {
namespace {

// In the order of PixelFormat.
constexpr GstVideoFormat formats[pixel_format_count] = {
    GST_VIDEO_FORMAT_I420,      GST_VIDEO_FORMAT_YV12,      GST_VIDEO_FORMAT_NV12,
    GST_VIDEO_FORMAT_NV21,      GST_VIDEO_FORMAT_Y42B,      GST_VIDEO_FORMAT_Y444,
    GST_VIDEO_FORMAT_YUY2,      GST_VIDEO_FORMAT_UYVY,      GST_VIDEO_FORMAT_RGB,
    GST_VIDEO_FORMAT_BGR,       GST_VIDEO_FORMAT_RGBx,      GST_VIDEO_FORMAT_BGRx,
    GST_VIDEO_FORMAT_xRGB,      GST_VIDEO_FORMAT_xBGR,      GST_VIDEO_FORMAT_RGBA,
    GST_VIDEO_FORMAT_BGRA,      GST_VIDEO_FORMAT_ARGB,      GST_VIDEO_FORMAT_ABGR,
    GST_VIDEO_FORMAT_NV16,      GST_VIDEO_FORMAT_NV61,      GST_VIDEO_FORMAT_NV24,
    GST_VIDEO_FORMAT_YVYU,      GST_VIDEO_FORMAT_VYUY,      GST_VIDEO_FORMAT_GRAY8,
    GST_VIDEO_FORMAT_GRAY16_LE, GST_VIDEO_FORMAT_P010_10LE, GST_VIDEO_FORMAT_I420_10LE,
    GST_VIDEO_FORMAT_I422_10LE};

ColorMatrix matrix_of(const GstVideoInfo& info) {
  switch (info.colorimetry.matrix) {
  // FCC and SMPTE 240M differ from 601 and 709 by less than a learned variance.
  case GST_VIDEO_COLOR_MATRIX_BT709:
  case GST_VIDEO_COLOR_MATRIX_SMPTE240M:
    return ColorMatrix::bt709;
  case GST_VIDEO_COLOR_MATRIX_BT2020:
    return ColorMatrix::bt2020;
  case GST_VIDEO_COLOR_MATRIX_UNKNOWN: // caps without a matrix: the usual one for the size
    return GST_VIDEO_INFO_HEIGHT(&info) > 576 ? ColorMatrix::bt709 : ColorMatrix::bt601;
  default:
    return ColorMatrix::bt601;
  }
}

} // namespace

std::optional<PixelFormat> pixel_format_of(GstVideoFormat format) {
  const auto* found = std::ranges::find(formats, format);
  return found == std::end(formats) ? std::nullopt : std::optional(static_cast<PixelFormat>(found - formats));
}

bool read_video_info(GstVideoInfo& info, const GstCaps* caps) {
  if (!gst_video_info_from_caps(&info, caps))
    return false;
  const gchar* text = gst_structure_get_string(gst_caps_get_structure(caps, 0), "colorimetry");
  GstVideoColorimetry named;
  if (text && gst_video_colorimetry_from_string(&named, text) &&
      named.matrix == GST_VIDEO_COLOR_MATRIX_UNKNOWN && named.range == GST_VIDEO_COLOR_RANGE_0_255)
    info.colorimetry.range = named.range;
  return true;
}

Colorimetry colorimetry_of(const GstVideoInfo& info) {
  const bool rgb = GST_VIDEO_INFO_IS_RGB(&info);
  const bool full = info.colorimetry.range == GST_VIDEO_COLOR_RANGE_0_255 ||
                    (rgb && info.colorimetry.range == GST_VIDEO_COLOR_RANGE_UNKNOWN);
  // RGB has no matrix; one value keeps equal colour spaces equal.
  return {full ? ColorRange::full : ColorRange::limited, rgb ? ColorMatrix::bt601 : matrix_of(info)};
}

namespace {

/// Memory that a picture needs in a plane.
struct PlaneNeed {
  std::uint64_t row_bytes = 0, rows = 0;
};

PlaneNeed need_of(const GstVideoInfo& info, guint plane) {
  gint components[GST_VIDEO_MAX_COMPONENTS];
  gst_video_format_info_component(info.finfo, plane, components);
  PlaneNeed need;
  for (gint component : components) {
    if (component < 0)
      break;
    const std::uint64_t samples = GST_VIDEO_INFO_COMP_WIDTH(&info, component);
    const std::uint64_t step = GST_VIDEO_INFO_COMP_PSTRIDE(&info, component);
    need.row_bytes = std::max(need.row_bytes, samples * step); // whole pixels: terrainseg::row_bytes()
    need.rows = GST_VIDEO_INFO_COMP_HEIGHT(&info, component);
  }
  return need;
}

/// Whether a plane is inside `size` bytes if its first row begins at `offset`. With a negative stride the
/// other rows are before the first one.
bool lies_in(const PlaneNeed& need, gint stride, std::uint64_t offset, std::uint64_t size) {
  const auto step = static_cast<std::uint64_t>(std::abs(std::int64_t{stride}));
  if (need.rows > 1 && step < need.row_bytes)
    return false;
  const std::uint64_t reach = step * (need.rows - 1); // below 2^31 * 2^31
  if (stride < 0 && offset < reach)
    return false;
  const std::uint64_t span = need.row_bytes + (stride > 0 ? reach : 0);
  return offset <= size && span <= size - offset;
}

/// The error in `buffer` that can be found before mapping; empty if there is none.
std::string describe_unusable(const GstVideoInfo& info, GstBuffer* buffer) {
  const gsize size = gst_buffer_get_size(buffer);
  const GstVideoMeta* meta = gst_buffer_get_video_meta(buffer);
  if (!meta && size < GST_VIDEO_INFO_SIZE(&info))
    return "it has " + std::to_string(size) + " bytes and its caps need " +
           std::to_string(GST_VIDEO_INFO_SIZE(&info));
  if (meta && meta->format != GST_VIDEO_INFO_FORMAT(&info))
    return std::string("its GstVideoMeta says ") + gst_video_format_to_string(meta->format) +
           " and its caps say " + gst_video_format_to_string(GST_VIDEO_INFO_FORMAT(&info));
  if (meta && (meta->width < static_cast<guint>(GST_VIDEO_INFO_WIDTH(&info)) ||
               meta->height < static_cast<guint>(GST_VIDEO_INFO_HEIGHT(&info))))
    return "its GstVideoMeta says " + std::to_string(meta->width) + "x" + std::to_string(meta->height) +
           ", less than its caps say";
  if (meta && meta->n_planes != GST_VIDEO_INFO_N_PLANES(&info))
    return "its GstVideoMeta has " + std::to_string(meta->n_planes) + " planes";
  for (guint plane = 0; plane < GST_VIDEO_INFO_N_PLANES(&info); ++plane) {
    const gint stride = meta ? meta->stride[plane] : GST_VIDEO_INFO_PLANE_STRIDE(&info, plane);
    const gsize offset = meta ? meta->offset[plane] : GST_VIDEO_INFO_PLANE_OFFSET(&info, plane);
    if (!lies_in(need_of(info, plane), stride, offset, size))
      return "plane " + std::to_string(plane) + " (stride " + std::to_string(stride) + ", offset " +
             std::to_string(offset) + ") does not lie in its " + std::to_string(size) + " bytes";
  }
  return {};
}

/// Whether the mapped memory has all rows of `info`. With a GstVideoMeta each plane is mapped only from its
/// start to the end of that memory.
bool lies_in_maps(const GstVideoInfo& info, const GstVideoFrame& frame) {
  for (guint plane = 0; plane < GST_VIDEO_INFO_N_PLANES(&info); ++plane) {
    const GstMapInfo& map = frame.map[frame.meta ? plane : 0];
    const auto* start = static_cast<const guint8*>(GST_VIDEO_FRAME_PLANE_DATA(&frame, plane));
    if (!lies_in(need_of(info, plane), GST_VIDEO_FRAME_PLANE_STRIDE(&frame, plane),
                 static_cast<std::uint64_t>(start - map.data), map.size))
      return false;
  }
  return true;
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

void add_video_pad_templates(GstElementClass* element_class) {
  // System memory first: elements that support both then choose it.
  for (const auto& [name, direction] : {std::pair{"sink", GST_PAD_SINK}, {"src", GST_PAD_SRC}})
    add_pad_template(element_class, name, direction, TERRAINSEG_VIDEO_CAPS "; " TERRAINSEG_DMABUF_CAPS);
}

bool may_be_progressive(const GstVideoInfo& info) {
  const GstVideoInterlaceMode mode = GST_VIDEO_INFO_INTERLACE_MODE(&info);
  return mode == GST_VIDEO_INTERLACE_MODE_PROGRESSIVE || mode == GST_VIDEO_INTERLACE_MODE_MIXED;
}

bool is_progressive(const GstVideoInfo& info, const GstBuffer* buffer) {
  return !GST_VIDEO_INFO_IS_INTERLACED(&info) ||
         !GST_BUFFER_FLAG_IS_SET(buffer, GST_VIDEO_BUFFER_FLAG_INTERLACED);
}

GstFlowReturn report_interlaced(gpointer element, const char* where) {
  GST_ELEMENT_ERROR(
      GST_ELEMENT(element), STREAM, WRONG_TYPE,
      ("%s needs progressive video: put \"deinterlace\" before it.", name_of_kind(GST_ELEMENT(element))),
      ("%s", where));
  return GST_FLOW_ERROR;
}

MappedFrame::MappedFrame(const GstVideoInfo& info, GstBuffer* buffer, GstMapFlags flags)
    : error_(describe_unusable(info, buffer)) {
  if (!error_.empty())
    return;
  // NO_REF: the caller holds the buffer; a second reference would make it read-only.
  mapped_ = gst_video_frame_map(
      &frame_, &info, buffer,
      static_cast<GstMapFlags>(static_cast<int>(flags) | GST_VIDEO_FRAME_MAP_FLAG_NO_REF));
  if (!mapped_)
    error_ = "its memory cannot be accessed";
  else if (!lies_in_maps(info, frame_))
    error_ = "a plane is scattered over several memories";
  frame_.info.width =
      GST_VIDEO_INFO_WIDTH(&info); // not from the GstVideoMeta, which may describe a larger picture
  frame_.info.height = GST_VIDEO_INFO_HEIGHT(&info);
}

MappedFrame::~MappedFrame() {
  if (mapped_)
    gst_video_frame_unmap(&frame_);
}

Frame MappedFrame::view() const {
  Frame view = make_view<Frame>(frame_);
  if (GST_BUFFER_PTS_IS_VALID(frame_.buffer) && GST_BUFFER_PTS(frame_.buffer) <= G_MAXINT64)
    view.pts = static_cast<std::int64_t>(GST_BUFFER_PTS(frame_.buffer));
  return view;
}

MutableFrame MappedFrame::mutable_view() const {
  return make_view<MutableFrame>(frame_);
}

GstFlowReturn report_unusable(gpointer element, GstBuffer* buffer, const MappedFrame& frame) {
  GST_ELEMENT_ERROR(GST_ELEMENT(element), STREAM, FORMAT,
                    ("A buffer does not contain a complete frame: %s.", frame.error().c_str()),
                    ("buffer %" GST_PTR_FORMAT ": %s", printable(buffer), frame.error().c_str()));
  return GST_FLOW_ERROR;
}

MappedMask::MappedMask(GstBuffer* buffer) : buffer_(gst_buffer_ref(buffer)) {
  const GstVideoMeta* layout = gst_buffer_get_video_meta(buffer);
  GstVideoInfo info;
  if (!layout || layout->format != GST_VIDEO_FORMAT_GRAY8)
    error_ = "the mask is not GRAY8 with a GstVideoMeta";
  else if (layout->width < 1 || layout->height < 1 || layout->width > longest_picture_side ||
           layout->height > longest_picture_side)
    error_ = "the mask's sides must be 1..32767";
  else if (layout->stride[0] < 0 || static_cast<guint>(layout->stride[0]) < layout->width)
    error_ = "the mask's rows overlap or run backwards";
  else if (!gst_video_info_set_format(&info, GST_VIDEO_FORMAT_GRAY8, layout->width, layout->height) ||
           !frame_.emplace(info, buffer, GST_MAP_READ))
    error_ = "the mask's buffer is shorter than its GstVideoMeta says, or has several memories";
  if (error_)
    frame_.reset();
}

GrayView MappedMask::view() const {
  if (!frame_)
    return {};
  const Frame view = frame_->view();
  return {view.planes[0], view.width, view.height};
}

} // namespace terrainseg
