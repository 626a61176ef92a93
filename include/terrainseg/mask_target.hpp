// SPDX-License-Identifier: LGPL-2.1-or-later
// Memory of the caller for a mask.
#pragma once

#include "terrainseg/frame.hpp"

namespace terrainseg {

/// Width or height of the mask of a frame, in pixels: ceil(frame_extent / 2^mask_level).
constexpr int mask_extent(int frame_extent, int mask_level) {
  return subsampled(frame_extent, mask_level);
}

/// Memory of the caller that receives the mask: width and height are mask_extent() of the frame's. When it is
/// empty, the segmenter writes the mask into its own memory.
struct MaskTarget {
  MutablePlane plane;        ///< one byte per mask pixel
  int width = 0, height = 0; ///< mask pixels
};

} // namespace terrainseg
