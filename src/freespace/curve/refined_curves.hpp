// SPDX-License-Identifier: LGPL-2.1-or-later
// The curves of one frame's ground at the picture's own edges.
#pragma once

#include "freespace/curve/frame_curves.hpp"
#include "freespace/curve/refinement.hpp"

namespace terrainseg {

struct Ground;
struct View;

class RefinedCurves {
 public:
  /// Refines the mask's columns.
  void refine(const View& view, const Ground& ground);
  /// A column per mask column.
  const FreeSpaceCurves& of_mask() const { return of_mask_; }
  /// A column per 2^level of the frame, of the ground that was refined.
  const FreeSpaceCurves& at(const View& view, const Ground& ground, int level);

 private:
  void refine(const View& view, const Ground& ground, int level, FreeSpaceCurves& curves);

  Refinement refinement_;
  FreeSpaceCurves of_mask_;
  FreeSpaceCurves finer_; ///< for small masks, whose columns are too few to search with
};

} // namespace terrainseg
