// SPDX-License-Identifier: LGPL-2.1-or-later
// Computes the scores of a frame's cells, and averages them over neighbouring frames.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "base/quantities.hpp"
#include "coarse/grid.hpp"
#include "freespace/look/view.hpp"
#include "freespace/score/likelihood.hpp"
#include "terrainseg/settings.hpp"

namespace terrainseg {

/// Evidence of upright objects: their luma steps keep their sign over some cells of height. The ground's
/// texture changes from row to row, so its steps cancel when rows are summed. Edges of obstacles
/// are upright and add up. This separates a wall of the ground's colour from the ground, which colour cannot.
class UprightCoherence {
 public:
  /// Measures a frame from its luma at the refinement's level.
  void look(const LumaLevels& luma, const Grid& grid);

  /// Per cell in Q8: log2 of the largest step of the summed rows minus that of the mean step, averaged over 3
  /// x 5 cells. High for upright objects.
  const std::vector<std::int16_t>& coherence() const { return average_; }

  /// Reduces the weight of `score` (Q4) and adds the evidence of coherence, which is small at low contrast.
  void weigh(const Grid& grid, CellScores& score) const;

 private:
  void add_rows(const GrayView& luma, const Grid& grid);
  void compare(const Grid& grid);
  void average(const Grid& grid);

  int level_ = 0;
  std::size_t width_ = 0;                   ///< width of that finer level
  std::vector<std::uint16_t> sums_, steps_; ///< of the rows of a cell: luma, and absolute differences
  std::vector<std::uint16_t> column_sums_, column_steps_, most_; ///< of the summed rows
  std::vector<std::uint32_t> values_; ///< of a row of cells: what both logarithms are of
  std::vector<std::int16_t> logs_, coherence_, down_, average_;
  std::vector<std::uint16_t> contrast_; ///< limited to full_contrast
};

/// Evidence of one frame's cells for and against ground.
struct Scores {
  const CellScores& average; ///< over the frames that show the same place
  const CellPenalties& penalty;
};

/// Luma and time of the last frame, to decide whether the next frame continues it.
struct LastPicture {
  std::vector<std::uint8_t> luma; ///< row by row; empty = no last frame
  std::int64_t pts = -1;          ///< nanoseconds, -1 = unknown
};

/// Whether a frame shows the same place as the last one. With Temporal::on: when their sizes are equal.
/// Otherwise: when the pictures are similar and the interval, if known, is at most two seconds.
bool shows_same_place(const LastPicture& last, const Grid& grid, std::int64_t pts, Temporal mode);

/// Whether the picture has moved by less than a third of a cell since the last one: the mean change of a cell
/// is less than a third of the mean difference between neighbouring cells. False when their sizes differ.
bool has_hardly_moved(const LastPicture& last, const Grid& grid);

/// Stores this frame as the last one.
void remember(const Grid& grid, std::int64_t pts, LastPicture& last);

/// Moves `average` (Q4) towards `score` (Q4) by three quarters, or sets it to `score` when the frame does not
/// continue the last one.
void average_scores(const CellScores& score, bool continued, CellScores& average);

// Penalties of cells: difference from a reference colour that follows each column upwards, and distance from
// the training window when each move costs the colour step (the geodesic distance of image segmentation: P.
// J. Toivanen, Pattern Recognition Letters 17, 1996).

/// The mean Y U V (Q4) of the given cells of the grid, at least one.
std::array<int, 3> mean_color(const Grid& grid, std::span<const Cell> cells);

/// The reference follows light and perspective, but does not follow a sudden change of colour, such as the
/// base of a car. Keeps no state between frames.
class LocalReference {
 public:
  /// Writes to `penalty` the penalty of each cell, 0..24 (32 = 1 nat). `start` is the window's mean Y U V,
  /// Q4; `gain` is the exposure's, Q8.
  void climb(const Grid& grid, const std::array<int, 3>& start, int gain, CellPenalties& penalty);

 private:
  std::array<std::vector<std::int32_t>, 3> reference_, smooth_;
};

/// An obstacle is enclosed by edges at its base and its sides. A road has paths around its markings and
/// shadows, and most of them have no cost. Keeps no state between frames.
class GeodesicPenalty {
 public:
  /// Raises `penalty` (32 = 1 nat) to the value of each cell's distance from the `seeds`, 0..40. Paths go up:
  /// from a row to the same row or to the row above, to any of the eight neighbours there. A move costs the
  /// colour step (`steps`, including diagonal ones) minus the usual step among the window's cells. With every
  /// row the distance decreases by an eighth. Cells below all seeds remain unchanged.
  void raise(const Grid& grid, const ColorSteps& steps, std::span<const Cell> seeds, CellPenalties& penalty);

 private:
  std::vector<std::uint8_t> is_seed_;
  std::vector<std::int32_t> here_, below_; ///< distances of two rows
  std::vector<std::int32_t> place_;        ///< distance of each cell of a row from the first, along the row
};

class CellScorer {
 public:
  /// Measures what score() uses and no lesson changes. Returns the colour steps of the frame.
  const ColorSteps& look(const View& view);

  /// Colour and texture give evidence for and against ground; the distance from the trusted ground and
  /// upright edges give evidence against it. The frame is that of look(). `trusted` are the window's cells
  /// that vouch for the ground; empty when the window was not examined.
  Scores score(const View& view, const Vouched& trusted, bool continued, CellScores& average,
               TerrainTables& tables, const Terrain& terrain);

 private:
  UprightCoherence coherence_;
  LocalReference local_reference_;
  ColorSteps steps_;
  GeodesicPenalty geodesic_;
  CellPenalties penalty_;
  CellScores score_;
};

} // namespace terrainseg
