// SPDX-License-Identifier: LGPL-2.1-or-later
// Which cells of a pyramid level are ground, as the curves say.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "freespace/curve/frame_curves.hpp"
#include "terrainseg/frame.hpp"

namespace terrainseg {

/// How a level's cells lie to the curves.
struct OutlineView {
  int level = 0, width = 0, height = 0; ///< of the cells; rows may end above the picture's end
  int column_level = 0;                 ///< the curves have a column per 2^this of the frame
  /// Of them the one at or before the cell's centre at a multiple of 2^this of the frame is looked at.
  int column_spacing = 0;
  std::span<const Rectangle> ignored; ///< frame pixels
  int stride = 0; ///< cells of a row in memory, `width` at least: none of the others is ground
};

class GroundOutline {
 public:
  /// A cell is ground where its centre is. False where no cell is.
  bool draw(const FreeSpaceCurves& curves, const OutlineView& view);

  int first() const { return first_; } ///< uppermost row that has ground; the height where none has
  /// 1 = ground, else 0; known from row first() on.
  const std::uint8_t* row(int i) const { return &cells_[static_cast<std::size_t>(i) * stride_]; }
  bool at(std::uint32_t cell) const { return cells_[cell] != 0; }

 private:
  std::size_t stride_ = 0;
  int first_ = 0;
  std::vector<std::uint16_t> safe_, behind_first_, behind_end_; ///< in rows of cells
  std::vector<std::uint8_t> cells_;
};

} // namespace terrainseg
