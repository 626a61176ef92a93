// SPDX-License-Identifier: LGPL-2.1-or-later
// A mask as a picture of any size.
#pragma once

#include <cstdint>
#include <cstring>
#include <vector>

#include "terrainseg/estimate.hpp"

namespace terrainseg {

/// Draws the mask of an estimate as a picture of the whole frame, nearest neighbour. Keeps its tables:
/// nothing is allocated while the sizes stay.
class MaskScaler {
 public:
  /// True when the picture of this size is the mask itself.
  static bool is_identity(const Estimate& e, int width, int height) {
    return e.mask.width == width && e.mask.height == height &&
           covered(e) == Rectangle{0, 0, e.frame_width, e.frame_height};
  }

  /// `width` x `height` bytes into `target`. Where the frame is not covered by the mask the picture is 128.
  void draw(const Estimate& e, const MutablePlane& target, int width, int height) {
    const Rectangle r = covered(e);
    const Axis x{width, e.frame_width, r.x, r.width, e.mask.width};
    const Axis y{height, e.frame_height, r.y, r.height, e.mask.height};
    columns_.resize(static_cast<std::size_t>(width));
    bool straight = e.mask.width == width;
    for (int i = 0; i < width; ++i) {
      columns_[static_cast<std::size_t>(i)] = x.cell(i);
      straight = straight && columns_[static_cast<std::size_t>(i)] == i;
    }
    std::int32_t last = -2;
    for (int i = 0; i < height; ++i) {
      std::uint8_t* const out = target.row(i);
      const std::int32_t row = y.cell(i);
      if (row == last)
        std::memcpy(out, target.row(i - 1), static_cast<std::size_t>(width));
      else if (row < 0)
        std::memset(out, mask_doubtful, static_cast<std::size_t>(width));
      else if (straight)
        std::memcpy(out, e.mask.plane.row(row), static_cast<std::size_t>(width));
      else {
        const std::uint8_t* const in = e.mask.plane.row(row);
        for (int j = 0; j < width; ++j) {
          const std::int32_t column = columns_[static_cast<std::size_t>(j)];
          out[j] = column < 0 ? mask_doubtful : in[column];
        }
      }
      last = row;
    }
  }

 private:
  /// One axis: `picture` positions over a frame of `frame` pixels, of which `start`, `length` hold `cells`
  /// cells.
  struct Axis {
    std::int64_t picture, frame, start, length, cells;

    /// The cell under the middle of a picture position; -1 = none.
    std::int32_t cell(std::int64_t position) const {
      // In units of 1 / (2 * picture) frame pixels, so that the middle is a whole number.
      const std::int64_t middle = (2 * position + 1) * frame - 2 * picture * start;
      if (middle < 0 || middle >= 2 * picture * length)
        return -1;
      return static_cast<std::int32_t>(middle * cells / (2 * picture * length));
    }
  };
  static Rectangle covered(const Estimate& e) {
    return e.mask_region.empty() ? Rectangle{0, 0, e.frame_width, e.frame_height} : e.mask_region;
  }

  std::vector<std::int32_t> columns_; ///< mask column of every picture column, -1 = not covered
};

} // namespace terrainseg
