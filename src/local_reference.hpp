// SPDX-License-Identifier: LGPL-2.1-or-later
// A reference colour per column that climbs from the window's colour up the rows.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "coarse.hpp"

namespace terrainseg {

/// It follows light and perspective, and stays behind where the colour breaks: at a car's base, say. No state
/// between frames.
class LocalReference {
 public:
  /// Penalty of each cell, 0..36 (32 = 1 nat), into `penalty`. `start` is the window's mean Y U V, Q4; `gain`
  /// the exposure's, Q8.
  void climb(const CoarseGrid& grid, const std::array<int, 3>& start, int gain,
             std::vector<std::int8_t>& penalty);

 private:
  std::array<std::vector<std::int32_t>, 3> reference_, smooth_;
};

} // namespace terrainseg
