// SPDX-License-Identifier: LGPL-2.1-or-later
// What one frame shows, before anything is learned from it.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "base/color_transform.hpp"
#include "base/lattice.hpp"
#include "base/pipeline.hpp"
#include "freespace/look/color_bins.hpp"

namespace terrainseg {

class ConnectedGround;
class Pyramid;

/// One frame as the default pipeline sees it: views into memory of the reader, good until its next frame.
struct View {
  const FrameTask& task;
  const Pyramid& pyramid;
  ColorTransform transform;
  Rectangle window;                   ///< that trains, in frame pixels
  std::span<const Cell> window_cells; ///< likewise, in cells of the grid
  bool blank;                         ///< of one colour: what follows has not been read
  Grid grid;                          ///< in one colour space
  const std::vector<std::uint16_t>& texture;
  const ExposureTables& exposure;
  const CellBins& cells;
  ConnectedGround& connected; ///< has looked at the cells

  /// Normalised colours.
  Grid colors() const { return colors_of(cells, grid); }
  Rectangle window_of_grid() const { return cells_of_window(window, grid.level, grid.width, grid.height); }
};

} // namespace terrainseg
