// SPDX-License-Identifier: LGPL-2.1-or-later
#include "recording/frame_reader.hpp"

namespace terrainseg {

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
