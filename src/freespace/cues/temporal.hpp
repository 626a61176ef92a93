// SPDX-License-Identifier: LGPL-2.1-or-later
// Averaging of scores over neighbouring frames.
#pragma once

#include <cstdint>
#include <vector>

#include "base/quantities.hpp"
#include "coarse/grid.hpp"
#include "terrainseg/settings.hpp"

namespace terrainseg {

/// Tells moving pictures from pictures that follow one another by jumps, and averages scores over the former.
class ScoreAverage {
 public:
  void forget();
  /// Whether this frame continues the last one: `mode` decides, or (automatic) the picture shows much the
  /// same and the time between them, where known, is two seconds at most. `pts` in nanoseconds, -1
  /// = unknown.
  bool continues(const Grid& grid, std::int64_t pts, Temporal mode);
  /// `average` (Q4) moves towards `score` (Q4) by three quarters, or becomes it when the frame does not
  /// continue.
  void add(const CellScores& score, bool continued, CellScores& average) const;

 private:
  std::vector<std::uint8_t> luma_, last_; ///< of this frame, while it is looked at, and of the last one
  std::int64_t last_pts_ = -1;
};

} // namespace terrainseg
