// SPDX-License-Identifier: LGPL-2.1-or-later
// The state that the default pipeline keeps between frames.
#pragma once

#include "base/quantities.hpp"
#include "freespace/answer/free_space.hpp"
#include "freespace/holes/hole_finders.hpp"
#include "freespace/learn/window_teacher.hpp"
#include "freespace/score/temporal.hpp"

namespace terrainseg {

/// The complete state between frames: `memory = {}` resets the pipeline. The learned terrain is the
/// segmenter's Terrain.
struct Memory {
  LastPicture last;
  WindowMemory window;
  CellScores average; ///< running average of the scores
  GridCurve boundary; ///< boundary of the last frame; empty = none
  HorizonHold horizon;
  HoleMemory holes;
};

} // namespace terrainseg
