// SPDX-License-Identifier: LGPL-2.1-or-later
// A horizontal line across the frame, such as the vanishing line of the ground plane, with conversions
// between its units.
#pragma once

#include <algorithm>
#include <cstdint>

namespace terrainseg {

struct FrameLine {
  /// Where the line comes from, in order of increasing reliability.
  enum class Source : std::uint8_t { none, hint, motion, pose, setting };
  Source source = Source::none;
  std::int32_t row_q8 = 0; ///< Q8 rows from the top of the frame; may lie outside the frame

  bool known() const { return source != Source::none; }
  /// Limits the line to the frame: unknown when it lies above the frame, the frame's end when it lies below.
  FrameLine within(int frame_height) const {
    return known() && row_q8 >= 0 ? FrameLine{source, std::min(row_q8, frame_height << 8)} : FrameLine{};
  }
  FrameLine lower_by(std::int32_t rows_q8) const { return {source, row_q8 + rows_q8}; }

  /// For the metadata: Q16 rows; -1 when unknown or outside the frame.
  std::int32_t row_q16(int frame_height) const {
    return known() && row_q8 >= 0 && row_q8 < frame_height << 8 ? row_q8 << 8 : -1;
  }
  /// Q8 of the frame's height; -1 when unknown.
  int part_of_height_q8(int frame_height) const { return known() ? row_q8 / frame_height : -1; }
  /// The row `rows_above` rows of the frame above the line, as a row of a pyramid level; 0 when unknown.
  int row_of_level(int level, int rows_above) const {
    return known() ? std::max(((row_q8 >> 8) - rows_above + (1 << level) - 1) >> level, 0) : 0;
  }
  /// Q8 pixels of a pyramid level.
  int row_q8_of_level(int level) const { return row_q8 >> level; }
};

} // namespace terrainseg
