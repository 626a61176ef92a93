// SPDX-License-Identifier: LGPL-2.1-or-later
// Searches where the ground of a frame ends.
#pragma once

#include "base/frame_line.hpp"
#include "freespace/curve/boundary.hpp"
#include "freespace/curve/ground.hpp"
#include "freespace/curve/reestimation.hpp"
#include "freespace/score/scores.hpp"

namespace terrainseg {

struct View;

class GroundTracer {
 public:
  /// Searches the boundary, once more with what the frame itself looks like on both its sides, the ground
  /// behind obstacles and the doubtful ground before them. No ground lies above `first_row` nor far above
  /// `end`, the end of the plane. `last` is the boundary of the frame before, and becomes this one's;
  /// `slow_horizon` (Q8 of the height) follows it.
  const Ground& trace(const View& view, const Scores& scores, int first_row, const FrameLine& end,
                      bool continued, GridCurve& last, std::uint32_t& slow_horizon);

 private:
  void search(const View& view, const Scores& scores, const FrameLine& end, std::uint32_t& slow_horizon);

  BoundarySearch search_;
  RowPriors prior_;
  Reestimation reestimation_;
  CellScores revised_;
  GroundBehindSearch behind_search_;
  std::vector<std::uint16_t> scratch_;
  Ground ground_;
};

} // namespace terrainseg
