// SPDX-License-Identifier: LGPL-2.1-or-later
// Rasterises the curves: which cells of a pyramid level are ground.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "freespace/curve/frame_curves.hpp"
#include "terrainseg/frame.hpp"

namespace terrainseg {

/// Relation of a level's cells to the curves.
struct OutlineView {
  int level = 0, width = 0, height = 0; ///< size of the level in cells; the rows may end above the end of the
                                        ///< picture
  int column_level = 0;                 ///< the curves have one column per 2^column_level pixels of the frame
  /// Each cell uses the curves' column at or before its centre, at a multiple of 2^column_spacing pixels of
  /// the frame.
  int column_spacing = 0;
  std::span<const Rectangle> ignored; ///< in pixels of the frame
  int stride = 0; ///< elements per row in memory, at least `width`; the additional ones are not ground
};

class GroundOutline {
 public:
  /// Marks the cells whose centres are in the ground. Returns false when there is none.
  bool draw(const FreeSpaceCurves& curves, const OutlineView& view);

  int first() const { return first_; } ///< the uppermost row with ground; the height when there is none
  /// 1 = ground, otherwise 0. Valid from row first() on.
  const std::uint8_t* row(int i) const { return &cells_[static_cast<std::size_t>(i) * stride_]; }
  bool at(std::uint32_t cell) const { return cells_[cell] != 0; }

 private:
  std::size_t stride_ = 0;
  int first_ = 0;
  std::vector<std::uint16_t> safe_, behind_first_, behind_end_; ///< in rows of cells
  std::vector<std::uint8_t> cells_;
};

} // namespace terrainseg
