// SPDX-License-Identifier: LGPL-2.1-or-later
// Curves between the ground and the rest of the frame.
#pragma once

#include "base/quantities.hpp"

namespace terrainseg {

/// Curves per column in rows of the frame. `boundary` is the first row of the ground, `safe` the first
/// row of ground that is not doubtful. With `ground_behind` the rows behind_first .. behind_end - 1 above the
/// boundary are ground too.
struct FreeSpaceCurves {
  int level = 0; ///< one column per 2^level pixels of the frame
  FrameCurve boundary, safe;
  bool ground_behind = false;
  FrameCurve behind_first, behind_end;
};

} // namespace terrainseg
