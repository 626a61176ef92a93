// SPDX-License-Identifier: LGPL-2.1-or-later
// Finds small obstacles in open ground from one frame; a curve with one row per column cannot represent them.
// Compares each cell with its surroundings on both sides (local contrast as in L. Itti, C. Koch, E. Niebur,
// "A model of saliency-based visual attention", IEEE PAMI 20, 1998, here in standard deviations of the ground
// itself).
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "base/color_transform.hpp"
#include "coarse/pyramid.hpp"
#include "freespace/curve/frame_curves.hpp"
#include "freespace/holes/candidate_cells.hpp"
#include "freespace/holes/hole.hpp"

namespace terrainseg {

/// Parameters of the search in a frame.
struct GroundView {
  int level = 0;             ///< the pyramid level that is searched, one or two levels finer than the grid;
                             ///< not below that of the curves
  std::uint32_t horizon = 0; ///< slow horizon, Q8 of the height: sizes grow with the distance from it
  std::span<const Rectangle> ignored; ///< in pixels of the frame
  int skipped = 0;                    ///< rows of cells below the horizon that are not searched
  int rows = 0; ///< the rows below the horizon where the search ends; 0 = at the end of the picture
};

/// A cell of the ground is odd when it differs in the same direction from the ground to its left and from the
/// ground to its right at the same distance. Vignetting, gradients of light, kerbs and the edges of trails
/// and shadows differ on one side only and are not detected. A lighter cell of the ground's own chroma is
/// paint, unless a dark cell is right below it. Keeps no state between frames.
class OddSpots {
 public:
  /// Finds and lists the spots in the ground given by `curves`. Returns false when there are none.
  bool find(const Pyramid& pyramid, const ColorTransform& transform, const FreeSpaceCurves& curves,
            const GroundView& view, std::vector<Hole>& holes);

  /// Removes the spots of find() that move as the ground does in all of their cells: shadows and patches of
  /// another tint. `motion` is StandingThings::evidence(); when it is empty nothing is removed. Returns false
  /// when no spot remains.
  bool drop_flat(const FinerCells<std::int16_t>& motion, std::vector<Hole>& holes);

  /// Results of the last find(), down to the last searched row: per cell the oddness (Q4 of a standard
  /// deviation, 0..96) and whether the cell belongs to a spot, with the same number of elements in a row.
  FinerCells<std::uint8_t> oddness() const {
    return {std::span(odd_).subspan(1), width_, height_, view_.level, 0, stride_};
  }
  std::span<const std::uint8_t> spots() const { return spot_; }

 private:
  /// Sums over blocks of 2 x 2 cells: count, three values, three squares.
  static constexpr int sum_count = 7;
  /// Statistics of both sides of a row of cells, from element from_ on: means (Q4) on the left and right, and
  /// 1 / deviation (Q12).
  struct Sides {
    std::array<std::vector<std::int16_t>, 3> left, right, inverse;
  };

  int distance(int row) const;
  int reach(int sixty_fourths, int row) const;
  bool is_far() const { return view_.rows > 0; } ///< only rows near the horizon are searched
  void read_cells(const Pyramid& pyramid, const ColorTransform& transform);
  void sum_blocks();
  void sum_strips(int top, int bottom, int pad);
  void find_extent(int top, int bottom);
  void compare_sides(int block_row);
  void measure_row(int row);
  bool mark_spots();
  bool keep_islands();
  void list(std::vector<Hole>& holes) const;
  template <typename Keep> bool keep_pieces(Keep keep);
  bool is_spot(const Pieces::Run& run) const { return spot_[cell_of(run.row, run.from)] != 0; }
  int cell_of(int row, int column) const { return row * stride_ + column; }

  GroundView view_;
  int width_ = 0, stride_ = 0, height_ = 0, first_ = 0, horizon_row_ = 0;
  int blocks_x_ = 0, blocks_y_ = 0;
  int from_ = 0, count_ = 0; ///< elements of a row that are searched; sides_ and later members begin there
  GroundOutline ground_;
  std::array<std::vector<std::uint8_t>, 3> color_; ///< these and odd_ begin with column -1 of the first row
  std::vector<std::uint8_t> odd_, spot_;
  std::array<std::vector<std::uint32_t>, sum_count>
      sums_; ///< cumulative over blocks of rows, from the first one with ground
  std::array<std::vector<std::uint32_t>, sum_count> strips_; ///< of a row of blocks: prefix sums over the
                                                             ///< rows of its boxes
  std::vector<std::uint32_t> box_cells_;                     ///< of a row of blocks, per block
  std::array<std::vector<std::uint32_t>, 3> box_inverse_; ///< 2^24 / cells: of the box, its left, its right
  std::vector<std::uint32_t> variance_;                   ///< Q8
  std::vector<std::int16_t> block_left_, block_right_, block_deviation_;
  Sides sides_;
  std::vector<std::int16_t> nearest_dark_;
  std::array<std::vector<std::uint8_t>, 3> deviation_; ///< of a row, Q4
  std::vector<std::uint8_t> dark_, shade_;             ///< of a row: darker than both sides; clearly darker
  CandidateCells candidates_;
  Pieces pieces_; ///< of the spots
};

} // namespace terrainseg
