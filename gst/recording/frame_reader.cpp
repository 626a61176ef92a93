// SPDX-License-Identifier: LGPL-2.1-or-later
#include "recording/frame_reader.hpp"

#include <gst/video/video.h>

#include "support/name_property.hpp"

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

void init_message_sink_class(gpointer klass, const MessageSinkFunctions& functions, const char* name,
                             const char* classification, const char* description, guint source_id) {
  GObjectClass* object_class = G_OBJECT_CLASS(klass);
  object_class->set_property = functions.set_property;
  object_class->get_property = functions.get_property;
  object_class->finalize = functions.finalize;
  NameProperty::install_source(object_class, source_id);
  GstElementClass* element_class = GST_ELEMENT_CLASS(klass);
  gst_element_class_add_static_pad_template(element_class, &sink_template);
  gst_element_class_set_static_metadata(element_class, name, classification, description,
                                        "The terrainseg developers");
  GstBaseSinkClass* sink_class = GST_BASE_SINK_CLASS(klass);
  sink_class->start = functions.start;
  sink_class->stop = functions.stop;
  sink_class->set_caps = functions.set_caps;
  sink_class->render = functions.render;
  sink_class->propose_allocation = propose_allocation;
}

PictureKind kind_of(const GstCaps* caps) {
  const GstStructure* structure = gst_caps_get_structure(caps, 0);
  if (gst_structure_has_name(structure, "video/x-h264"))
    return PictureKind::h264;
  return gst_structure_has_name(structure, "image/jpeg") ? PictureKind::jpeg : PictureKind::raw;
}

FrameReader::FrameReader(GstBuffer* buffer, PictureKind kind, const char* source)
    : buffer_(buffer), kind_(kind), estimate_(buffer, source), metric_(buffer, source) {
  mapped_ = kind != PictureKind::raw && gst_buffer_map(buffer, &map_, GST_MAP_READ);
}

FrameReader::~FrameReader() {
  if (mapped_)
    gst_buffer_unmap(buffer_, &map_);
}

recording::MessageFrame FrameReader::frame(std::uint64_t time) const {
  recording::MessageFrame frame;
  frame.time = time;
  frame.estimate = estimate_ ? &estimate_.estimate() : nullptr;
  frame.metric = metric_ ? &metric_.metric() : nullptr;
  if (mapped_)
    (kind_ == PictureKind::h264 ? frame.video : frame.picture) = {map_.data, map_.size};
  return frame;
}

} // namespace terrainseg
