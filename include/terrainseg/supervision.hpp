// SPDX-License-Identifier: LGPL-2.1-or-later
// Training pixels from elsewhere.
#pragma once

#include <span>

#include "terrainseg/frame.hpp"

namespace terrainseg {

/// Training pixels from elsewhere (a laser, a stereo node) that stand in for the window on this frame.
struct Supervision {
  std::span<const Rectangle> rectangles; ///< frame pixels
  GrayView mask;                         ///< any size, stretched over the frame; pixels >= 128 train
  bool empty() const { return rectangles.empty() && mask.empty(); }
};

} // namespace terrainseg
