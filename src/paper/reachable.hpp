// SPDX-License-Identifier: LGPL-2.1-or-later
// The free space that is connected to the training window: the boundary that a planner uses.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "coarse/grid.hpp"

namespace terrainseg {

/// Per column of the grid, the highest free cell that is reached from the window: sideways along the window's
/// rows, then straight up, through free cells only. -1 = none. `free_cells` has one byte per cell, 0 = not
/// free.
void find_reachable(std::span<const std::uint8_t> free_cells, int width, const Rectangle& window_cells,
                    std::vector<std::int16_t>& top);

/// Converts `top` to rows of the frame per mask column. Within the cell above the top one, uses the row that
/// best separates traversable pixels from others. `frame_height` = no free space.
void refine_reachable(const Grid& grid, std::span<const std::int16_t> top, const GrayView& mask,
                      int mask_level, int frame_height, std::span<std::uint16_t> boundary);

} // namespace terrainseg
