// SPDX-License-Identifier: LGPL-2.1-or-later
// What a detector says of the cells that it looks at.
#pragma once

#include <algorithm>
#include <cstddef>
#include <span>

namespace terrainseg {

/// Values of cells that are finer than the grid's, row by row: cell (x, y) is centred at the frame's pixel
/// (x, y) * 2^level + middle.
template <typename Value> struct FinerCells {
  std::span<const Value> values;
  int width = 0, height = 0, level = 0;
  int middle = 0;
  int stride = 0; ///< from one row to the next

  /// Of the cell nearest to a pixel of the frame; there must be one.
  Value nearest(int x, int y) const {
    const auto cell = [&](int pixel, int count) {
      return static_cast<std::size_t>(
          std::clamp((pixel - middle + (1 << level >> 1)) >> level, 0, count - 1));
    };
    return values[cell(y, height) * static_cast<std::size_t>(stride) + cell(x, width)];
  }
};

} // namespace terrainseg
