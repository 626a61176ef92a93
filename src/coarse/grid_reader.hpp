// SPDX-License-Identifier: LGPL-2.1-or-later
// The grid of the default pipeline: the coarsest pyramid level in one colour space.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "base/color_transform.hpp"
#include "coarse/grid.hpp"
#include "coarse/pyramid.hpp"

namespace terrainseg {

/// The pyramid levels that the default pipeline needs.
PyramidPlan coarse_plan(PixelFormat format, int coarsest);

/// Converts pyramid levels to full-range BT.601 luma and chroma, in its own memory.
class GridReader {
 public:
  /// Converts a level and marks its ignored cells. The result is valid until the next call, which allocates
  /// only when the grid grows.
  Grid read(const Pyramid& pyramid, int level, const ColorTransform& transform,
            std::span<const Rectangle> ignore_regions);

 private:
  std::vector<std::uint8_t> bytes_; ///< the three components, then the marks of ignored cells
};

} // namespace terrainseg
