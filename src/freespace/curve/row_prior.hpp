// SPDX-License-Identifier: LGPL-2.1-or-later
// Where in the picture ground is to be expected, from the filter's own slow horizon.
#pragma once

#include <cstdint>
#include <vector>

#include "base/quantities.hpp"

namespace terrainseg {

/// Per row of the grid what speaks for ground there, 32 = 1 nat, less `caution`. `slow_horizon` is Q8 of the
/// height, 0 = none yet: then the middle of the picture. With `enabled` false only the caution is left.
void row_prior(int grid_height, std::uint32_t slow_horizon, bool enabled, int caution, RowPriors& prior);

/// The horizon that the prior is to follow: the slow one, but not far below the row where the ground vanishes
/// (Q8 of the height; negative = not known). Ground that was lost keeps both the boundary and the slow
/// horizon low, which speaks against finding it again; where the plane ends does not depend on what was
/// found.
std::uint32_t horizon_of_prior(std::uint32_t slow_horizon, int vanishing_row);

/// Takes so much from the rows of the grid before `first` that hardly any ground ends there.
void deny_rows_before(int first, RowPriors& prior);

/// The slow horizon follows the upper end of `boundary` (rows of the grid per column) by a quarter, or jumps
/// to it when there is none yet. Q8 of the height, 1..255.
std::uint32_t follow_horizon(std::uint32_t slow_horizon, const GridCurve& boundary, int grid_height,
                             std::vector<std::uint16_t>& scratch);

} // namespace terrainseg
