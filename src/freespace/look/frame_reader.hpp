// SPDX-License-Identifier: LGPL-2.1-or-later
// Reads one frame: what it shows before anything is learned from it.
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
  /// The exposure's mean follows the frame unless nothing is to be learned.
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
  std::optional<std::uint32_t> exposure_of_tables_; ///< mean luma that exposure_ was made for
  CellBins cells_;
  ConnectedGround connected_;
};

} // namespace terrainseg
