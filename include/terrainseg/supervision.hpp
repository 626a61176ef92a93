// SPDX-License-Identifier: LGPL-2.1-or-later
// Pixels from an external source: training pixels and vetoed pixels.
#pragma once

#include <algorithm>
#include <span>

#include "terrainseg/frame.hpp"

namespace terrainseg {

/// Training pixels from an external source (a laser, a stereo node) for one frame. They replace the training
/// window.
struct Supervision {
  std::span<const Rectangle> rectangles; ///< in pixels of the frame
  GrayView mask;                         ///< any size, stretched over the frame; pixels >= 128 are trained on
  bool empty() const { return rectangles.empty() && mask.empty(); }
};

/// Pixels of one frame that an external detector (of vehicles, of people) takes away from the ground. They
/// are not traversable, the boundary does not pass them, and they are not learned.
struct Veto {
  std::span<const Rectangle> rectangles; ///< in pixels of the frame
  /// Any size, stretched over the frame: each pixel of the frame that a pixel >= 128 touches is vetoed.
  std::span<const GrayView> masks;
  bool empty() const {
    return rectangles.empty() &&
           std::ranges::all_of(masks, [](const GrayView& mask) { return mask.empty(); });
  }
};

} // namespace terrainseg
