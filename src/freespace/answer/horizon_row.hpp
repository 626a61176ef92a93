// SPDX-License-Identifier: LGPL-2.1-or-later
// The horizon as the free space shows it: where its upper end lies.
#pragma once

#include <cstdint>
#include <vector>

#include "base/quantities.hpp"

namespace terrainseg {

struct HorizonRow {
  int row = -1; ///< of the frame; -1 = none
  std::uint8_t confidence = 0;
  bool held = false; ///< an earlier frame's
};

/// Uppermost row of the ground, less outliers, from a curve in frame rows per mask column. None where the
/// curve touches the top or the bottom, or separates nothing that differs (a wall, a turn over unknown
/// ground), which a low `mask_confidence` tells.
HorizonRow horizon_of(const FrameCurve& boundary, int grid_level, int mask_level, int frame_height,
                      std::uint8_t mask_confidence, std::vector<std::uint16_t>& scratch);

/// Keeps the last horizon over frames that show none: a wall, a turn, a view of nothing but ground.
class HorizonHold {
 public:
  /// What a frame has `seen`; or where it has seen nothing and `continued` the frame before, the last row,
  /// half as sure with each such frame, until nothing is left of it.
  HorizonRow follow(const HorizonRow& seen, bool continued);

 private:
  HorizonRow last_;
};

} // namespace terrainseg
