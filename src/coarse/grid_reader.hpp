// SPDX-License-Identifier: LGPL-2.1-or-later
// The grid that the default pipeline thinks on: the coarsest pyramid level in one colour space.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "base/color_transform.hpp"
#include "coarse/grid.hpp"
#include "coarse/pyramid.hpp"

namespace terrainseg {

/// What the default pipeline reads of a frame.
PyramidPlan coarse_plan(PixelFormat format, int coarsest);

/// Turns pyramid levels into full-range BT.601 luma and chroma, and keeps the bytes.
class GridReader {
 public:
  /// The level, transformed, and what of it is ignored. Good until the next call, which allocates only where
  /// the grid grows.
  Grid read(const Pyramid& pyramid, int level, const ColorTransform& transform,
            std::span<const Rectangle> ignore_regions);

 private:
  std::vector<std::uint8_t> bytes_; ///< the three components and what is ignored, one after the other
};

} // namespace terrainseg
