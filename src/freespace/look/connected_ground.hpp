// SPDX-License-Identifier: LGPL-2.1-or-later
// Finds ground that is connected to the training window without an edge, by seeded region growing (R. Adams,
// L. Bischof, IEEE Transactions on Pattern Analysis and Machine Intelligence 16, 1994), and positions where a
// boundary would cross no edge.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "coarse/grid.hpp"
#include "freespace/look/color_bins.hpp"
#include "kernels/cells.hpp"

namespace terrainseg {

// Colour differences between neighbouring cells, for the detection of edges.

/// Upper limit of a colour step.
inline constexpr int most_color_step = 1023;

/// Per cell of the grid the difference from its neighbour: |dY| + 2 |dU| + 2 |dV|, normalised to the learned
/// exposure, 0..most_color_step. Undefined where there is no neighbour.
struct ColorSteps {
  std::vector<std::uint16_t> right, down, down_left, down_right;
};

/// Measures the steps of a grid. `gain_q8` is the exposure's gain. Diagonal steps are measured only with
/// `diagonal`.
void measure_color_steps(const Grid& grid, int gain_q8, bool diagonal, ColorSteps& steps);

/// The histograms contain only the window as ground, so ground farther away counts as "the rest of the
/// frame". Where luma, chroma and roughness continue without a step it is the same ground: its cells are
/// learned as terrain, and a boundary there is unlikely. Does not use the terrain, so the result cannot
/// confirm itself. Keeps no state between frames.
class ConnectedGround {
 public:
  /// Prepares a frame's cells for the other functions.
  void look(const Grid& grid, const CellBins& cells);

  /// Grows from the `seeds` upwards and sideways over similar neighbours (of eight). Returns one byte per
  /// cell, 1 = connected; none without seeds. Ignored cells connect their neighbours and may be marked.
  const std::vector<std::uint8_t>& grow(const Grid& grid, const std::vector<Cell>& seeds);

  /// The subset of the last grow() that is learned as terrain, one byte per cell. Its chroma must be near the
  /// seeds', because growing in small steps can reach walls.
  const std::vector<std::uint8_t>& taught() const { return taught_; }

  /// The subset of taught() that its `seeds` vouch for, one byte per cell. A cell must not be darker than
  /// the seeds by more than a sixth, as the shaded base of an obstacle is. Lighter cells are the same ground
  /// in more light. Empty when the seeds have so little texture (as measured by TextureReader) that an edge
  /// would not be visible either.
  const std::vector<std::uint8_t>& vouched(const Grid& grid, const std::vector<Cell>& seeds,
                                           const std::vector<std::uint16_t>& texture);

  /// One byte per cell: 1 at row r of a column when there is no edge between any two of the rows r - 4 to r +
  /// 3. The top row is 0. Ignored cells have an edge around them. May be called during grow() and vouched().
  const std::vector<std::uint8_t>& edgeless(const Grid& grid);

 private:
  std::array<int, 3> means_of(const Grid& grid, const std::vector<Cell>& seeds) const;
  void compare(const Grid& grid, std::size_t from, std::size_t to, const kernels::LookLimits& limits,
               std::vector<std::uint8_t>& alike) const;
  void keep_like_seeds(); ///< fills taught_
  void climb(std::size_t row, std::size_t width);
  void spread(std::size_t row, std::size_t width);

  /// Luma, chromas and log2 of roughness (Q8), smoothed by 1-2-1 over the columns: four times the value.
  std::array<std::vector<std::int16_t>, 4> smooth_;
  std::array<int, 3> means_{}; ///< luma and chromas of the seeds of grow(), means in the same units
  /// Whether a cell and its neighbour on that side are similar; undefined at the ends of rows.
  std::vector<std::uint8_t> right_, down_, down_left_, down_right_;
  std::vector<std::uint8_t> unbroken_; ///< whether there is no edge between a cell and the one below it
  std::vector<std::uint8_t> joined_, taught_, vouched_, edgeless_;
};

} // namespace terrainseg
