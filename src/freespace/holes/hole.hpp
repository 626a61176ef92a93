// SPDX-License-Identifier: LGPL-2.1-or-later
// Applies obstacles in open ground to the outputs: holes in the mask and ends of the free space. No other
// code does this.
#pragma once

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <span>
#include <vector>

#include "coarse/grid.hpp"
#include "freespace/curve/frame_curves.hpp"
#include "terrainseg/estimate.hpp"
#include "terrainseg/frame.hpp"

namespace terrainseg {

/// Values of a detector for each cell that it examined, which are finer than the grid's, row by row. The
/// centre of cell (x, y) is the frame's pixel (x, y) * 2^level + middle.
template <typename Value> struct FinerCells {
  std::span<const Value> values;
  int width = 0, height = 0, level = 0;
  int middle = 0;
  int stride = 0; ///< elements from one row to the next

  /// Returns the value of the cell nearest to a pixel of the frame. Must not be empty.
  Value nearest(int x, int y) const {
    const auto cell = [&](int pixel, int count) {
      return std::clamp((pixel - middle + (1 << level >> 1)) >> level, 0, count - 1);
    };
    return values[cell(y, height) * stride + cell(x, width)];
  }
};

// Rasterises the curves: which cells of a pyramid level are ground.

/// Relation of a level's cells to the curves.
struct OutlineView {
  int level = 0, width = 0, height = 0; ///< size of the level in cells; the rows may end above the end of the
                                        ///< picture
  /// Each cell uses the curves' column at or before its centre, at a multiple of 2^column_spacing pixels of
  /// the frame.
  int column_spacing = 0;
  std::span<const Rectangle> ignored; ///< in pixels of the frame
  int stride = 0; ///< elements per row in memory, at least `width`; the additional ones are not ground
};

class GroundOutline {
 public:
  /// Marks the cells whose centres are in the ground. Returns false when there is none.
  bool draw(const FreeSpaceCurves& curves, const OutlineView& view);

  int first() const { return first_; } ///< the uppermost row with ground; the height when there is none
  /// 1 = ground, otherwise 0. Valid from row first() on.
  /// Column -1 is not ground, where rows have additional elements.
  const std::uint8_t* row(int i) const { return &cells_[i * stride_ + 1]; }
  /// True when all cells of a row from `from` to `to` (exclusive) are ground.
  bool is_whole(int i, int from, int to) const { return !std::memchr(row(i) + from, 0, to - from); }

 private:
  int stride_ = 0;
  int first_ = 0;
  std::vector<std::uint16_t> safe_, behind_first_, behind_end_; ///< in rows of cells
  std::vector<std::uint8_t> cells_;                             ///< from column -1 of the first row on
};

/// A part of an obstacle in open ground: a rectangle in pixels of the frame, and the row from which its
/// columns are free again.
struct Hole {
  std::uint16_t left = 0, top = 0, right = 0, bottom = 0; ///< right and bottom are exclusive; may extend
                                                          ///< beyond the frame
  std::uint16_t free_from = 0;
  bool operator==(const Hole&) const = default;
};

/// The hole of the cells `from` to `to` of a row of a pyramid level. Cells are centred at multiples of
/// 2^level.
Hole hole_of_cells(int level, int row, int from, int to);

/// Result of one detector for a frame.
struct Detection {
  std::uint8_t label = mask_doubtful; ///< new label of the traversable pixels in the holes
  std::vector<Hole> holes;
  /// Evidence against ground; one of the two is empty. `oddness`: difference from the ground beside the cell
  /// (Q4 of a standard deviation). `standing`: the cell moves as a standing obstacle, or is vetoed (Q8).
  FinerCells<std::uint8_t> oddness;
  FinerCells<std::int16_t> standing;
  VetoArea veto{}; ///< pixels that are labelled 0 whatever they are
};

/// Lowers a curve (rows of the frame per mask column) to below the holes and vetoed pixels.
void lower_below(const Detection& found, int mask_level, FrameCurve& rows);

/// Labels the traversable pixels of the holes, and all vetoed pixels. Returns how many were traversable.
std::uint64_t mark(const Detection& found, const MutablePlane& mask, int width, int height, int mask_level);

} // namespace terrainseg
