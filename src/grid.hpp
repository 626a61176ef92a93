// SPDX-License-Identifier: LGPL-2.1-or-later
// The coarse view that every stage after the pyramid works on: three components on one lattice of cells.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>

#include "terrainseg/frame.hpp"

namespace terrainseg {

/// Three 8-bit values: Y, U, V or R, G, B.
using Color = std::array<std::uint8_t, 3>;

/// Position of a cell in a grid.
struct Cell {
  std::int16_t x = 0, y = 0;
  bool operator==(const Cell&) const = default;
};

/// A pyramid level, or anything of its shape. A cell (x, y) is centred at the frame's pixel (x, y) * 2^level.
struct Grid {
  std::array<Plane, 3> planes;
  int width = 0, height = 0;
  int level = 0;
  Color at(Cell cell) const {
    return {planes[0].row(cell.y)[cell.x], planes[1].row(cell.y)[cell.x], planes[2].row(cell.y)[cell.x]};
  }
};

/// The cells of a `width` x `height` grid whose centres lie in a rectangle of the frame. May be empty.
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

/// The part of a rectangle that lies inside the frame. May be empty.
constexpr Rectangle clipped(const Rectangle& r, int width, int height) {
  const int left = std::clamp(r.x, 0, width), top = std::clamp(r.y, 0, height);
  return {left, top, std::clamp(r.x + std::max(r.width, 0), left, width) - left,
          std::clamp(r.y + std::max(r.height, 0), top, height) - top};
}

constexpr bool contains(const Rectangle& r, int x, int y) {
  return x >= r.x && y >= r.y && x - r.x < r.width && y - r.y < r.height;
}

/// The level that is scored coarse. -1 = the first under 96 cells wide; never so coarse that fewer than 4
/// rows or columns are left, where neither a window nor a horizon has a place.
int grid_level(int wanted, int width, int height);

/// True when a picture shows nothing: a covered lens, a dead camera. All of it would look like its window.
bool is_blank(const Grid& grid);

} // namespace terrainseg
