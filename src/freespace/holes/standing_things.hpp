// SPDX-License-Identifier: LGPL-2.1-or-later
// Applies motion to the ground given by the curves: finds holes in the mask where an obstacle stands, and the
// motion of the camera over the ground.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "base/quantities.hpp"
#include "coarse/pyramid.hpp"
#include "freespace/curve/frame_curves.hpp"
#include "freespace/holes/hole.hpp"
#include "motion/motion_obstacles.hpp"
#include "terrainseg/frame.hpp"

namespace terrainseg {

/// Relation of the curves to the frame and the pyramid.
struct CurvesOfFrame {
  int grid_level = 0; ///< the coarsest level of the pyramid
  std::int64_t pts = -1;
  std::span<const Rectangle> ignored; ///< in pixels of the frame
  FrameLine line;                     ///< the vanishing line of the ground from a setting, a pose or a hint
};

/// The state of motion between frames.
struct MotionTrack {
  MotionObstacles motion;
  FrameLine line;         ///< the vanishing line of the last frame, when motion has found it
  int line_offset = 0;    ///< Q8 rows from a pose's line down to the measured line
  std::int32_t speed = 0; ///< forward speed in camera heights, Q16 1/s; 0 = still or unknown
};

class StandingThings {
 public:
  /// The level of the coarsest columns that give a cell's ground exactly. Coarser curves would change the
  /// result.
  static int coarsest_columns(const Pyramid& pyramid, int grid_level);

  /// Tracks the ground given by `curves` into this frame, and lists the obstacles that stand on it. Returns
  /// false when there are none.
  bool find(const Pyramid& pyramid, const FreeSpaceCurves& curves, const CurvesOfFrame& of,
            MotionTrack& track, std::vector<Hole>& holes);

  /// Evidence of the last find() in cells of 4 x 4 pixels of motion's level, Q8. Above 15 something stands,
  /// and higher is more certain; below 0 the cell moves as the ground does. Empty while motion is off.
  FinerCells<std::int16_t> evidence() const;

 private:
  void list(int row, int frame_width, int frame_height, std::vector<Hole>& holes) const;
  void outline_ground(const FreeSpaceCurves& curves, const CurvesOfFrame& of, int width, int height);

  int level_ = 0, columns_ = 0, rows_ = 0;
  std::vector<std::uint8_t> ground_, stands_;                   ///< per cell
  std::vector<std::uint16_t> safe_, behind_first_, behind_end_; ///< per column, in rows of cells
  std::span<const std::int16_t> evidence_;                      ///< per cell, in memory of the MotionTrack
};

} // namespace terrainseg
