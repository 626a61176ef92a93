// SPDX-License-Identifier: LGPL-2.1-or-later
// Prior for the ground per row, from the running mean of the horizon (the slow horizon).
#pragma once

#include <cstdint>
#include <vector>

#include "base/quantities.hpp"

namespace terrainseg {

/// Per row of the grid the evidence for ground, 32 = 1 nat, minus `caution`. `slow_horizon` is Q8 of the
/// height; 0 = unknown, then the middle of the picture is used. With `enabled` false the result is only the
/// caution.
void row_prior(int grid_height, std::uint32_t slow_horizon, bool enabled, int caution, RowPriors& prior);

/// The horizon for the prior: the slow horizon, but not far below `vanishing_row` (Q8 of the height; negative
/// = unknown). After a loss of ground, the boundary and the slow horizon are too low, and the prior would
/// keep the ground from being found again. The vanishing line does not depend on the ground that was found.
std::uint32_t horizon_of_prior(std::uint32_t slow_horizon, int vanishing_row);

/// Lowers the prior of the rows before `first` so far that ground hardly ever ends there.
void deny_rows_before(int first, RowPriors& prior);

/// Moves the slow horizon towards the upper end of `boundary` (rows of the grid per column) by a quarter, or
/// sets it when it is unknown. Q8 of the height, 1..255.
std::uint32_t follow_horizon(std::uint32_t slow_horizon, const GridCurve& boundary, int grid_height,
                             std::vector<std::uint16_t>& scratch);

} // namespace terrainseg
