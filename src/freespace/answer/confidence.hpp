// SPDX-License-Identifier: LGPL-2.1-or-later
// How far an estimate can be trusted.
#pragma once

#include <cstdint>
#include <vector>

#include "base/quantities.hpp"
#include "coarse/grid.hpp"
#include "freespace/curve/ground_behind.hpp"

namespace terrainseg {

/// 0..255: how far the scores (Q4) of the ground stand above those of the rest, in the whole picture and in
/// the rows next to the boundary, less the more rows the boundary jumps: a curve that has to dodge does not
/// know where to go. Measured on five labelled sequences its rank correlation with the frame's error is
/// negative in each (docs/accuracy.md).
std::uint8_t mask_confidence(const Grid& grid, const CellScores& score, const GridCurve& boundary,
                             const GroundBehind& behind);

/// 0..255: the mask's confidence, less the farther apart the boundary's highest columns are: `spread` rows of
/// the frame between two of its uppermost percentiles.
std::uint8_t horizon_confidence(std::uint8_t mask_confidence, int spread, int frame_height);

} // namespace terrainseg
