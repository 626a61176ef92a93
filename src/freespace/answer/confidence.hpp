// SPDX-License-Identifier: LGPL-2.1-or-later
// Confidence of an estimate.
#pragma once

#include <cstdint>
#include <vector>

#include "base/quantities.hpp"
#include "coarse/grid.hpp"
#include "freespace/curve/ground_behind.hpp"

namespace terrainseg {

/// Confidence of the mask, 0..255. It measures how far the scores (Q4) of the ground exceed those of the
/// rest, in the whole picture and in the rows next to the boundary. It decreases with the number of rows that
/// the boundary jumps, because a curve that follows many obstacles is uncertain. On five labelled sequences
/// its rank correlation with the frame's error is negative in each (docs/accuracy.md).
std::uint8_t mask_confidence(const Grid& grid, const CellScores& score, const GridCurve& boundary,
                             const GroundBehind& behind);

/// Confidence of the horizon, 0..255: the mask's confidence, reduced by the `spread` between two of the
/// boundary's uppermost percentiles, in rows of the frame.
std::uint8_t horizon_confidence(std::uint8_t mask_confidence, int spread, int frame_height);

} // namespace terrainseg
