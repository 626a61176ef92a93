// SPDX-License-Identifier: LGPL-2.1-or-later
#include "support/training_meta.hpp"

#include <gst/terrainseg/terrainsegmeta.h>

#include <algorithm>

namespace terrainseg {

Supervision TrainingReader::read(GstBuffer* buffer, int width, int height) {
  release();
  error_.clear();
  rectangles_.clear();
  static const GQuark training = g_quark_from_static_string(GST_TERRAIN_TRAINING_ROI);
  gpointer state = nullptr;
  while (GstMeta* meta =
             gst_buffer_iterate_meta_filtered(buffer, &state, GST_VIDEO_REGION_OF_INTEREST_META_API_TYPE)) {
    const auto* roi = reinterpret_cast<const GstVideoRegionOfInterestMeta*>(meta);
    if (roi->roi_type != training)
      continue;
    const auto right = std::min<std::uint64_t>(std::uint64_t{roi->x} + roi->w, width);
    const auto bottom = std::min<std::uint64_t>(std::uint64_t{roi->y} + roi->h, height);
    if (roi->x >= right || roi->y >= bottom) {
      error_ = "a region of interest of type " GST_TERRAIN_TRAINING_ROI " is outside the frame";
      continue;
    }
    rectangles_.push_back({static_cast<int>(roi->x), static_cast<int>(roi->y),
                           static_cast<int>(right - roi->x), static_cast<int>(bottom - roi->y)});
  }
  Supervision supervision;
  supervision.rectangles = rectangles_;
  supervision.mask = map_mask(buffer);
  return supervision;
}

GrayView TrainingReader::map_mask(GstBuffer* buffer) {
  const GstStructure* fields = gst_terrain_meta_get_named_structure(buffer, GST_TERRAIN_TRAINING_META_NAME);
  if (!fields)
    return {};
  GstBuffer* mask = gst_terrain_seg_meta_get_buffer_(fields, "mask");
  if (!mask) {
    error_ = GST_TERRAIN_TRAINING_META_NAME " needs a field 'mask': a GRAY8 buffer with a GstVideoMeta";
    return {};
  }
  mask_.emplace(mask);
  if (mask_->error())
    error_ = std::string(GST_TERRAIN_TRAINING_META_NAME ": ") + mask_->error();
  return mask_->view();
}

} // namespace terrainseg
