// SPDX-License-Identifier: LGPL-2.1-or-later
// Applies obstacles in open ground to the outputs: holes in the mask and ends of the free space. No other
// code does this.
#pragma once

#include <cstdint>
#include <vector>

#include "freespace/curve/frame_curves.hpp"
#include "freespace/holes/finer_cells.hpp"
#include "terrainseg/estimate.hpp"

namespace terrainseg {

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
  /// (Q4 of a standard deviation). `standing`: the cell moves as a standing obstacle (Q8).
  FinerCells<std::uint8_t> oddness;
  FinerCells<std::int16_t> standing;
};

/// Lowers a curve (rows of the frame per mask column) to below the holes.
void lower_below(const Detection& found, int mask_level, FrameCurve& rows);

/// Labels the traversable pixels of the holes. Returns their number.
std::uint64_t mark(const Detection& found, const MutablePlane& mask, int width, int height, int mask_level);

} // namespace terrainseg
