// SPDX-License-Identifier: LGPL-2.1-or-later
// A first guess of the vanishing line from one frame: the row where long straight edges meet.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "base/quantities.hpp"
#include "freespace/look/view.hpp"

namespace terrainseg {

/// Parallel edges of level things (floors, walls, shelves, rails, kerbs) meet at the vanishing line. Edges
/// are found by votes of edge pixels for lines (R. O. Duda, P. E. Hart, "Use of the Hough transformation to
/// detect lines and curves in pictures", Communications of the ACM 15, 1972; each pixel votes for lines in
/// the direction of its edge, as in F. O'Gorman, M. B. Clowes, "Finding picture edges through collinearity
/// of feature points", IEEE Transactions on Computers 25, 1976). Keeps no state between frames.
class LongLines {
 public:
  /// Allocates for frames of this size. meeting_row() then allocates nothing.
  void prepare(const LumaLevels& luma, int grid_level);

  /// The row where most of the edges meet, Q8 rows of the frame, negative above it; nothing when too few
  /// edges meet. The sizes are those of prepare().
  std::optional<std::int32_t> meeting_row(const LumaLevels& luma);

 private:
  /// A pixel on an edge, relative to the centre of the picture.
  struct EdgePixel {
    std::int16_t x, y;
    std::uint8_t normal; ///< index of the direction across the edge
    bool falls;          ///< the edge is darker below
  };
  /// The line through `x`, `y` (the mean of its pixels, Q4) with the normal `c`, `s` (Q14, s > 0).
  struct Line {
    std::int32_t x, y, c, s;
    std::int32_t length; ///< pixels
  };
  void find_edges(const Plane& luma);
  void take_edges(int row);
  void vote();
  void pick_lines();
  /// Its row, Q4, from the centre of the picture.
  std::optional<std::int32_t> best_meeting_point() const;
  std::size_t cell(const EdgePixel& pixel, int normal) const;

  int level_ = 0, width_ = 0, height_ = 0;  ///< of the searched pyramid level; no width when none is
  int reach_ = 0;                           ///< largest distance of a line from the centre
  std::vector<std::int16_t> across_, down_; ///< gradient per pixel, 4 * grey levels of a step
  std::vector<std::int16_t> lengths_;       ///< of the gradients
  std::vector<std::uint8_t> steep_;         ///< per pixel: 1 where the gradient may be that of an edge
  std::vector<std::int16_t> columns_;       ///< of the edge pixels of a row
  std::vector<EdgePixel> edges_;
  std::vector<std::int16_t> votes_; ///< per polarity, normal and distance from the centre
  std::vector<std::uint32_t> peaks_;
  std::vector<std::uint8_t> owner_; ///< of votes_: 0, near a line, or the number of the line + 2
  std::vector<Line> lines_;
};

/// What is known about the meeting row while frames pass.
class LineWatch {
 public:
  /// Counts a frame. Returns true when it is to be looked at: each one at first, later one of twelve, and up
  /// to three more until two rows agree.
  bool due(int frame_height);
  /// Takes the result of a look: a row in Q8, or nothing.
  void take(std::optional<std::int32_t> row_q8);
  /// The row that two looks in succession found.
  FrameLine line() const { return agreed_ ? FrameLine{FrameLine::Source::lines, *row_q8_} : FrameLine{}; }

 private:
  std::int32_t height_ = 0;               ///< of the frames
  std::optional<std::int32_t> row_q8_;    ///< of the last look that found one
  bool agreed_ = false;                   ///< the last two looks that found one found the same
  std::uint32_t frames_ = 0, misses_ = 0; ///< frames seen; looks in succession that found nothing
};

} // namespace terrainseg
