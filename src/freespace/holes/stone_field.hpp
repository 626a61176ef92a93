// SPDX-License-Identifier: LGPL-2.1-or-later
// Stones in the open, of any shade: what stands out of the ground around it, where many things do. A detector
// of a constant false alarm rate whose reference leaves the targets out (J. T. Rickard, G. M. Dillard,
// "Adaptive detection algorithms for multiple-target situations", IEEE Trans. AES 13, 1977): a stone shows a
// lit side beside a shaded one, and in a field of stones the neighbours are no measure of the ground.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "base/color_transform.hpp"
#include "coarse/pyramid.hpp"
#include "freespace/curve/frame_curves.hpp"
#include "freespace/holes/candidate_cells.hpp"
#include "freespace/holes/ground_outline.hpp"
#include "freespace/holes/hole.hpp"

namespace terrainseg {

/// What the search has to know of the picture.
struct StoneView {
  int level = 0;             ///< of the pyramid that is searched: its luma is kept, of RGB all three
  bool rgb = false;          ///< the pyramid's components are red, green and blue
  int column_level = 0;      ///< the curves have a column per 2^this of the frame
  int column_spacing = 0;    ///< see OutlineView
  std::uint32_t horizon = 0; ///< slow horizon, Q8 of the height: sizes grow with the distance from it
  std::span<const Rectangle> ignored; ///< frame pixels
};

/// A cell stands out by its distance in luma from the mean of the ground around it, in mean deviations of
/// that ground (one deviation of a normal distribution = 16), both without what lies beyond two deviations.
/// Where the mean of a small box is enough it is a seed; pieces grow around seeds. Pieces that ground
/// surrounds, and that are no larger than a stone, are stones only in a field of them: where there are many,
/// and they are much of all that stands out. On roads markings, seams, shadows and patches stand out: few of
/// them are small and surrounded. Where there is no field only every third frame is looked at, then
/// every fifth, then every ninth; where there is one, it stays one with half of that.
class StoneField {
 public:
  /// What frame after frame showed.
  struct Watch {
    bool in_field = false; ///< the last frame that was looked at
    int frames_to_wait = 0;
    std::size_t looks_in_vain = 0;
    /// The next frame does not continue the last one: it is looked at, however often there was none.
    void look_again() { frames_to_wait = 0, looks_in_vain = 0; }
  };

  /// Lists the stones. False when there is no field of them, or none was looked for.
  bool find(const Pyramid& pyramid, const ColorTransform& transform, const FreeSpaceCurves& curves,
            const StoneView& view, Watch& watch, std::vector<Hole>& holes);

  /// Of the last find(): per cell how far the stone it belongs to stands out (Q4 of a deviation, 0..96), 0
  /// where there is none.
  FinerCells<std::uint8_t> oddness() const { return {oddness_, width_, height_, view_.level, 0, width_}; }

  /// Of the last find(): per cell how far it stands out (Q4 of a deviation, 0..127), known from the first row
  /// that has ground.
  std::span<const std::uint8_t> deviations() const { return deviation_; }
  int width() const { return width_; }
  int height() const { return height_; }

 private:
  struct Piece;
  struct Run {
    std::uint16_t row, from, to; ///< cells
  };

  bool look(const Pyramid& pyramid, const ColorTransform& transform, const FreeSpaceCurves& curves,
            const StoneView& view);
  int distance(int row) const;
  int distance_of(const Piece& piece) const;
  int reach(int row) const;
  int block_reach(int block_row) const;
  void read_luma(const Pyramid& pyramid, const ColorTransform& transform);
  template <typename AddRow> void sum_blocks(AddRow add_row);
  std::array<std::uint32_t, 3> box_around(int block_row, int column, int reach) const;
  void measure_ground();
  void measure_deviations();
  template <typename Visit> void each_piece(int peak, Visit visit);
  int pieces_of_a_field() const;
  Piece look_at(std::span<const std::uint32_t> cells) const;
  bool is_field();
  void take_stones();
  void fill(const Piece& piece);

  bool in_field_ = false; ///< the last frame that was looked at
  StoneView view_;
  int width_ = 0, height_ = 0, first_ = 0, horizon_row_ = 0;
  int blocks_x_ = 0, blocks_y_ = 0, first_block_ = 0;
  GroundOutline ground_;
  std::vector<const std::uint8_t*> luma_; ///< rows, from first_ on
  std::vector<std::uint8_t> luma_of_rgb_;
  std::vector<std::uint16_t> cells_, sums_, distances_; ///< per column of a row of blocks
  std::vector<std::uint32_t> squares_;
  std::array<std::vector<std::uint32_t>, 3> blocks_; ///< from first_block_ on, integral
  std::vector<std::uint8_t> middle_, reach_;         ///< per block; a reach of 0: nothing is known
  std::vector<std::uint16_t> scale_;
  std::vector<std::uint8_t> row_middle_, row_reach_; ///< of a row, per cell
  std::vector<std::uint16_t> row_scale_;
  std::vector<std::uint8_t> deviation_, oddness_;
  std::vector<std::uint8_t> marked_, waiting_; ///< 0 between frames
  CandidateCells candidates_;
  std::vector<std::uint32_t> piece_; ///< cells
  std::vector<std::pair<int, int>> row_ends_;
  std::vector<Run> runs_; ///< rows of stones
};

} // namespace terrainseg
