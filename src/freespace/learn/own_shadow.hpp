// SPDX-License-Identifier: LGPL-2.1-or-later
// The rover's own shadow, or a dark part of it, in the training window.
#pragma once

#include <span>
#include <vector>

#include "coarse/grid.hpp"

namespace terrainseg {

/// Leaves the cells of the training window that the rover's own shadow does not darken: where they fall into
/// two kinds of luma with little between them, of about the same chroma, the lit kind half as bright again as
/// the dark one, 40 % of the cells at least and 88 at most, and seen less at the window's lower half - for
/// the shadow begins at the rover. False, and `lit` as it was, where there is no such shadow. `window` in
/// cells of the grid.
bool leave_own_shadow(const Grid& grid, const Rectangle& window, std::span<const Cell> cells,
                      std::vector<Cell>& lit);

} // namespace terrainseg
