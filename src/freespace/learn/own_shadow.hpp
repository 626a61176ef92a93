// SPDX-License-Identifier: LGPL-2.1-or-later
// Detects the rover's own shadow, or a dark part of it, in the training window.
#pragma once

#include <span>
#include <vector>

#include "coarse/grid.hpp"

namespace terrainseg {

/// Writes to `lit` the cells of the training window that the rover's own shadow does not darken. A shadow is
/// detected when the cells form two kinds of luma with little between them and similar chroma, the lit kind
/// is at least half as bright again as the dark one and has 40 to 88 % of the cells, and it is less frequent
/// in the window's lower half, because the shadow begins at the rover. Returns false and leaves `lit`
/// unchanged when there is no such shadow. `window` is in cells of the grid.
bool leave_own_shadow(const Grid& grid, const Rectangle& window, std::span<const Cell> cells,
                      std::vector<Cell>& lit);

} // namespace terrainseg
