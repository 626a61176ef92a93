// SPDX-License-Identifier: LGPL-2.1-or-later
// Reads one frame: computes all of its features that do not depend on the terrain.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "coarse/grid_reader.hpp"
#include "freespace/look/connected_ground.hpp"
#include "freespace/look/texture.hpp"
#include "freespace/look/view.hpp"

namespace terrainseg {

class FrameReader {
 public:
  /// Updates the exposure's mean unless learning is off.
  View read(const FrameTask& task, std::uint32_t& exposure_mean, StageClock& clock);
  const ExposureTables& exposure() const { return exposure_; } ///< of the last frame

 private:
  void read_cells(const FrameTask& task, std::uint32_t& exposure_mean);

  Pyramid pyramid_;
  std::vector<Cell> window_cells_;
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
