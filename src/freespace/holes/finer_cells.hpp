// SPDX-License-Identifier: LGPL-2.1-or-later
// Values of a detector for each cell that it examined.
#pragma once

#include <algorithm>
#include <cstddef>
#include <span>

namespace terrainseg {

/// Values of cells that are finer than the grid's, row by row. The centre of cell (x, y) is the frame's pixel
/// (x, y) * 2^level + middle.
template <typename Value> struct FinerCells {
  std::span<const Value> values;
  int width = 0, height = 0, level = 0;
  int middle = 0;
  int stride = 0; ///< elements from one row to the next

  /// Returns the value of the cell nearest to a pixel of the frame. Must not be empty.
  Value nearest(int x, int y) const {
    const auto cell = [&](int pixel, int count) {
      return static_cast<std::size_t>(
          std::clamp((pixel - middle + (1 << level >> 1)) >> level, 0, count - 1));
    };
    return values[cell(y, height) * static_cast<std::size_t>(stride) + cell(x, width)];
  }
};

} // namespace terrainseg
