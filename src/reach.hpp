// SPDX-License-Identifier: LGPL-2.1-or-later
// How far the free space reaches from the window: the boundary that a planner drives by.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "grid.hpp"

namespace terrainseg {

/// The cells that a window covers; never empty: a window smaller than a cell has the cell nearest to it.
Rectangle cells_of_window(const Rectangle& window, int level, int grid_width, int grid_height);

/// Per column of the grid the highest free cell that is reached from the window: sideways along the window's
/// rows, then straight up, never through a cell that is not free. -1 = none. `free_cells` has one
/// byte a cell, 0 = not free.
void reach(std::span<const std::uint8_t> free_cells, int width, const Rectangle& window_cells,
           std::vector<std::int16_t>& top);

/// The same per column of the mask, in rows of the frame: within the cell above the top one, the row that
/// parts traversable pixels from others best. `frame_height` = none.
void refine_reach(const Grid& grid, std::span<const std::int16_t> top, const GrayView& mask, int mask_level,
                  int frame_height, std::span<std::uint16_t> boundary);

/// Of 1000 columns of the window, how many are free for at least `margin` rows (of the frame) ahead of it.
int free_permille_ahead(std::span<const std::uint16_t> boundary, int mask_level, const Rectangle& window,
                        int margin);

} // namespace terrainseg
