// SPDX-License-Identifier: LGPL-2.1-or-later
// Evidence of one frame's cells for and against ground.
#pragma once

#include "base/quantities.hpp"
#include "freespace/look/connected_ground.hpp"

namespace terrainseg {

struct Scores {
  const CellScores& average; ///< over the frames that show the same place
  const CellPenalties& penalty;
  const ColorSteps& steps;
};

} // namespace terrainseg
