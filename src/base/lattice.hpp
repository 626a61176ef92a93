// SPDX-License-Identifier: LGPL-2.1-or-later
// Converts between rectangles of the frame and cells of a pyramid level. The centre of cell (x, y) of level k
// is the frame's pixel (x, y) * 2^k. A cell belongs to a rectangle that contains its centre.
#pragma once

#include <algorithm>

#include "terrainseg/frame.hpp"

namespace terrainseg {

/// The cells of a `width` x `height` grid that belong to a rectangle of the frame. May be empty.
constexpr Rectangle cells_in(const Rectangle& pixels, int level, int width, int height) {
  if (pixels.empty())
    return {};
  const auto first = [level](int pixel, int limit) {
    return std::min(subsampled(std::max(pixel, 0), level), limit);
  };
  const int left = first(pixels.x, width), right = first(pixels.x + pixels.width, width);
  const int top = first(pixels.y, height), bottom = first(pixels.y + pixels.height, height);
  return {left, top, right - left, bottom - top};
}

/// The cells of a training window. Never empty: a window smaller than a cell gets the nearest cell.
constexpr Rectangle cells_of_window(const Rectangle& window, int level, int grid_width, int grid_height) {
  Rectangle cells = cells_in(window, level, grid_width, grid_height);
  const auto nearest = [level](int first, int size, int limit) {
    const int half = (1 << level) >> 1;
    return std::clamp((first + size / 2 + half) >> level, 0, limit - 1);
  };
  if (cells.width < 1) {
    cells.x = nearest(window.x, window.width, grid_width);
    cells.width = 1;
  }
  if (cells.height < 1) {
    cells.y = nearest(window.y, window.height, grid_height);
    cells.height = 1;
  }
  return cells;
}

/// The intersection of a rectangle and the frame. May be empty.
constexpr Rectangle clipped(const Rectangle& r, int width, int height) {
  const int left = std::clamp(r.x, 0, width), top = std::clamp(r.y, 0, height);
  return {left, top, std::clamp(r.x + std::max(r.width, 0), left, width) - left,
          std::clamp(r.y + std::max(r.height, 0), top, height) - top};
}

constexpr bool contains(const Rectangle& r, int x, int y) {
  return x >= r.x && y >= r.y && x - r.x < r.width && y - r.y < r.height;
}

} // namespace terrainseg
