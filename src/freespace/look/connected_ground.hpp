// SPDX-License-Identifier: LGPL-2.1-or-later
// Ground that is joined to the training window without an edge: seeded region growing (R. Adams, L. Bischof,
// IEEE Transactions on Pattern Analysis and Machine Intelligence 16, 1994), and the places where a boundary
// would cross no edge.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "coarse/grid.hpp"
#include "freespace/look/color_bins.hpp"

namespace terrainseg {

/// The histograms have seen only the window as ground: open ground farther on stands against it like
/// everything else. Where luma, chroma and roughness go on without a step it is the same ground: its cells
/// are taught as terrain, and a boundary there is unlikely. Never looks at what was learned: nothing can
/// confirm itself. No state between frames.
class ConnectedGround {
 public:
  /// Takes a frame's cells in; the other functions speak of them.
  void look(const Grid& grid, const CellBins& cells);

  /// Grows from the `seeds` upwards and sideways over neighbours (of eight) that hardly differ. One byte a
  /// cell, 1 = joined; none without seeds. What is much smoother than the seeds is not joined: sky. Ignored
  /// cells join their neighbours, and may be marked.
  const std::vector<std::uint8_t>& grow(const Grid& grid, const std::vector<Cell>& seeds);

  /// Of what grow() joined the cells that are taught as terrain, one byte a cell: step by small step it also
  /// reaches walls, and their chroma is another than the seeds'.
  const std::vector<std::uint8_t>& taught();

  /// Of what grow() joined the cells that its `seeds`, the same, vouch for, one byte a cell: of their chroma,
  /// more strictly, and no darker than they are by more than a sixth, as an obstacle's shaded foot is;
  /// lighter ground is the same ground in more light. None where the seeds show so little texture (as
  /// TextureReader gives it) that an edge would not be seen either.
  const std::vector<std::uint8_t>& vouched(const Grid& grid, const std::vector<Cell>& seeds,
                                           const std::vector<std::uint16_t>& texture);

  /// One byte a cell: 1 at row r of a column where no edge lies between any two of the rows r - 4 to r + 3;
  /// the topmost row is 0. Ignored cells have an edge around them.
  const std::vector<std::uint8_t>& edgeless(const Grid& grid);

 private:
  /// The most that two cells may differ by.
  struct Limits {
    std::int16_t luma;       ///< of their lumas' sum and eight grey levels: one part in so many
    std::int16_t chroma;     ///< of both chromas together, quarters of a grey level
    std::int16_t rough;      ///< 1024ths of an octave
    std::uint8_t if_ignored; ///< whether an ignored cell is like its neighbours
  };
  static const Limits joined_limits, edge_limits;

  std::array<int, 4> means_of(const Grid& grid, const std::vector<Cell>& seeds) const;
  void compare(const Grid& grid, std::size_t from, std::size_t to, const Limits& limits,
               std::vector<std::uint8_t>& alike) const;
  void climb(std::size_t row, std::size_t width);
  void spread(std::size_t row, std::size_t width);

  /// Luma, chromas, log2 of roughness (Q8), 1-2-1 over the columns: four times the value.
  std::array<std::vector<std::int16_t>, 4> smooth_;
  std::array<int, 4> means_{}; ///< of the seeds that grow() was given, in the same units
  /// Whether a cell and its neighbour on that side are alike; anything at the ends of rows.
  std::vector<std::uint8_t> right_, down_, down_left_, down_right_;
  std::vector<std::uint8_t> rough_enough_, joined_, taught_, vouched_, edgeless_;
};

} // namespace terrainseg
