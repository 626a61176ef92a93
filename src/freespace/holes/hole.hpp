// SPDX-License-Identifier: LGPL-2.1-or-later
// What stands in the open, as holes in the mask and ends of the free space: the one place that makes them.
#pragma once

#include <cstdint>
#include <vector>

#include "freespace/curve/frame_curves.hpp"
#include "freespace/holes/finer_cells.hpp"
#include "terrainseg/estimate.hpp"

namespace terrainseg {

/// Part of a thing that stands in the open: a rectangle of the frame's pixels, and the row below which its
/// columns are free again.
struct Hole {
  std::uint16_t left = 0, top = 0, right = 0, bottom = 0; ///< the last two beyond it; may leave the frame
  std::uint16_t free_from = 0;
  bool operator==(const Hole&) const = default;
};

/// Cells `from` to `to` of a row of a pyramid level, which are centred at multiples of 2^level.
Hole hole_of_cells(int level, int row, int from, int to);

/// What one detector found in a frame.
struct Detection {
  std::uint8_t label = mask_doubtful; ///< of traversable pixels in its holes
  std::vector<Hole> holes;
  /// Evidence against the ground, of which one is empty: cells that differ from the ground beside them (Q4 of
  /// a standard deviation), and cells that move as something that stands (Q8).
  FinerCells<std::uint8_t> oddness;
  FinerCells<std::int16_t> standing;
};

/// Lowers curve rows (of the frame, one per mask column) to below the holes.
void lower_below(const Detection& found, int mask_level, FrameCurve& rows);

/// Labels the traversable pixels of the holes; returns how many.
std::uint64_t mark(const Detection& found, const MutablePlane& mask, int width, int height, int mask_level);

} // namespace terrainseg
