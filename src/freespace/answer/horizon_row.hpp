// SPDX-License-Identifier: LGPL-2.1-or-later
// The horizon row, from the upper end of the free space.
#pragma once

#include <cstdint>
#include <vector>

#include "base/quantities.hpp"

namespace terrainseg {

struct HorizonRow {
  int row = -1; ///< row of the frame; -1 = not found
  std::uint8_t confidence = 0;
  bool held = false; ///< the row of an earlier frame
};

/// The uppermost row of the ground without outliers, from a curve in rows of the frame per mask column. Not
/// found when the curve touches the top or the bottom, or when a low `mask_confidence` shows that it
/// separates nothing (a wall, a turn over unknown ground).
HorizonRow horizon_of(const FrameCurve& boundary, int grid_level, int mask_level, int frame_height,
                      std::uint8_t mask_confidence, std::vector<std::uint16_t>& scratch);

/// Keeps the last horizon over frames without one: a wall, a turn, a view of ground only.
class HorizonHold {
 public:
  /// Returns the horizon `seen` in a frame. When it has none and the last frame is `continued`, returns the
  /// last row with half of the confidence, until the confidence is 0.
  HorizonRow follow(const HorizonRow& seen, bool continued);

 private:
  HorizonRow last_;
};

} // namespace terrainseg
