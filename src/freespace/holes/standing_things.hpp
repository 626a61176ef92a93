// SPDX-License-Identifier: LGPL-2.1-or-later
// What motion says of the ground that the curves tell: holes in the mask where something stands, and how the
// camera moves over the ground.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "base/frame_line.hpp"
#include "coarse/pyramid.hpp"
#include "freespace/curve/frame_curves.hpp"
#include "freespace/holes/hole.hpp"
#include "motion/motion_obstacles.hpp"
#include "terrainseg/frame.hpp"

namespace terrainseg {

/// What the curves and the pyramid are of.
struct CurvesOfFrame {
  int grid_level = 0; ///< coarsest level of the pyramid
  int mask_level = 0; ///< the curves have a column per 2^this of the frame
  std::int64_t pts = -1;
  std::span<const Rectangle> ignored; ///< frame pixels
  FrameLine line;                     ///< what is known of the ground's, from elsewhere
};

/// What motion knows from frame to frame.
struct MotionTrack {
  MotionObstacles motion;
  FrameLine line;         ///< of the last frame, once motion has found it
  int line_offset = 0;    ///< Q8 rows by which it lies below one that a pose tells
  std::int32_t speed = 0; ///< forward, over the camera's height, Q16 1/s; 0 = still or unknown
};

class StandingThings {
 public:
  /// Level of the coarsest columns that say where the ground of a cell ends; curves that are coarser say
  /// something else.
  static int coarsest_columns(const Pyramid& pyramid, int grid_level);

  /// Follows the ground that `curves` tell into this frame, and lists what stands on it. False where nothing
  /// does.
  bool find(const Pyramid& pyramid, const FreeSpaceCurves& curves, const CurvesOfFrame& of,
            MotionTrack& track, std::vector<Hole>& holes);

  /// Of the last find(): evidence in cells of 4 x 4 pixels of motion's level, Q8: above 15 something stands,
  /// the surer the greater; below 0 a cell moves as the ground does. Empty while motion is not looked at.
  FinerCells<std::int16_t> evidence() const;

 private:
  void list(int row, int frame_width, int frame_height, std::vector<Hole>& holes) const;
  void outline_ground(const FreeSpaceCurves& curves, const CurvesOfFrame& of, int width, int height);

  int level_ = 0, columns_ = 0, rows_ = 0;
  std::vector<std::uint8_t> ground_, stands_;                   ///< per cell
  std::vector<std::uint16_t> safe_, behind_first_, behind_end_; ///< per column, rows of cells
  std::span<const std::int16_t> evidence_;                      ///< per cell, in memory of the track's
};

} // namespace terrainseg
