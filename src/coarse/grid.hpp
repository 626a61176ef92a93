// SPDX-License-Identifier: LGPL-2.1-or-later
// The grid of cells on which all stages after the pyramid work, and the parts of a frame that are left out:
// ignored regions and vetoed pixels.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "terrainseg/frame.hpp"
#include "terrainseg/supervision.hpp"

namespace terrainseg {

// Ignored regions: parts of the frame that are neither learned nor labelled, such as the rover's bonnet.

/// Sets the cells of a row-by-row grid whose centres lie in a region to `value`.
void fill_ignored(std::span<const Rectangle> ignored, int level, int width, int height, std::uint8_t value,
                  std::uint8_t* cells);

/// Sets ignored parts of the mask to 128. Returns how many of their pixels were traversable. The mask is
/// 2^mask_level times smaller than the frame.
std::uint64_t mark_ignored(std::span<const Rectangle> ignored, int mask_level, const MutablePlane& mask,
                           int width, int height);

/// Three 8-bit values: Y, U, V or R, G, B.
using Color = std::array<std::uint8_t, 3>;

/// Position of a cell in a grid.
struct Cell {
  std::int16_t x = 0, y = 0;
  bool operator==(const Cell&) const = default;
};

/// A pyramid level, or other cells of its shape. The bytes belong to another object. Cell (x, y) is centred
/// at the frame's pixel (x, y) * 2^level, because a pyramid keeps even samples; half a cell lower would be an
/// error of 1 % of the height. Other values of the cells (scores, penalties, ...) are lists of size() values,
/// row by row, with the index at().
struct Grid {
  std::array<Plane, 3> planes; ///< Y, U, V or R, G, B
  int width = 0, height = 0;
  int level = 0;
  std::span<const std::uint8_t> ignored{}; ///< 1 where ignore-regions cover the centre; empty = unknown

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

/// The level of the grid: `wanted`, or with -1 the first that is less than 96 cells wide. Never so coarse
/// that it has fewer than 4 rows or columns, too few for a window and a horizon.
int grid_level(int wanted, int width, int height);

/// Level of the refinement: two finer than the grid, or level 0.
constexpr int refinement_level(int coarsest) {
  return coarsest > 2 ? coarsest - 2 : 0;
}

/// Level of the finest texture band: three finer than the grid, or level 0.
constexpr int texture_level(int coarsest) {
  return coarsest > 3 ? coarsest - 3 : 0;
}

/// True when a picture has a single colour (a covered lens, a dead camera): all of it would look like the
/// training window.
bool is_blank(const Grid& grid);

/// The pixels of a frame that an external detector vetoes: they are not learned and not traversable. A view:
/// valid as long as the veto's memory.
class VetoArea {
 public:
  VetoArea() = default;
  VetoArea(const Veto& veto, int frame_width, int frame_height)
      : veto_(veto), width_(frame_width), height_(frame_height) {}
  bool empty() const { return veto_.empty(); }

  /// Whether a vetoed pixel lies in cell (x, y) of a level: one of the frame's pixels to which this cell is
  /// the nearest.
  bool touches_cell(int level, int x, int y) const;
  /// Sets the cells of a `width` x `height` grid that a vetoed pixel lies in to `value`.
  void fill_cells(int level, int width, int height, std::uint8_t value, std::uint8_t* cells) const;

  /// Labels mask pixels 0 when one of the frame's pixels that they cover is vetoed. Returns how many of them
  /// were traversable.
  std::uint64_t mark(int mask_level, const MutablePlane& mask, int width, int height) const;
  /// Lowers a curve (rows of the frame per mask column) to below the lowest vetoed pixel of each column.
  void lower(int mask_level, std::span<std::uint16_t> rows) const;

 private:
  template <typename Use> void each(Use use) const;

  Veto veto_;
  int width_ = 0, height_ = 0; ///< of the frame
};

} // namespace terrainseg
