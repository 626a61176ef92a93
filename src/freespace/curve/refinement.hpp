// SPDX-License-Identifier: LGPL-2.1-or-later
// Aligns curves of the grid with edges of the picture two levels finer, and converts them to rows of the
// frame.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "base/color_transform.hpp"
#include "base/quantities.hpp"
#include "coarse/grid.hpp"
#include "coarse/pyramid.hpp"
#include "freespace/curve/frame_curves.hpp"
#include "kernels/cells.hpp"

namespace terrainseg {

class Refinement {
 public:
  /// Must be called before the curves of another picture.
  void start() { asked_.clear(); }
  /// `curve`: per grid column the first row of the ground, 0..grid.height. With `snap` the sides of things
  /// (see sharpen_sides()) and then the curve itself move to the strongest colour edges at
  /// refinement_level(), the curve by at most three quarters of a cell; then a median of five columns is
  /// applied. `rows` receives the first row of the ground in the frame, 0..frame_height, for each column of a
  /// mask that is 2^mask_level times narrower than the frame.
  void refine(const Pyramid& pyramid, const Grid& grid, const ColorTransform& transform,
              const GridCurve& curve, bool snap, int mask_level, int frame_width, int frame_height,
              FrameCurve& rows);

 private:
  void interpolate(const Grid& grid, const GridCurve& curve, int width, int height);
  void sharpen_sides(const Pyramid& pyramid, const ColorTransform& transform, const Grid& grid,
                     const GridCurve& curve);
  /// By column of a side's box.
  using Crossings = std::array<int, kernels::strip_rows>;
  void count_crossings(const Pyramid& pyramid, const ColorTransform& transform, int level, int ratio,
                       const Rectangle& box, Crossings& crossings);
  bool ask(int first, int end);
  void snap_columns(const Pyramid& pyramid, const ColorTransform& transform, int level, int first, int end);
  void take_medians();
  void write_rows(int level, int height, int mask_level, int frame_width, int frame_height,
                  FrameCurve& rows) const;

  // Doubled rows of the refinement's level, so that half rows are integers.
  std::vector<int> fine_, median_;
  std::vector<std::uint8_t> moves_;  ///< whether a column may move
  std::vector<int> asked_, snapped_; ///< of the curve before: 2 * fine_ + moves_, and what it was moved to
  kernels::Strip strip_{};
};

// Finds doubtful ground next to the boundary: cells that do not look like ground and are below the boundary
// only because it is smooth.

/// This limit and lower ones disable the stage.
inline constexpr int doubtful_off = -96;

/// Walks down from the boundary in each column while the mean of the score (Q4) over 3x3 cells, weighted
/// 1-2-1 in both directions, is below `limit` (32 = 1 nat). `safe` (grid.width values, >= boundary) receives
/// the first row that is not doubtful. In towns half of the unsafe pixels are within two cells of an
/// obstacle's base. A walk from the boundary therefore works, a threshold over the whole area does not.
void walk_doubtful(const Grid& grid, const CellScores& score, int limit, const GridCurve& boundary,
                   GridCurve& safe);

// The curves of one frame's ground, aligned with edges of the picture.

struct Ground;
struct View;

class RefinedCurves {
 public:
  /// Refines the curves at the mask's columns.
  void refine(const View& view, const Ground& ground);
  /// One column per mask column.
  const FreeSpaceCurves& of_mask() const { return of_mask_; }
  /// One column per 2^level pixels of the frame, of the ground that was refined last. Made at the first call
  /// for a level; later calls only read, for at most two levels besides the mask's.
  const FreeSpaceCurves& at(const View& view, const Ground& ground, int level);

 private:
  void refine(const View& view, const Ground& ground, int level, FreeSpaceCurves& curves);

  Refinement refinement_;
  FreeSpaceCurves of_mask_;
  /// For small masks, whose columns are too coarse for detectors.
  std::array<FreeSpaceCurves, 2> finer_{};
  std::size_t finer_made_ = 0;
};

} // namespace terrainseg
