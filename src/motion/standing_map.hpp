// SPDX-License-Identifier: LGPL-2.1-or-later
// Evidence of things that stand, gathered while they come nearer: a byte grid of 4 x 4 pixels a cell that
// moves with the ground.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "motion/parallax.hpp"
#include "motion/plane_motion.hpp"

namespace terrainseg {

/// What read() tells of a cell in which something stands is above this, Q8.
inline constexpr int least_standing = 15;

class StandingMap {
 public:
  void reset(int columns, int rows);
  /// Takes the evidence along: `step` maps this frame to the last one, seen in pixels of `view` (4 a cell).
  /// What was seen before fades to `keep` / 256.
  void move(const PlaneMotion& step, const GroundCamera& view, int keep);
  /// Evidence of a frame, of cells that were judged; it is the mean of eight frames at most.
  void add(std::span<const CellParallax> cells, std::span<const std::uint8_t> judged);
  /// Per cell evidence, Q8 (256 = certain), above least_standing where something stands: there it was above
  /// 17 once and not below 9 since, and two cells beside it stand as well. Below a run of such cells, down to
  /// where its foot must be, what the run has.
  void read(const GroundCamera& view, std::vector<std::int16_t>& standing);

 private:
  /// Sums, Q12: quality, frames, weight of the ratio, weighted ratio.
  struct Sum {
    std::int16_t quality = 0, count = 0, weight = 0, ratio = 0;
  };
  static Sum faded(const Sum& sum, int frames_q12);
  bool move_stood(int row, int first, int end);
  bool has_company(int row, int column) const;
  void fill_foot(const GroundCamera& view, int column, std::vector<std::int16_t>& standing) const;

  int columns_ = 0, rows_ = 0;
  std::vector<Sum> sums_, moved_;
  std::vector<std::int32_t> nodes_;
  std::vector<std::uint8_t> stood_, stood_before_; ///< per cell: whether it was told to stand
  std::vector<std::uint8_t> columns_stand_;
  /// Rows of sums before these are 0; rows in which cells may have stood.
  int first_filled_ = 0, first_filled_before_ = 0, first_stood_ = 0, end_stood_ = 0;
};

} // namespace terrainseg
