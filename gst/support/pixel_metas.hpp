// SPDX-License-Identifier: LGPL-2.1-or-later
// Reads training pixels and vetoed pixels that upstream elements attached to a frame.
#pragma once

#include <gst/terrainseg/terrainsegmeta.h>
#include <gst/video/video.h>

#include <algorithm>
#include <array>
#include <optional>
#include <string>
#include <vector>

#include "support/video_frame.hpp"
#include "terrainseg/segmenter.hpp"

namespace terrainseg {

/// What the readers of both kinds share. Keeps its memory between frames.
class PixelReader {
 public:
  /// The error in the metadata of the last frame; nullptr if there was none.
  const char* error() const { return error_.empty() ? nullptr : error_.c_str(); }

 protected:
  /// Reads the regions of interest whose type `wanted` accepts, clipped to the frame. `error_` tells of one
  /// that lies outside the frame, and is empty when none does.
  void read_regions(GstBuffer* buffer, int width, int height, auto wanted) {
    error_.clear();
    rectangles_.clear();
    gpointer state = nullptr;
    while (GstMeta* meta =
               gst_buffer_iterate_meta_filtered(buffer, &state, GST_VIDEO_REGION_OF_INTEREST_META_API_TYPE)) {
      const auto* roi = reinterpret_cast<const GstVideoRegionOfInterestMeta*>(meta);
      if (!wanted(roi->roi_type))
        continue;
      const auto right = std::min<std::uint64_t>(std::uint64_t{roi->x} + roi->w, width);
      const auto bottom = std::min<std::uint64_t>(std::uint64_t{roi->y} + roi->h, height);
      if (roi->x >= right || roi->y >= bottom)
        error_ = std::string("a region of interest of type ") + g_quark_to_string(roi->roi_type) +
                 " is empty or outside the frame";
      else
        rectangles_.push_back({static_cast<int>(roi->x), static_cast<int>(roi->y),
                               static_cast<int>(right - roi->x), static_cast<int>(bottom - roi->y)});
    }
  }
  /// Maps the field "mask" of a custom meta. Empty, with a reason in `error_`, when it cannot be read.
  GrayView map_mask(const GstStructure* fields, std::optional<MappedMask>& mask) {
    const char* name = gst_structure_get_name(fields);
    GstBuffer* buffer = gst_terrain_seg_meta_get_buffer_(fields, "mask");
    if (!buffer) {
      error_ = std::string(name) + " needs a field 'mask': a GRAY8 buffer with a GstVideoMeta";
      return {};
    }
    mask.emplace(buffer);
    if (mask->error())
      error_ = std::string(name) + ": " + mask->error();
    return mask->view();
  }

  std::vector<Rectangle> rectangles_;
  std::string error_;
};

/// Reads GstVideoRegionOfInterestMeta of type terrain-training and GstTerrainTrainingMeta. The supervision is
/// valid until release().
class TrainingReader : public PixelReader {
 public:
  /// Empty if the frame has none. `width` and `height` are the frame's.
  Supervision read(GstBuffer* buffer, int width, int height) {
    release();
    static const GQuark training = g_quark_from_static_string(GST_TERRAIN_TRAINING_ROI);
    const auto is_training = [](GQuark type) { return type == training; };
    read_regions(buffer, width, height, is_training);
    Supervision supervision;
    supervision.rectangles = rectangles_;
    if (const GstStructure* fields =
            gst_terrain_meta_get_named_structure(buffer, GST_TERRAIN_TRAINING_META_NAME))
      supervision.mask = map_mask(fields, mask_);
    return supervision;
  }
  void release() { mask_.reset(); }

 private:
  std::optional<MappedMask> mask_;
};

/// Reads GstVideoRegionOfInterestMeta of type terrain-veto and of chosen types, and every GstTerrainVetoMeta.
/// The veto is valid until release().
class VetoReader : public PixelReader {
 public:
  /// Types of regions that are vetoes too: names with commas between them, "*" = all but terrain-training.
  /// Does nothing when they are the same as before.
  void choose(const std::string& types) {
    if (types == types_)
      return;
    types_ = types;
    chosen_.clear();
    all_ = false;
    g_auto(GStrv) names = g_strsplit(types.c_str(), ",", -1);
    for (gchar** name = names; *name; ++name) {
      g_strstrip(*name);
      if (g_str_equal(*name, "*"))
        all_ = true;
      else if (**name)
        chosen_.push_back(g_quark_from_string(*name));
    }
  }
  Veto read(GstBuffer* buffer, int width, int height) {
    release();
    rectangles_.reserve(64); // no frame with fewer regions allocates
    const auto chosen = [this](GQuark type) { return is_chosen(type); };
    read_regions(buffer, width, height, chosen);
    map_masks(buffer);
    Veto veto;
    veto.rectangles = rectangles_;
    veto.masks = {views_.data(), mask_count_};
    return veto;
  }
  void release() {
    for (std::optional<MappedMask>& mask : masks_)
      mask.reset();
    mask_count_ = 0;
  }

 private:
  static constexpr std::size_t most_masks = 8;
  bool is_chosen(GQuark type) const {
    static const GQuark veto = g_quark_from_static_string(GST_TERRAIN_VETO_ROI),
                        training = g_quark_from_static_string(GST_TERRAIN_TRAINING_ROI);
    if (type == veto)
      return true;
    return all_ ? type != training : std::ranges::find(chosen_, type) != chosen_.end();
  }
  void map_masks(GstBuffer* buffer) {
    const GstMetaInfo* info = gst_meta_get_info(GST_TERRAIN_VETO_META_NAME);
    gpointer state = nullptr;
    while (GstMeta* meta = info ? gst_buffer_iterate_meta_filtered(buffer, &state, info->api) : nullptr) {
      if (mask_count_ == most_masks) {
        error_ = "a frame has more than 8 metas " GST_TERRAIN_VETO_META_NAME;
        return;
      }
      if (masks_.empty())
        masks_ = std::vector<std::optional<MappedMask>>(most_masks);
      const GstStructure* fields = gst_custom_meta_get_structure(reinterpret_cast<GstCustomMeta*>(meta));
      const GrayView view = map_mask(fields, masks_[mask_count_]);
      if (!view.empty())
        views_[mask_count_++] = view;
    }
  }

  std::string types_;
  std::vector<GQuark> chosen_;
  bool all_ = false;
  std::vector<std::optional<MappedMask>> masks_; ///< most_masks, made for the first frame that has one
  std::array<GrayView, most_masks> views_;
  std::size_t mask_count_ = 0;
};

} // namespace terrainseg
