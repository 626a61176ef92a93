// SPDX-License-Identifier: LGPL-2.1-or-later
// Reads training pixels that upstream elements attached to a frame.
#pragma once

#include <gst/video/video.h>

#include <optional>
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
  GrayView map_mask(GstBuffer* buffer);

  std::vector<Rectangle> rectangles_;
  std::optional<MappedMask> mask_;
  std::string error_;
};

} // namespace terrainseg
