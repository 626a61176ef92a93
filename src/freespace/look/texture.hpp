// SPDX-License-Identifier: LGPL-2.1-or-later
// Texture of each cell: its roughness on the three bands above the grid.
#pragma once

#include <cstdint>
#include <vector>

#include "base/color_transform.hpp"
#include "coarse/grid.hpp"
#include "coarse/pyramid.hpp"

namespace terrainseg {

/// Sum over the three bands (levels L-1, L-2, L-3) of the cell's mean |Y(2i, 2j+1) - Y(2i, 2j)|, Q4 in 8-bit
/// luma steps, 0..12240, written to `texture` (grid.size() values). With fewer bands the sum is scaled to
/// three; at level 0 the grid's own differences are used. Uses only horizontal differences: at a grazing
/// angle the ground's texture is compressed vertically, and upright obstacles show in |dx|. Adding |dy| costs
/// 0.9 points of error, |dy| alone 2.3.
class TextureReader {
 public:
  void read(const Pyramid& pyramid, const Grid& grid, const ColorTransform& transform, bool rgb,
            std::vector<std::uint16_t>& texture);

 private:
  std::vector<std::uint8_t> luma_;
  std::vector<std::uint16_t> columns_;
};

} // namespace terrainseg
