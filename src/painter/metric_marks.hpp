// SPDX-License-Identifier: LGPL-2.1-or-later
// Draws metres onto a frame: marks on the ground, numbers at the boundary, the free space from above. The
// positions are computed elsewhere.
#pragma once

#include <cstdint>
#include <span>

#include "painter.hpp"

namespace terrainseg {

/// A number of metres at a position in pixels from the top left.
struct MetricMark {
  enum class Kind : std::uint8_t {
    tick,     ///< a horizontal dash at the position, the number to its right
    boundary, ///< the number above the position, with one decimal
    ring,     ///< a small number at the position
  };
  Kind kind = Kind::tick;
  int x = 0, y = 0;
  int decimetres = 0; ///< 0..99999
};

/// Values of the pixels of the map.
enum MapCell : std::uint8_t {
  map_outside,  ///< not visible
  map_unknown,  ///< visible, unknown
  map_free,     ///< can be driven on
  map_obstacle, ///< the end of the free space
  map_ring,     ///< a line of equal range
  map_vehicle,
};

struct MetricMarks {
  std::span<const MetricMark> marks;
  GrayView map;             ///< pixels are MapCell values; empty = no map
  int map_x = 0, map_y = 0; ///< top left corner in the frame, pixels
};

/// Draws with the opacity and colour of the style; numbers and map have the same opacity as lines. Parts
/// outside the frame are clipped. Does not allocate memory.
void paint_metres(const MutableFrame& frame, const MetricMarks& marks, const PaintStyle& style);

/// Height of the digits for a frame height, both in pixels.
int metric_digit_height(int frame_height);

} // namespace terrainseg
