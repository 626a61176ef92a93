// SPDX-License-Identifier: LGPL-2.1-or-later
// Small things that stand in the open, from one frame: one curve a column swallows them. A centre is compared
// with its surroundings on both sides (local contrast as in L. Itti, C. Koch, E. Niebur, "A model of
// saliency-based visual attention", IEEE PAMI 20, 1998, here in standard deviations of the ground itself).
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "base/color_transform.hpp"
#include "coarse/pyramid.hpp"
#include "freespace/curve/frame_curves.hpp"
#include "freespace/holes/candidate_cells.hpp"
#include "freespace/holes/ground_outline.hpp"
#include "freespace/holes/hole.hpp"

namespace terrainseg {

/// What the search has to know of the picture.
struct GroundView {
  int level = 0;             ///< of the pyramid that is searched, finer than the grid by one or two
  int column_level = 0;      ///< the curves have a column per 2^this of the frame, at most `level`
  std::uint32_t horizon = 0; ///< slow horizon, Q8 of the height: sizes grow with the distance from it
  std::span<const Rectangle> ignored; ///< frame pixels
  int rows = 0; ///< below the horizon that are searched, in cells; 0 = down to the picture's end
};

/// A cell of the ground is odd when it differs, in the same direction, from the ground to its left and from
/// the ground to its right at the same distance. Vignetting, gradients of light, kerbs and the edges of
/// trails and shadows are one-sided and fall out. What is lighter and of the ground's own chroma is paint,
/// unless something dark lies right below it. No state between frames.
class OddSpots {
 public:
  /// Looks for spots in the ground that `curves` tell, and lists them. False when there are none.
  bool find(const Pyramid& pyramid, const ColorTransform& transform, const FreeSpaceCurves& curves,
            const GroundView& view, std::vector<Hole>& holes);

  /// Of what find() found drops the spots that are seen to move as the ground does all over: shadows, patches
  /// of another tint. `motion` as StandingThings::evidence(); where that is empty nothing is dropped. False
  /// when none are left.
  bool drop_flat(const FinerCells<std::int16_t>& motion, std::vector<Hole>& holes);

  /// Of the last find(): cells searched (the rows end where it was told to stop), and per cell how odd it is,
  /// Q4 of a standard deviation, 0..96, and whether it belongs to a spot.
  /// A row takes stride() cells in memory.
  int width() const { return width_; }
  int stride() const { return stride_; }
  int height() const { return height_; }
  FinerCells<std::uint8_t> oddness() const { return {odd_, width_, height_, view_.level, 0, stride_}; }
  std::span<const std::uint8_t> spots() const { return spot_; }

 private:
  /// Sums over blocks of 2 x 2 cells: count, three values, three squares.
  static constexpr int sum_count = 7;
  /// What both sides of a row of cells look like, from column -1 on: means (Q4) left and right, one over the
  /// deviation (Q12).
  struct Sides {
    std::array<std::vector<std::int16_t>, 3> left, right, inverse;
  };

  int distance(int row) const;
  int reach(int sixty_fourths, int row) const;
  bool is_far() const { return view_.rows > 0; } ///< only what is far away is searched
  void read_cells(const Pyramid& pyramid, const ColorTransform& transform);
  void sum_blocks();
  void sum_strips(int top, int bottom, std::size_t pad);
  void compare_sides(int block_row);
  void measure_row(int row);
  bool seed();
  bool keep_islands();
  void list(std::vector<Hole>& holes) const;
  template <typename Keep> bool keep_pieces(Keep keep);

  GroundView view_;
  int width_ = 0, stride_ = 0, height_ = 0, first_ = 0, horizon_row_ = 0;
  int blocks_x_ = 0, blocks_y_ = 0;
  GroundOutline ground_;
  std::array<std::vector<std::uint8_t>, 3> color_;
  std::vector<std::uint8_t> odd_, seed_, spot_;
  std::array<std::vector<std::uint32_t>, sum_count>
      sums_; ///< of blocks and those above; from the first that has ground
  std::array<std::vector<std::uint32_t>, sum_count> strips_; ///< of a block row: integral over its box's rows
  std::vector<std::uint32_t> box_cells_;                     ///< of a block row, per block
  std::array<std::vector<std::uint32_t>, 3> box_inverse_; ///< 2^24 / cells: of the box, its left, its right
  std::vector<std::uint32_t> variance_;                   ///< Q8
  std::vector<std::int16_t> block_left_, block_right_, block_deviation_;
  Sides sides_;
  std::vector<std::int16_t> nearest_dark_;
  std::array<std::vector<std::uint8_t>, 3> deviation_; ///< of a row, Q4
  std::vector<std::uint8_t> dark_, shade_;             ///< likewise: darker than both sides; clearly so
  CandidateCells candidates_;                          ///< that are odd enough
  std::vector<std::uint32_t> queue_;                   ///< cells of a piece
};

} // namespace terrainseg
