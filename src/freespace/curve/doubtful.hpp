// SPDX-License-Identifier: LGPL-2.1-or-later
// Finds doubtful ground next to the boundary: cells that do not look like ground and are below the boundary
// only because it is smooth.
#pragma once

#include <cstdint>
#include <vector>

#include "base/quantities.hpp"
#include "coarse/grid.hpp"

namespace terrainseg {

/// The limit that disables the stage.
inline constexpr int doubtful_off = -96;

/// Walks down from the boundary in each column while the mean of the score (Q4) over 3x3 cells, weighted
/// 1-2-1 in both directions, is below `limit` (32 = 1 nat). `safe` (grid.width values, >= boundary) receives
/// the first row that is not doubtful. In towns half of the unsafe pixels are within two cells of an
/// obstacle's base. A walk from the boundary therefore works, a threshold over the whole area does not.
void walk_doubtful(const Grid& grid, const CellScores& score, int limit, const GridCurve& boundary,
                   GridCurve& safe);

} // namespace terrainseg
