// SPDX-License-Identifier: LGPL-2.1-or-later
// Decides whether a cell moves as ground or as an obstacle that stands on it. The ground's motion since a key
// frame predicts the earlier position of a cell that is ground. A point at height h under a camera at height
// H is displaced from there along the ground's translation, by r = h / (H - h) of its length.
#pragma once

#include <cstdint>
#include <vector>

#include "motion/alignment.hpp"
#include "motion/plane_motion.hpp"

namespace terrainseg {

/// Result of one pair of frames for a cell of 4 x 4 pixels.
struct CellParallax {
  std::int16_t quality = 0; ///< Q12: > 0 moves as a standing obstacle, < 0 moves as ground
  std::int16_t ratio = 0;   ///< Q12: r of the best hypothesis of a standing obstacle
};

/// Length of the ground's translation between two frames at a pixel, in Q8 of a pixel.
int ground_shift(const PlaneMotion& motion, const GroundCamera& view, int across, int below);

/// Part of the picture that is compared with one key frame. When the camera drives forward, ground y pixels
/// below the vanishing line and x beside the middle moves in proportion to y sqrt(x^2 + y^2). The near zone
/// holds what moves at least as far as the middle of `near_row`, the far zone the rest.
struct MotionZone {
  int first = 0, end = 0; ///< rows of cells
  int near_row = 0;       ///< pixels below the vanishing line
  bool near = false;
  /// The square of the least x of the near zone, y pixels below the vanishing line.
  std::int64_t near_from(int y) const;
};

class Parallax {
 public:
  /// Takes the size of all pictures. Only this function allocates.
  void resize(int width, int height);

  /// Compares the cells of a zone. A cell is judged where `ground` (one byte per cell) is not 0 and both
  /// frames show it; `judged` is set to 1 there. Other cells remain unchanged.
  void compare(const PassedView& picture, const PassedView& key, const PlaneMotion& motion,
               const GroundCamera& view, const std::uint8_t* ground, const MotionZone& zone,
               std::vector<CellParallax>& cells, std::vector<std::uint8_t>& judged);

 private:
  void warp(const PassedView& key, const PlaneMotion& motion, const GroundCamera& view, int first, int end);
  int place(const Translation& t, const GroundCamera& view, int left, int down, std::ptrdiff_t at,
            std::int32_t* offsets) const;
  void compare_row(const PassedView& picture, const Translation& t, const GroundCamera& view,
                   const std::uint8_t* ground, int row, const MotionZone& zone);
  void weigh_row(const std::uint8_t* ground, int row, int rows, CellParallax* cells, std::uint8_t* judged);

  int columns_ = 0, rows_ = 0;
  int segments_ = 0; ///< of 16 pixels, in a warped row
  int above_ = 0;    ///< number of warped rows above the first row of cells
  std::ptrdiff_t stride_ = 0;
  std::vector<std::int32_t> nodes_, across_;
  std::vector<std::uint8_t> warped_, near_;
  std::vector<std::uint16_t> sums_;   ///< per row of cells, hypothesis and cell, with one more cell at each
                                      ///< end, and an empty row
  std::vector<std::uint16_t> seen_;   ///< per row and cell, likewise: 1 where the sums are valid
  std::vector<std::uint16_t> shifts_; ///< per cell, Q4 of a pixel; 0 = not compared
  std::vector<std::uint16_t> costs_;  ///< costs of a row, and working memory
};

} // namespace terrainseg
