// SPDX-License-Identifier: LGPL-2.1-or-later
// What the default pipeline keeps from frame to frame.
#pragma once

#include "base/quantities.hpp"
#include "freespace/answer/horizon_row.hpp"
#include "freespace/holes/hole_finders.hpp"
#include "freespace/learn/window_guard.hpp"
#include "freespace/score/temporal.hpp"

namespace terrainseg {

/// Everything that outlives a frame, and nothing else: forgetting is `memory = {}`. What was learned is the
/// segmenter's Terrain.
struct Memory {
  LastPicture last;
  WindowGuard guard;
  CellScores average; ///< of the scores
  GridCurve boundary; ///< of the last frame; empty = none
  HorizonHold horizon;
  HoleMemory holes;
  FrameLine line; ///< the last that motion found: the mount keeps it while the rover stands and over cuts
};

} // namespace terrainseg
