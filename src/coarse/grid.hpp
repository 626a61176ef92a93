// SPDX-License-Identifier: LGPL-2.1-or-later
// The coarse view that every stage after the pyramid works on: three components on one lattice of cells.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "terrainseg/frame.hpp"

namespace terrainseg {

// Ignored regions: parts of the frame that are neither learned nor labelled (the rover's own bonnet, say).

/// Sets the cells of a row-by-row grid whose centres lie in a region to `value`.
void fill_ignored(std::span<const Rectangle> ignored, int level, int width, int height, std::uint8_t value,
                  std::uint8_t* cells);

/// Gives ignored parts of the mask the value 128; returns how many of their pixels were traversable.
/// `mask_level`: the mask is 2^level times smaller than the frame.
std::uint64_t mark_ignored(std::span<const Rectangle> ignored, int mask_level, const MutablePlane& mask,
                           int width, int height);

/// Three 8-bit values: Y, U, V or R, G, B.
using Color = std::array<std::uint8_t, 3>;

/// Position of a cell in a grid.
struct Cell {
  std::int16_t x = 0, y = 0;
  bool operator==(const Cell&) const = default;
};

/// A pyramid level, or anything of its shape: a view of bytes that somebody else owns. Cell (x, y) is centred
/// at the frame's pixel (x, y) * 2^level: a pyramid keeps the phase of its even samples, and half a cell
/// further would cost 1 % of the height. What else is known of the cells (scores, penalties, ...) lies row by
/// row, size() values, and at() is where.
struct Grid {
  std::array<Plane, 3> planes; ///< Y, U, V or R, G, B
  int width = 0, height = 0;
  int level = 0;
  std::span<const std::uint8_t> ignored{}; ///< 1 where ignore-regions cover the centre; empty: nobody looked

  std::size_t size() const { return static_cast<std::size_t>(width) * height; }
  std::size_t at(int row, int column) const { return static_cast<std::size_t>(row) * width + column; }
  /// The three components of a row.
  std::array<const std::uint8_t*, 3> row(int y) const {
    return {planes[0].row(y), planes[1].row(y), planes[2].row(y)};
  }
  Color color(Cell cell) const {
    return {planes[0].row(cell.y)[cell.x], planes[1].row(cell.y)[cell.x], planes[2].row(cell.y)[cell.x]};
  }
};

/// The level that is scored coarse. -1 = the first under 96 cells wide; never so coarse that fewer than 4
/// rows or columns are left, where neither a window nor a horizon has a place.
int grid_level(int wanted, int width, int height);

/// Level of the refinement: two finer than the grid where there are two.
constexpr int refinement_level(int coarsest) {
  return coarsest > 2 ? coarsest - 2 : 0;
}

/// Level of the finest texture band: three finer than the grid where there are three.
constexpr int texture_level(int coarsest) {
  return coarsest > 3 ? coarsest - 3 : 0;
}

/// True when a picture shows nothing: a covered lens, a dead camera. All of it would look like its window.
bool is_blank(const Grid& grid);

} // namespace terrainseg
