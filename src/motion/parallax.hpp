// SPDX-License-Identifier: LGPL-2.1-or-later
// Does a cell move as ground does, or as something that stands on it? The ground's motion since a key frame
// says where a cell would have been as ground; a thing of height h under a camera of height H lies further
// along the ground's own translation, by r = h / (H - h) of it.
#pragma once

#include <cstdint>
#include <vector>

#include "motion/alignment.hpp"
#include "motion/plane_motion.hpp"

namespace terrainseg {

/// What one pair of frames says of a cell of 4 x 4 pixels.
struct CellParallax {
  std::int16_t quality = 0; ///< Q12: > 0 moves as something that stands, < 0 as ground
  std::int16_t ratio = 0;   ///< Q12: r of the best standing hypothesis
};

/// Length of the ground's translation between two frames at a pixel, Q8 of a pixel.
int ground_shift(const PlaneMotion& motion, const GroundCamera& view, int across, int below);

class Parallax {
 public:
  /// Room for pictures of that size, so that later calls need none.
  void reserve(int width, int height);

  /// Rows first .. end - 1 of cells; a cell is judged where `ground` (a byte a cell) is not 0 and both frames
  /// show it, the others keep what they are. `judged` is set to 1 where a cell was.
  void compare(const PassedView& picture, const PassedView& key, const PlaneMotion& motion,
               const GroundCamera& view, const std::uint8_t* ground, int first, int end,
               std::vector<CellParallax>& cells, std::vector<std::uint8_t>& judged);

 private:
  void warp(const PassedView& key, const PlaneMotion& motion, const GroundCamera& view, int first, int end);
  int place(const Translation& t, const GroundCamera& view, int left, int down, std::ptrdiff_t at,
            std::int32_t* offsets) const;
  void compare_row(const PassedView& picture, const Translation& t, const GroundCamera& view,
                   const std::uint8_t* ground, int row, int first);
  void weigh_row(const std::uint8_t* ground, int row, int rows, CellParallax* cells, std::uint8_t* judged);

  int columns_ = 0, rows_ = 0;
  int above_ = 0; ///< rows that are warped above the first row of cells
  std::ptrdiff_t stride_ = 0;
  std::vector<std::int32_t> nodes_;
  std::vector<std::uint8_t> warped_, near_;
  std::vector<std::uint16_t> sums_;   ///< per row of cells, hypothesis and cell; a cell more at both ends
  std::vector<std::uint16_t> seen_;   ///< per row and cell: 1 where the sums say something
  std::vector<std::uint16_t> shifts_; ///< per cell, Q4 of a pixel; 0 = not compared
  std::vector<std::uint16_t> costs_;  ///< of a row, and work
};

} // namespace terrainseg
