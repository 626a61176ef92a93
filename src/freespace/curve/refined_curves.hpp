// SPDX-License-Identifier: LGPL-2.1-or-later
// The curves of one frame's ground, aligned with edges of the picture.
#pragma once

#include "freespace/curve/frame_curves.hpp"
#include "freespace/curve/refinement.hpp"

namespace terrainseg {

struct Ground;
struct View;

class RefinedCurves {
 public:
  /// Refines the curves at the mask's columns.
  void refine(const View& view, const Ground& ground);
  /// One column per mask column.
  const FreeSpaceCurves& of_mask() const { return of_mask_; }
  /// One column per 2^level pixels of the frame, of the ground that was refined last.
  const FreeSpaceCurves& at(const View& view, const Ground& ground, int level);

 private:
  void refine(const View& view, const Ground& ground, int level, FreeSpaceCurves& curves);

  Refinement refinement_;
  FreeSpaceCurves of_mask_;
  FreeSpaceCurves finer_; ///< for small masks, whose columns are too coarse for detectors
};

} // namespace terrainseg
