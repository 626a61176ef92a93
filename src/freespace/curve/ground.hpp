// SPDX-License-Identifier: LGPL-2.1-or-later
// Where the ground of one frame ends.
#pragma once

#include "freespace/curve/ground_behind.hpp"

namespace terrainseg {

/// What the picture says, in rows of the grid: where the ground begins, where it does without doubt, and what
/// of it is seen behind obstacles.
struct Ground {
  GridCurve boundary, safe;
  GroundBehind behind;
};

} // namespace terrainseg
