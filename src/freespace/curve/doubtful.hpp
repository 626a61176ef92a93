// SPDX-License-Identifier: LGPL-2.1-or-later
// Ground next to the boundary that does not look like ground: dragged in by the boundary's smoothness.
#pragma once

#include <cstdint>
#include <vector>

#include "base/quantities.hpp"
#include "coarse/grid.hpp"

namespace terrainseg {

/// A doubtful limit that switches the stage off.
inline constexpr int doubtful_off = -96;

/// Walks down from the boundary in each column while the mean of the score (Q4) over 3x3 cells, 1-2-1 in
/// both directions, stays under `limit` (32 = 1 nat). `safe` (grid.width values, >= boundary) is the first
/// row that is not doubtful. Half of the unsafe pixels in town lie within two cells of an obstacle's base:
/// that is why a walk works and a veto over the whole area does not.
void walk_doubtful(const Grid& grid, const CellScores& score, int limit, const GridCurve& boundary,
                   GridCurve& safe);

} // namespace terrainseg
