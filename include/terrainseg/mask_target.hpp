// SPDX-License-Identifier: LGPL-2.1-or-later
// Memory for a mask that the caller owns.
#pragma once

#include "terrainseg/frame.hpp"

namespace terrainseg {

/// Size of the mask of a frame: ceil(size / 2^mask_level).
constexpr int mask_extent(int frame_extent, int mask_level) {
  return subsampled(frame_extent, mask_level);
}

/// Where the mask goes: bytes that the caller owns, mask_extent() of the frame's width x height of them.
/// Without one the segmenter keeps its own.
struct MaskTarget {
  MutablePlane plane;
  int width = 0, height = 0;
};

} // namespace terrainseg
