// SPDX-License-Identifier: LGPL-2.1-or-later
// A straight row across the frame, as the vanishing line of the ground plane is one, and its units.
#pragma once

#include <algorithm>
#include <cstdint>

namespace terrainseg {

struct FrameLine {
  /// How it is known, the surer the later.
  enum class Source : std::uint8_t { none, hint, motion, pose, setting };
  Source source = Source::none;
  std::int32_t row_q8 = 0; ///< Q8 rows from the frame's top; may lie outside of the frame

  bool known() const { return source != Source::none; }
  /// No line where it lies above the frame, the frame's end where it lies below it.
  FrameLine within(int frame_height) const {
    return known() && row_q8 >= 0 ? FrameLine{source, std::min(row_q8, frame_height << 8)} : FrameLine{};
  }
  FrameLine lower_by(std::int32_t rows_q8) const { return {source, row_q8 + rows_q8}; }

  /// For the metadata: Q16 rows; -1 where it is not known or not in the frame.
  std::int32_t row_q16(int frame_height) const {
    return known() && row_q8 >= 0 && row_q8 < frame_height << 8 ? row_q8 << 8 : -1;
  }
  /// Q8 of the frame's height; -1 where it is not known.
  int part_of_height_q8(int frame_height) const { return known() ? row_q8 / frame_height : -1; }
  /// Whole rows of the frame, less so many above the line, as rows of a level; 0 where it is not known.
  int row_of_level(int level, int rows_above) const {
    return known() ? std::max(((row_q8 >> 8) - rows_above + (1 << level) - 1) >> level, 0) : 0;
  }
  /// Q8 pixels of a level.
  int row_q8_of_level(int level) const { return row_q8 >> level; }
};

} // namespace terrainseg
