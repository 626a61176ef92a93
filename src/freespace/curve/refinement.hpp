// SPDX-License-Identifier: LGPL-2.1-or-later
// Aligns curves of the grid with edges of the picture two levels finer, and converts them to rows of the
// frame.
#pragma once

#include <cstdint>
#include <vector>

#include "base/color_transform.hpp"
#include "base/quantities.hpp"
#include "coarse/grid.hpp"
#include "coarse/pyramid.hpp"
#include "kernels/cells.hpp"

namespace terrainseg {

class Refinement {
 public:
  /// `curve`: per grid column the first row of the ground, 0..grid.height. With `snap` the curve moves to the
  /// strongest colour edge within three quarters of a cell at refinement_level(), then a median of five
  /// columns is applied. `rows` receives the first row of the ground in the frame, 0..frame_height, for each
  /// column of a mask that is 2^mask_level times narrower than the frame.
  void refine(const Pyramid& pyramid, const Grid& grid, const ColorTransform& transform,
              const GridCurve& curve, bool snap, int mask_level, int frame_width, int frame_height,
              FrameCurve& rows);

 private:
  void interpolate(const Grid& grid, const GridCurve& curve, int width, int height);
  void snap_columns(const Pyramid& pyramid, const ColorTransform& transform, int level, int first, int end);
  void take_medians();
  void write_rows(int level, int height, int mask_level, int frame_width, int frame_height,
                  FrameCurve& rows) const;

  // Doubled rows of the refinement's level, so that half rows are integers.
  std::vector<int> fine_, median_;
  std::vector<std::uint8_t> moves_; ///< whether a column may move
  kernels::Strip strip_{};
};

} // namespace terrainseg
