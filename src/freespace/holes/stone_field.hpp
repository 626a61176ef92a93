// SPDX-License-Identifier: LGPL-2.1-or-later
// Finds stones of any shade in open ground: cells that differ from the surrounding ground, where there are
// many. A constant false alarm rate detector whose reference excludes the targets (J. T. Rickard, G. M.
// Dillard, "Adaptive detection algorithms for multiple-target situations", IEEE Trans. AES 13, 1977). A
// comparison with both neighbours does not suffice: a stone has a lit and a shaded side, and in a field of
// stones the neighbours are not ground.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "freespace/curve/frame_curves.hpp"
#include "freespace/holes/candidate_cells.hpp"
#include "freespace/holes/hole.hpp"

namespace terrainseg {

/// Parameters of the search in a frame.
struct StoneView {
  int level = 0;             ///< the pyramid level that is searched
  int column_spacing = 0;    ///< see OutlineView
  std::uint32_t horizon = 0; ///< slow horizon, Q8 of the height: sizes grow with the distance from it
  std::span<const Rectangle> ignored; ///< in pixels of the frame
};

/// The deviation of a cell is its distance in luma from the mean of the surrounding ground, in mean
/// deviations of that ground (16 = one deviation of a normal distribution). Both statistics exclude cells
/// beyond two deviations. A cell is a seed where the mean of a small box is high enough; pieces grow around
/// seeds. A piece is a stone when ground surrounds it, it is not larger than a stone, and it is in a field:
/// there are many such pieces, and they make up a large share of all differing cells. On roads, markings,
/// seams, shadows and patches differ too, but few of them are small and surrounded. Without a field only
/// every third call searches, then every fifth, then every ninth.
class StoneField {
 public:
  /// The state of the search between frames.
  struct Watch {
    int frames_to_wait = 0;
    std::size_t looks_in_vain = 0;
    /// The next frame shows another place: search it regardless of earlier results.
    void look_again() { frames_to_wait = 0, looks_in_vain = 0; }
  };

  /// Lists the stones. Returns false when there is no field of them or the call is skipped.
  bool find(const GrayView& luma, const FreeSpaceCurves& curves, const StoneView& view, Watch& watch,
            std::vector<Hole>& holes);

  /// Result of the last find(): per cell the deviation of its stone (Q4, 0..96), 0 outside stones.
  FinerCells<std::uint8_t> oddness() const { return {oddness_, width_, height_, view_.level, 0, width_}; }

  /// Result of the last find(): per cell its deviation (Q4, 0..127), valid from the first row with ground.
  std::span<const std::uint8_t> deviations() const { return deviation_; }

 private:
  struct Piece;
  struct Run {
    std::uint16_t row, from, to; ///< in cells
    std::uint8_t odd;            ///< oddness of its stone
  };

  bool look(const GrayView& luma, const FreeSpaceCurves& curves, const StoneView& view);
  int distance(int row) const;
  int reach(int row) const;
  int block_reach(int block_row) const;
  template <typename AddRow> void sum_blocks(AddRow add_row);
  std::array<std::uint32_t, 3> box_around(int block_row, int column, int reach) const;
  void measure_ground(const Plane& luma);
  void measure_deviations(const Plane& luma);
  bool is_stone(const Piece& piece, int most) const;
  Piece look_at(std::uint32_t number) const;
  bool list_stones();
  void list_rows(std::uint32_t number, std::uint8_t odd);
  int cell_of(int row, int column) const { return row * width_ + column; }

  StoneView view_;
  int width_ = 0, height_ = 0, first_ = 0, horizon_row_ = 0;
  int blocks_x_ = 0, blocks_y_ = 0, first_block_ = 0;
  GroundOutline ground_;
  std::vector<std::uint16_t> cells_, sums_, distances_; ///< per column of a row of blocks
  std::vector<std::uint32_t> squares_;
  std::array<std::vector<std::uint32_t>, 3> blocks_; ///< integrals, from first_block_ on
  std::vector<std::uint8_t> middle_, reach_;         ///< per block; a reach of 0 means no result
  std::vector<std::uint16_t> scale_;
  std::vector<std::uint8_t> row_middle_, row_reach_; ///< of a row, per cell
  std::vector<std::uint16_t> row_scale_;
  std::vector<std::uint8_t> deviation_, oddness_, marked_;
  CandidateCells candidates_;
  Pieces pieces_;         ///< of the marked cells
  std::vector<Run> runs_; ///< rows of the stones
};

} // namespace terrainseg
