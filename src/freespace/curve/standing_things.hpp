// SPDX-License-Identifier: LGPL-2.1-or-later
// What motion says of the ground that the curves tell: holes in the mask where something stands, and how the
// camera moves over the ground.
#pragma once

#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "coarse/pyramid.hpp"
#include "freespace/curve/evidence.hpp"
#include "freespace/curve/free_space.hpp"
#include "motion/motion_obstacles.hpp"
#include "terrainseg/frame.hpp"

namespace terrainseg {

/// What the curves and the pyramid are of.
struct CurvesOfFrame {
  int grid_level = 0; ///< coarsest level of the pyramid
  int mask_level = 0; ///< the curves have a column per 2^this of the frame
  std::int64_t pts = -1;
  std::span<const Rectangle> ignored; ///< frame pixels
  MotionKnowledge line;               ///< Q8 rows of the frame
};

class StandingThings {
 public:
  /// Level of the coarsest columns that say where the ground of a cell ends; curves that are coarser say
  /// something else.
  static int coarsest_columns(const Pyramid& pyramid, int grid_level);

  /// Follows the ground that `curves` tell into this frame. False where nothing stands on it.
  bool find(const Pyramid& pyramid, const FreeSpaceCurves& curves, const CurvesOfFrame& of);

  /// Lowers curve rows (of the frame, one per mask column) to below the lowest cell of their column in which
  /// something stands.
  void lower(int mask_level, FrameCurve& rows) const;

  /// Makes traversable pixels where something stands not traversable; returns how many.
  std::uint64_t mark(const MutablePlane& mask, int width, int height, int mask_level) const;

  /// Of the last find() since forget(): row of the ground's vanishing line, Q16 rows of the frame, -1 =
  /// unknown.
  std::int32_t vanishing_row() const { return vanishing_row_; }
  /// How far the ground's own line lies below the one that was told to be near it, Q8 rows of the frame.
  int line_offset() const { return line_offset_; }
  /// Forward speed over the camera's height, Q16 1/s; 0 = still or unknown.
  std::int32_t speed_over_height() const { return speed_; }

  /// Of the last find(): evidence in cells of 4 x 4 pixels of motion's level, Q8: above 15 something stands,
  /// the surer the greater; below 0 a cell moves as the ground does. Empty while motion is not looked at.
  FinerCells<std::int16_t> evidence() const;

  void forget(); ///< everything: another camera may follow

 private:
  std::pair<int, int> columns_of(int column, int mask_level, int width) const;
  void outline_ground(const FreeSpaceCurves& curves, const CurvesOfFrame& of, int width, int height);

  MotionObstacles motion_;
  int level_ = 0, columns_ = 0, rows_ = 0;
  int first_row_ = 0, end_row_ = 0;                             ///< rows of cells in which something stands
  std::vector<std::uint8_t> ground_, stands_;                   ///< per cell
  std::vector<std::uint16_t> safe_, behind_first_, behind_end_; ///< per column, rows of cells
  std::span<const std::int16_t> evidence_;                      ///< per cell, in memory of motion's
  std::int32_t vanishing_row_ = -1, speed_ = 0;
  int line_offset_ = 0;
};

} // namespace terrainseg
