// SPDX-License-Identifier: LGPL-2.1-or-later
#include "tools/process/still_bottom.hpp"

#include <algorithm>
#include <cstdlib>

namespace terrainseg::process {
namespace {

constexpr std::uint64_t stride = 5;   ///< compares every fifth frame
constexpr int least_compared = 6;     ///< minimum number of pairs: a second of video at 30 frames per second
constexpr double still = 2;           ///< maximum mean change of an unchanged row: coding noise
constexpr double moving = 6;          ///< minimum mean change of the picture above
constexpr int least_permille = 30;    ///< minimum share of the height
constexpr int looked_at_percent = 60; ///< share of the height, from the bottom

/// 8-bit brightness of a pixel: luma, or green.
int brightness(const GstVideoFrame& frame, int component, int x, int y) {
  const auto* data = static_cast<const std::uint8_t*>(GST_VIDEO_FRAME_COMP_DATA(&frame, component));
  const std::uint8_t* pixel =
      data + static_cast<std::ptrdiff_t>(y) * GST_VIDEO_FRAME_COMP_STRIDE(&frame, component) +
      static_cast<std::ptrdiff_t>(x) * GST_VIDEO_FRAME_COMP_PSTRIDE(&frame, component);
  const int depth = GST_VIDEO_FRAME_COMP_DEPTH(&frame, component);
  if (depth <= 8)
    return pixel[0];
  const int shift = GST_VIDEO_FORMAT_INFO_SHIFT(frame.info.finfo, component);
  return ((pixel[0] | pixel[1] << 8) >> shift) >> (depth - 8) & 0xff;
}

} // namespace

int StillBottom::frame_row(int grid_row) const {
  return grid_row * height_ * looked_at_percent / (100 * grid_rows);
}

void StillBottom::look(const GstVideoFrame& frame, Grid& grid) const {
  const int component = GST_VIDEO_INFO_IS_RGB(&frame.info) ? 1 : 0;
  for (int row = 0; row < grid_rows; ++row)
    for (int column = 0; column < grid_columns; ++column)
      grid[row * grid_columns + column] = static_cast<std::uint8_t>(brightness(
          frame, component, width_ / 4 + column * width_ / (2 * grid_columns), height_ - 1 - frame_row(row)));
}

void StillBottom::take(const GstVideoInfo& info, GstBuffer* buffer) {
  if (info.width != width_ || info.height != height_) {
    *this = StillBottom();
    width_ = info.width;
    height_ = info.height;
  }
  if (frames_++ % stride != 0)
    return;
  GstVideoFrame frame;
  GstVideoInfo copy = info;
  if (!gst_video_frame_map(&frame, &copy, buffer, GST_MAP_READ))
    return;
  Grid grid;
  look(frame, grid);
  gst_video_frame_unmap(&frame);
  if (frames_ > 1) {
    for (std::size_t i = 0; i < grid.size(); ++i)
      change_[i / grid_columns] += static_cast<std::uint64_t>(std::abs(grid[i] - last_[i]));
    ++compared_;
  }
  last_ = grid;
}

int StillBottom::rows() const {
  if (compared_ < least_compared)
    return 0;
  const double pixels = static_cast<double>(compared_) * grid_columns;
  int still_rows = 0;
  while (still_rows < grid_rows && static_cast<double>(change_[still_rows]) / pixels < still)
    ++still_rows;
  std::uint64_t above = 0;
  for (int row = still_rows; row < grid_rows; ++row)
    above += change_[row];
  const int rows_above = grid_rows - still_rows;
  if (rows_above == 0 || static_cast<double>(above) / (pixels * rows_above) < moving)
    return 0;
  const int rows = still_rows < 2 ? 0 : frame_row(still_rows);
  return rows * 1000 < least_permille * height_ ? 0 : rows;
}

} // namespace terrainseg::process
