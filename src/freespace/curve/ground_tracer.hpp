// SPDX-License-Identifier: LGPL-2.1-or-later
// Finds the ground of a frame.
#pragma once

#include "base/frame_line.hpp"
#include "freespace/curve/boundary.hpp"
#include "freespace/curve/reestimation.hpp"
#include "freespace/score/cell_scorer.hpp"

namespace terrainseg {

struct View;

class GroundTracer {
 public:
  /// Searches the boundary, repeats the search with this frame's appearance on both sides of it, then finds
  /// ground behind obstacles and doubtful ground. No ground is above `first_row` or far above `end`, the end
  /// of the ground plane. `last` is the boundary of the previous frame and is replaced by this one. Updates
  /// `slow_horizon` (Q8 of the height).
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
