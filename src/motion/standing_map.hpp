// SPDX-License-Identifier: LGPL-2.1-or-later
// Accumulates the evidence of standing obstacles while they come nearer, in a grid of 4 x 4 pixels per cell
// that moves with the ground.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "motion/parallax.hpp"
#include "motion/plane_motion.hpp"

namespace terrainseg {

/// read() reports values above this for cells in which something stands, Q8.
inline constexpr int least_standing = 15;

class StandingMap {
 public:
  void reset(int columns, int rows);
  /// Moves the evidence into the current frame: `step` maps this frame to the last one, in pixels of `view`
  /// (4 per cell). Multiplies earlier evidence by `keep` / 256.
  void move(const PlaneMotion& step, const GroundCamera& view, int keep);
  /// Adds a frame's evidence for the judged cells. The evidence is the mean of at most eight frames.
  void add(std::span<const CellParallax> cells, std::span<const std::uint8_t> judged);
  /// Per cell evidence, Q8 (256 = certain). It is above least_standing where something stands: there it once
  /// exceeded 17 and has not fallen below 9 since, and two neighbouring cells stand too. Cells below a run of
  /// such cells, down to the foot of the obstacle, get the evidence of the run.
  void read(const GroundCamera& view, std::vector<std::int16_t>& standing);

 private:
  /// Sums, Q12: quality, number of frames, weight of the ratio, weighted ratio.
  struct Sum {
    std::int16_t quality = 0, count = 0, weight = 0, ratio = 0;
  };
  static Sum faded(const Sum& sum, int frames_q12);
  bool move_stood(int row, int first, int end);
  bool has_company(int row, int column) const;
  void fill_foot(const GroundCamera& view, int column, std::vector<std::int16_t>& standing) const;

  int columns_ = 0, rows_ = 0;
  std::vector<Sum> sums_, moved_;
  std::vector<std::int32_t> nodes_, across_;
  std::vector<std::uint8_t> stood_, stood_before_; ///< per cell: whether it was reported as standing
  std::vector<std::uint8_t> columns_stand_;
  /// Rows before these have sums of 0; rows whose cells may stand.
  int first_filled_ = 0, first_filled_before_ = 0, first_stood_ = 0, end_stood_ = 0;
};

} // namespace terrainseg
