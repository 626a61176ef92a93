// SPDX-License-Identifier: LGPL-2.1-or-later
// Ground next to the boundary that does not look like ground: dragged in by the boundary's smoothness.
#pragma once

#include <cstdint>
#include <vector>

#include "coarse.hpp"

namespace terrainseg {

/// A doubtful limit that switches the stage off.
inline constexpr int doubtful_off = -96;

/// Walks down from the boundary in each column while the 3x3 mean of the score (Q4) stays under `limit` (32 =
/// 1 nat). `safe` (grid.width values, >= boundary) is the first row that is not doubtful. Half of the unsafe
/// pixels in town lie within two cells of an obstacle's base: that is why a walk works and a veto over the
/// whole area does not.
void walk_doubtful(const CoarseGrid& grid, const std::vector<std::int16_t>& score, int limit,
                   const std::vector<std::uint16_t>& boundary, std::vector<std::uint16_t>& safe);

} // namespace terrainseg
