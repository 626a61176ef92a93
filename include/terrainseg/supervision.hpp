// SPDX-License-Identifier: LGPL-2.1-or-later
// Training pixels from an external source.
#pragma once

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

} // namespace terrainseg
