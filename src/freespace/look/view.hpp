// SPDX-License-Identifier: LGPL-2.1-or-later
// All features of one frame that do not depend on the terrain.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "base/color_transform.hpp"
#include "base/lattice.hpp"
#include "base/pipeline.hpp"
#include "coarse/grid_reader.hpp"
#include "coarse/veto.hpp"
#include "freespace/look/color_bins.hpp"
#include "freespace/look/connected_ground.hpp"
#include "freespace/look/texture.hpp"

namespace terrainseg {

class ConnectedGround;
class Pyramid;

/// One frame for the default pipeline: views into memory of the reader, valid until its next frame.
struct View {
  const FrameTask& task;
  const Pyramid& pyramid;
  ColorTransform transform;
  Rectangle window;                   ///< the training window, in pixels of the frame
  std::span<const Cell> window_cells; ///< the training window's cells
  VetoArea veto;
  std::span<const std::uint8_t> vetoed; ///< per cell 1 where a pixel is vetoed; empty when none is
  bool blank;                           ///< a single colour: the following members have not been read
  Grid grid;                            ///< in the learning colour space
  const std::vector<std::uint16_t>& texture;
  const ExposureTables& exposure;
  const CellBins& cells;
  ConnectedGround& connected; ///< prepared with the cells of this frame

  /// Colours normalised by the exposure.
  Grid colors() const { return colors_of(cells, grid); }
  Rectangle window_of_grid() const { return cells_of_window(window, grid.level, grid.width, grid.height); }
};

// Reads one frame: computes all of its features that do not depend on the terrain.

class FrameReader {
 public:
  /// Updates the exposure's mean unless learning is off.
  View read(const FrameTask& task, std::uint32_t& exposure_mean, StageClock& clock);
  const ExposureTables& exposure() const { return exposure_; } ///< of the last frame

 private:
  void read_cells(const FrameTask& task, std::uint32_t& exposure_mean);

  Pyramid pyramid_;
  std::vector<Cell> window_cells_;
  std::vector<std::uint8_t> vetoed_;
  GridReader grid_reader_;
  ColorTransform transform_;
  Grid grid_;
  TextureReader texture_reader_;
  std::vector<std::uint16_t> texture_;
  ExposureTables exposure_;
  std::optional<std::uint32_t> exposure_of_tables_; ///< mean luma for which exposure_ was computed
  CellBins cells_;
  ConnectedGround connected_;
};

} // namespace terrainseg
