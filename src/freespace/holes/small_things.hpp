// SPDX-License-Identifier: LGPL-2.1-or-later
// What is found in the open, cell by cell, as a hole in the mask and an end of the free space.
#pragma once

#include <cstdint>

#include "freespace/curve/frame_curves.hpp"
#include "terrainseg/frame.hpp"

namespace terrainseg {

/// Cells `from` to `to` of a row of a pyramid level.
struct CellStretch {
  int level = 0, row = 0, from = 0, to = 0;
};

/// Lowers curve rows (of the frame, one per mask column) to below the stretch.
void lower_below(const CellStretch& stretch, int mask_level, FrameCurve& rows);

/// Turns the traversable pixels of the stretch into doubtful ones; returns how many.
std::uint64_t make_doubtful(const CellStretch& stretch, const MutablePlane& mask, int width, int height,
                            int mask_level);

} // namespace terrainseg
