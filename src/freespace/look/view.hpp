// SPDX-License-Identifier: LGPL-2.1-or-later
// All features of one frame that do not depend on the terrain.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "base/color_transform.hpp"
#include "base/lattice.hpp"
#include "base/pipeline.hpp"
#include "coarse/grid.hpp"
#include "coarse/pyramid.hpp"
#include "freespace/look/color_bins.hpp"
#include "freespace/look/connected_ground.hpp"

namespace terrainseg {

/// The pyramid levels that the default pipeline needs.
PyramidPlan coarse_plan(PixelFormat format, int coarsest);

/// Converts pyramid levels to full-range BT.601 luma and chroma, in its own memory.
class GridReader {
 public:
  /// Converts a level and marks its ignored cells. The result is valid until the next call, which allocates
  /// only when the grid grows.
  Grid read(const Pyramid& pyramid, int level, const ColorTransform& transform,
            std::span<const Rectangle> ignore_regions);

 private:
  std::vector<std::uint8_t> bytes_; ///< the three components, then the marks of ignored cells
};

/// The luma of pyramid levels: their first component, or, when they hold R, G, B, converted from these.
class LumaLevels {
 public:
  /// Makes the levels `finest` to `coarsest`. They are valid until the pyramid or this is built again.
  /// Allocates only when they grow.
  void read(const Pyramid& pyramid, int finest, int coarsest, const ColorTransform& transform, bool rgb);

  const GrayView& level(int level) const { return levels_[level]; }
  /// Q16: what brings differences of its values to the full range.
  int gain() const { return gain_; }

 private:
  std::array<GrayView, 8> levels_{};
  std::array<std::vector<std::uint8_t>, 8> converted_;
  int gain_ = 1 << 16;
};

/// Texture of each cell: its roughness on the three bands above the grid. Sum over the three bands (levels
/// L-1, L-2, L-3) of the cell's mean |Y(2i, 2j+1) - Y(2i, 2j)|, Q4 in 8-bit luma steps, 0..12240, written to
/// `texture` (grid.size() values). With fewer bands the sum is scaled to three; at level 0 the grid's own
/// differences are used. Uses only horizontal differences: at a grazing angle the ground's texture is
/// compressed vertically, and upright obstacles show in |dx|. Adding |dy| costs 0.9 points of error, |dy|
/// alone 2.3.
class TextureReader {
 public:
  void read(const LumaLevels& luma, const Grid& grid, std::vector<std::uint16_t>& texture);

 private:
  std::vector<std::uint16_t> columns_;
};

/// One frame for the default pipeline: views into memory of the reader, valid until its next frame.
struct View {
  const FrameTask& task;
  const Pyramid& pyramid;
  const LumaLevels& luma; ///< the levels texture_level() to that of the grid
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

/// Reads one frame: computes all of its features that do not depend on the terrain.
class FrameReader {
 public:
  /// Updates the exposure's mean and black (Q8; 0 = unknown) unless learning is off.
  View read(const FrameTask& task, std::uint32_t& exposure_mean, std::uint32_t& black, StageClock& clock);
  const ExposureTables& exposure() const { return exposure_; } ///< of the last frame

 private:
  void read_cells(const FrameTask& task, std::uint32_t& exposure_mean, std::uint32_t& black);

  Pyramid pyramid_;
  std::vector<Cell> window_cells_;
  std::vector<std::uint8_t> vetoed_;
  GridReader grid_reader_;
  LumaLevels luma_;
  ColorTransform transform_;
  Grid grid_;
  TextureReader texture_reader_;
  std::vector<std::uint16_t> texture_;
  ExposureTables exposure_;
  std::optional<Light> light_of_tables_; ///< for which exposure_ was computed
  CellBins cells_;
  ConnectedGround connected_;
};

} // namespace terrainseg
