// SPDX-License-Identifier: LGPL-2.1-or-later
// Obstacles from motion: plane and parallax below the boundary. What has the ground's colour but stands on it
// moves as ground further away would.
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

/// The pyramid level that motion is seen on: the first whose longer side is under 800 pixels.
int motion_level(int frame_width, int frame_height);

/// What is known of the ground's vanishing line from elsewhere.
struct MotionKnowledge {
  enum class Line : std::uint8_t {
    unknown, ///< motion finds it
    near,    ///< as a pose has level ground's: so it is, until motion sees that the ground slopes
    exact    ///< motion takes it as it is
  };
  Line line = Line::unknown;
  int vanishing_row = 0; ///< Q8 pixels of motion's level; may lie outside
};

/// What motion says after a frame.
struct MotionView {
  int columns = 0, rows = 0; ///< cells of 4 x 4 pixels of motion's level; 0 = the picture is too small
  /// Per cell, Q8: above least_standing something stands there, the surer the greater.
  std::span<const std::int16_t> standing;
  bool steady = false;                ///< whether the ground was followed into this frame
  bool trusted = false;               ///< whether this frame's evidence was added: the plane fits
  bool line_settled = false;          ///< whether the vanishing row is known or was found
  int vanishing_row = 0;              ///< Q8, pixels of motion's level
  int line_offset = 0;                ///< Q8, rows by which it lies below one that was told to be near
  std::int64_t speed_over_height = 0; ///< Q16, 1/s, forward positive; 0 while unknown
};

class MotionObstacles {
 public:
  /// One frame: `luma` is motion's level. `ground` says where ground is taken for ground by appearance (any
  /// size, stretched over the level, >= 128 = ground); the last frame's will do. `pts` in ns, -1 = unknown. A
  /// frame that follows within 45 ms (or, without times, every second one) is not looked at: the last answer
  /// stands.
  const MotionView& observe(const GrayView& luma, const GrayView& ground, std::int64_t pts,
                            const MotionKnowledge& knowledge = {});
  void forget(); ///< after a gap: the ground is searched anew, its vanishing line is kept

  /// Bytes of all pictures that are kept: tests hold their bound by it.
  std::size_t kept_bytes() const;

 private:
  struct KeyFrame {
    std::vector<std::uint8_t> pixels;
    PlaneMotion motion; ///< from this frame to it
    int age = 0;
  };
  struct Zone {
    int first = 0, end = 0; ///< rows of cells
    int key = -1;           ///< that it is compared with
  };

  void resize(int width, int height);
  void look(const GrayView& luma, const GrayView& ground);
  bool follow(std::int64_t pts);
  bool acquire(PlaneMotion& step);
  void chain();
  void choose_keys(std::array<Zone, 2>& zones);
  void judge(std::array<Zone, 2>& zones);
  void find_line(const std::array<Zone, 2>& zones);
  void move_line(int rows);
  void follow_line(const MotionKnowledge& knowledge);
  void keep_frame();
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
  MotionKnowledge told_; ///< with this frame
  int line_offset_ = 0;  ///< rows (Q8) by which the ground's own line lies below one that is near it
  std::vector<std::uint8_t> now_, before_, small_now_, small_before_, reduced_, ground_;
  std::vector<int> ground_columns_; ///< of the picture of ground, per cell
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
  int frames_passed_ = 0, failures_ = 0, coasted_ = 0, line_frames_ = 0;
  std::uint64_t frame_ = 0;
  std::int64_t pts_ = -1, interval_ = 0;
  std::int64_t line_weight_ = 0, line_sum_ = 0; ///< information, and information times rows (Q8)
  std::int64_t line_information_ = 0;           ///< of all estimates
  MotionView result_;
};

} // namespace terrainseg
