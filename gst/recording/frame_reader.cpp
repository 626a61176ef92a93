// SPDX-License-Identifier: LGPL-2.1-or-later
#include "recording/frame_reader.hpp"

#include <gst/video/video.h>

#include "support/calibration_files.hpp"

namespace terrainseg {
namespace {

GstStaticPadTemplate sink_template = GST_STATIC_PAD_TEMPLATE(
    "sink", GST_PAD_SINK, GST_PAD_ALWAYS,
    GST_STATIC_CAPS("video/x-h264, stream-format = (string) byte-stream, alignment = (string) au; "
                    "image/jpeg; video/x-raw(ANY)"));

gboolean propose_allocation(GstBaseSink*, GstQuery* query) {
  gst_query_add_allocation_meta(query, GST_VIDEO_META_API_TYPE, nullptr);
  return TRUE;
}

} // namespace

void init_message_sink_class(gpointer klass) {
  gst_element_class_add_static_pad_template(GST_ELEMENT_CLASS(klass), &sink_template);
  GST_BASE_SINK_CLASS(klass)->propose_allocation = propose_allocation;
}

PictureKind kind_of(const GstCaps* caps) {
  const GstStructure* structure = gst_caps_get_structure(caps, 0);
  if (gst_structure_has_name(structure, "video/x-h264"))
    return PictureKind::h264;
  return gst_structure_has_name(structure, "image/jpeg") ? PictureKind::jpeg : PictureKind::raw;
}

std::optional<recording::MessageOptions> read_options(GstElement* element, const MessageSettings& settings) {
  recording::MessageOptions options;
  options.body_frame = settings.frame_id;
  options.camera_frame = settings.camera_frame_id;
  options.grid_resolution = settings.grid_resolution;
  const auto flaw = read_calibration(settings.camera_info, settings.mount, options.camera, options.mount);
  if (!flaw)
    return options;
  post_error(element, *flaw);
  return std::nullopt;
}

FrameReader::FrameReader(GstBuffer* buffer, PictureKind kind, const char* source)
    : kind_(kind), picture_(kind == PictureKind::raw ? nullptr : buffer, GST_MAP_READ),
      estimate_(buffer, source), metric_(buffer, source) {}

recording::MessageFrame FrameReader::frame(std::uint64_t time) const {
  recording::MessageFrame frame;
  frame.time = time;
  frame.estimate = estimate_ ? &estimate_.estimate() : nullptr;
  frame.metric = metric_ ? &metric_.metric() : nullptr;
  if (picture_.data())
    (kind_ == PictureKind::h264 ? frame.video : frame.picture) = {picture_.data(), picture_.size()};
  return frame;
}

} // namespace terrainseg
