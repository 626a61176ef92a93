// SPDX-License-Identifier: LGPL-2.1-or-later
// Reads training pixels and vetoed pixels that upstream elements attached to a frame.
#pragma once

#include <gst/video/video.h>

#include <array>
#include <optional>
#include <string>
#include <vector>

#include "support/video_frame.hpp"
#include "terrainseg/segmenter.hpp"

namespace terrainseg {

/// Reads GstVideoRegionOfInterestMeta of type terrain-training and GstTerrainTrainingMeta. Keeps its memory
/// between frames. The supervision is valid until release().
class TrainingReader {
 public:
  /// Empty if the frame has none. `width` and `height` are the frame's.
  Supervision read(GstBuffer* buffer, int width, int height);
  void release() { mask_.reset(); }
  /// The error in the metadata of the last frame; nullptr if there was none.
  const char* error() const { return error_.empty() ? nullptr : error_.c_str(); }

 private:
  std::vector<Rectangle> rectangles_;
  std::optional<MappedMask> mask_;
  std::string error_;
};

/// Reads GstVideoRegionOfInterestMeta of type terrain-veto and of chosen types, and every GstTerrainVetoMeta.
/// Keeps its memory between frames. The veto is valid until release().
class VetoReader {
 public:
  /// Types of regions that are vetoes too: names with commas between them, "*" = all but terrain-training.
  /// Does nothing when they are the same as before.
  void choose(const std::string& types);
  Veto read(GstBuffer* buffer, int width, int height);
  void release();
  const char* error() const { return error_.empty() ? nullptr : error_.c_str(); }

 private:
  static constexpr std::size_t most_masks = 8;
  bool is_chosen(GQuark type) const;
  void map_masks(GstBuffer* buffer);

  std::string types_;
  std::vector<GQuark> chosen_;
  bool all_ = false;
  std::vector<Rectangle> rectangles_;
  std::vector<std::optional<MappedMask>> masks_; ///< most_masks, made for the first frame that has one
  std::array<GrayView, most_masks> views_;
  std::size_t mask_count_ = 0;
  std::string error_;
};

} // namespace terrainseg
