// SPDX-License-Identifier: LGPL-2.1-or-later
// The ground of one frame.
#pragma once

#include "freespace/curve/reestimation.hpp"

namespace terrainseg {

/// In rows of the grid: the boundary, the first row of ground that is not doubtful, and the visible ground
/// behind obstacles.
struct Ground {
  GridCurve boundary, safe;
  GroundBehind behind;
};

} // namespace terrainseg
