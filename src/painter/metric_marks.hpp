// SPDX-License-Identifier: LGPL-2.1-or-later
// Draws metres onto a frame: marks on the ground, numbers beside the boundary, the free space from above.
// Where they go is worked out elsewhere; here are pixels only.
#pragma once

#include <cstdint>
#include <span>

#include "painter.hpp"

namespace terrainseg {

/// A number of metres at a place of the frame, pixels from the top left.
struct MetricMark {
  enum class Kind : std::uint8_t {
    tick,     ///< a dash across the place, the number to its right
    boundary, ///< the number above the place, with one decimal
    ring,     ///< the number at the place, small
  };
  Kind kind = Kind::tick;
  int x = 0, y = 0;
  int decimetres = 0; ///< 0..99999
};

/// Pixels of the view from above.
enum MapCell : std::uint8_t {
  map_outside,  ///< not in view
  map_unknown,  ///< in view, nothing is known
  map_free,     ///< can be driven on
  map_obstacle, ///< the end of what is free
  map_ring,     ///< a line of equal range
  map_vehicle,
};

struct MetricMarks {
  std::span<const MetricMark> marks;
  GrayView map;             ///< MapCell; empty = none
  int map_x = 0, map_y = 0; ///< where its top left corner lies in the frame
};

/// Draws in the style's strength and colour; numbers and the map are there as strongly as lines. Parts
/// outside the frame are left out. Allocates nothing.
void paint_metres(const MutableFrame& frame, const MetricMarks& marks, const PaintStyle& style);

/// Height of the digits of marks on frames of that height, pixels.
int metric_digit_height(int frame_height);

} // namespace terrainseg
