// SPDX-License-Identifier: LGPL-2.1-or-later
// Finds what never changes at the bottom of a moving picture: a vehicle's own bonnet, a black bar, a caption.
// The filter would learn it as ground.
#pragma once

#include <gst/video/video.h>

#include <array>
#include <cstdint>

namespace terrainseg::process {

class StillBottom {
 public:
  /// Compares a frame with the one before that it looked at; looks at few of them, at few pixels. Another
  /// size begins again. One thread.
  void take(const GstVideoInfo& info, GstBuffer* buffer);

  /// Rows of the frame, counted from the bottom edge, that hardly changed while the picture above did; 0 when
  /// there are too few to matter (under 3 % of the height), when nothing moved, or after too few frames.
  int rows() const;

 private:
  static constexpr int grid_rows = 60;    ///< over the lower 60 % of the frame
  static constexpr int grid_columns = 32; ///< over the middle half of the width, where the window lies
  using Grid = std::array<std::uint8_t, grid_rows * grid_columns>;

  /// Row of the frame that a row of the grid looks at, 0 = the lowest.
  int frame_row(int grid_row) const;
  void look(const GstVideoFrame& frame, Grid& grid) const;

  int width_ = 0, height_ = 0;
  std::uint64_t frames_ = 0;
  int compared_ = 0; ///< pairs of frames
  Grid last_{};
  std::array<std::uint64_t, grid_rows>
      change_{}; ///< sum of absolute differences of brightness, 0..255 a pixel
};

} // namespace terrainseg::process
