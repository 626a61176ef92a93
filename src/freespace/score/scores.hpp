// SPDX-License-Identifier: LGPL-2.1-or-later
// What the cells of one frame say for the ground and against it.
#pragma once

#include "base/quantities.hpp"
#include "freespace/look/color_steps.hpp"

namespace terrainseg {

struct Scores {
  const CellScores& average; ///< over the frames that show the same
  const CellPenalties& penalty;
  const ColorSteps& steps;
};

} // namespace terrainseg
