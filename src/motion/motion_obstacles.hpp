// SPDX-License-Identifier: LGPL-2.1-or-later
// Detects obstacles by motion (plane and parallax) below the boundary. An obstacle of the ground's colour
// moves in the picture as ground farther away would.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "motion/alignment.hpp"
#include "motion/parallax.hpp"
#include "motion/plane_motion.hpp"
#include "motion/standing_map.hpp"
#include "terrainseg/frame.hpp"

namespace terrainseg {

/// The pyramid level for motion: the first whose longer side is less than 800 pixels.
int motion_level(int frame_width, int frame_height);

/// What is known about the ground's vanishing line before motion is measured.
struct MotionKnowledge {
  enum class Line : std::uint8_t {
    unknown, ///< motion estimates the line
    near,    ///< the line of level ground from a pose: used until motion measures a slope of the ground
    exact    ///< motion uses the line unchanged
  };
  Line line = Line::unknown;
  int vanishing_row = 0; ///< Q8 pixels of motion's level; may lie outside the picture
};

/// The result of motion for one frame.
struct MotionView {
  int columns = 0, rows = 0; ///< number of cells of 4 x 4 pixels of motion's level; 0 = the picture is too
                             ///< small
  /// Per cell, Q8: something stands there when it is above least_standing; higher is more certain.
  std::span<const std::int16_t> standing;
  bool steady = false;                ///< whether the motion of the ground into this frame was found
  bool trusted = false;               ///< whether this frame's evidence was added, because the plane fits
  bool line_settled = false;          ///< whether the vanishing row is known or was estimated
  int vanishing_row = 0;              ///< Q8 pixels of motion's level
  int line_offset = 0;                ///< Q8 rows from the line of MotionKnowledge::Line::near down to the
                                      ///< measured line
  std::int64_t speed_over_height = 0; ///< forward speed in camera heights, Q16 1/s; 0 while unknown
};

class MotionObstacles {
 public:
  /// Processes one frame. `luma` is motion's level. `ground` marks the ground by appearance (any size,
  /// stretched over the level, >= 128 = ground); that of the last frame is sufficient. `pts` is in ns, -1 =
  /// unknown. A frame that follows within half_rate_interval (without times: every second frame) is skipped
  /// and the last result returned; likewise three of four frames after the ground's motion was not found 16
  /// times in a row.
  const MotionView& observe(const GrayView& luma, const GrayView& ground, std::int64_t pts,
                            const MotionKnowledge& knowledge = {});
  void forget(); ///< after a gap in time: restarts the tracking, keeps the vanishing line

  /// Size of all stored pictures in bytes, for the tests of its limit.
  std::size_t kept_bytes() const;

 private:
  struct KeyFrame {
    std::vector<std::uint8_t> pixels;
    PlaneMotion motion; ///< from the current frame to the key frame
    int age = 0;
  };
  struct Zone : MotionZone {
    int key = -1; ///< index of the key frame for comparison; -1 = none
  };

  void resize(int width, int height);
  void look(const GrayView& luma, const GrayView& ground);
  bool follow(std::int64_t pts);
  std::int64_t left_by(PlaneMotion& motion, int iterations, const Residual& still);
  bool acquire(PlaneMotion& step, const Residual& still);
  void choose_keys(std::array<Zone, 2>& zones);
  void judge(std::array<Zone, 2>& zones);
  void find_line(const std::array<Zone, 2>& zones);
  void move_line(int rows);
  void follow_line(const MotionKnowledge& knowledge);
  void keep_frame();
  void touch_ground(const std::vector<std::uint8_t>& pixels) const;
  int middle_shift(const PlaneMotion& motion, int q8_of_rows) const;
  int target_shift() const { return 16 * 256 * view_.width / 480; } ///< Q8
  PassedView passed(const std::vector<std::uint8_t>& pixels) const {
    return {pixels.data(), view_.width, view_.height};
  }
  PassedView small_passed(const std::vector<std::uint8_t>& pixels) const {
    return {pixels.data(), view_.width / 4, view_.height / 4};
  }
  void lose();

  GroundCamera view_;
  MotionKnowledge told_; ///< for the current frame
  int line_offset_ = 0;  ///< Q8 rows from the line in `told_` down to the measured line
  std::vector<std::uint8_t> now_, before_, small_now_, small_before_, reduced_, ground_;
  std::vector<int> ground_columns_; ///< per cell the column of the `ground` picture
  std::vector<std::uint16_t> work_;
  GroundPoints points_, small_points_, zone_points_;
  PointSelection selection_;
  Alignment alignment_;
  Parallax parallax_;
  StandingMap map_;
  std::vector<CellParallax> cells_;
  std::vector<std::uint8_t> judged_;
  std::vector<std::int16_t> standing_;
  std::vector<KeyFrame> keys_, spare_;
  PlaneMotion step_;
  bool has_before_ = false, moving_ = false;
  int frames_passed_ = 0, failures_ = 0, frames_to_rest_ = 0, coasted_ = 0, line_frames_ = 0;
  std::uint64_t frame_ = 0;
  std::int64_t pts_ = -1, interval_ = 0;
  std::int64_t line_weight_ = 0, line_sum_ = 0; ///< information, and information times rows (Q8)
  std::int64_t line_information_ = 0;           ///< total of all estimates
  MotionView result_;
};

} // namespace terrainseg
