// SPDX-License-Identifier: LGPL-2.1-or-later
// How far the free space reaches from the window: the boundary that a planner drives by.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "coarse/grid.hpp"

namespace terrainseg {

/// Per column of the grid the highest free cell that is reached from the window: sideways along the window's
/// rows, then straight up, never through a cell that is not free. -1 = none. `free_cells` has one
/// byte a cell, 0 = not free.
void find_reachable(std::span<const std::uint8_t> free_cells, int width, const Rectangle& window_cells,
                    std::vector<std::int16_t>& top);

/// The same per column of the mask, in rows of the frame: within the cell above the top one, the row that
/// parts traversable pixels from others best. `frame_height` = none.
void refine_reachable(const Grid& grid, std::span<const std::int16_t> top, const GrayView& mask,
                      int mask_level, int frame_height, std::span<std::uint16_t> boundary);

} // namespace terrainseg
