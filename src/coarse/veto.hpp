// SPDX-License-Identifier: LGPL-2.1-or-later
// Vetoed pixels: an external detector takes them away from the ground. They are not learned and not
// traversable.
#pragma once

#include <cstdint>
#include <span>

#include "terrainseg/frame.hpp"
#include "terrainseg/supervision.hpp"

namespace terrainseg {

/// The pixels of a frame that an external detector vetoes. A view: valid as long as the veto's memory.
class VetoArea {
 public:
  VetoArea() = default;
  VetoArea(const Veto& veto, int frame_width, int frame_height);
  bool empty() const { return veto_.empty(); }

  /// Whether a vetoed pixel lies in cell (x, y) of a level: one of the frame's pixels to which this cell is
  /// the nearest.
  bool touches_cell(int level, int x, int y) const;
  /// Sets the cells of a `width` x `height` grid that a vetoed pixel lies in to `value`.
  void fill_cells(int level, int width, int height, std::uint8_t value, std::uint8_t* cells) const;

  /// Labels mask pixels 0 when one of the frame's pixels that they cover is vetoed. Returns how many of them
  /// were traversable.
  std::uint64_t mark(int mask_level, const MutablePlane& mask, int width, int height) const;
  /// Lowers a curve (rows of the frame per mask column) to below the lowest vetoed pixel of each column.
  void lower(int mask_level, std::span<std::uint16_t> rows) const;

 private:
  template <typename Use> void each(Use use) const;

  Veto veto_;
  int width_ = 0, height_ = 0; ///< of the frame
};

} // namespace terrainseg
