// SPDX-License-Identifier: LGPL-2.1-or-later
// Detects rows at the bottom of a moving picture that never change: a bonnet, a black bar, a caption. The
// filter would learn them as ground.
#pragma once

#include <gst/video/video.h>

#include <array>
#include <cstdint>

namespace terrainseg::process {

class StillBottom {
 public:
  /// Compares a sample of frames at a sample of pixels with the previous one. Restarts when the size changes.
  /// One thread only.
  void take(const GstVideoInfo& info, GstBuffer* buffer);

  /// Number of rows from the bottom edge that hardly changed while the picture above did. 0 if they are less
  /// than 3 % of the height, if nothing moved, or after too few frames.
  int rows() const;

 private:
  static constexpr int grid_rows = 60;    ///< covers the lower 60 % of the frame
  static constexpr int grid_columns = 32; ///< cover the middle half of the width, where the window is
  using Grid = std::array<std::uint8_t, grid_rows * grid_columns>;

  /// Row of the frame for a row of the grid, 0 = the lowest.
  int frame_row(int grid_row) const;
  void look(const GstVideoFrame& frame, Grid& grid) const;

  int width_ = 0, height_ = 0;
  std::uint64_t frames_ = 0;
  int compared_ = 0; ///< number of compared pairs
  Grid last_{};
  std::array<std::uint64_t, grid_rows>
      change_{}; ///< sum of absolute brightness differences, 0..255 per pixel
};

} // namespace terrainseg::process
