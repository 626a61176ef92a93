// SPDX-License-Identifier: LGPL-2.1-or-later
#include "base/estimate_writer.hpp"

#include <algorithm>
#include <cstring>

#include "base/color_transform.hpp"
#include "base/lattice.hpp"

namespace terrainseg {

int free_permille_ahead(std::span<const std::uint16_t> boundary, int mask_level, const Rectangle& window,
                        int margin) {
  const Rectangle columns =
      cells_in({window.x, 0, window.width, 1}, mask_level, static_cast<int>(boundary.size()), 1);
  const int first =
      columns.width > 0 ? columns.x : std::min(window.x >> mask_level, static_cast<int>(boundary.size()) - 1);
  const int count = std::max(columns.width, 1), limit = std::max(window.y - margin, 0);
  int open = 0;
  for (int x = first; x < first + count; ++x)
    open += boundary[x] <= limit;
  return open * 1000 / count;
}

void EstimateWriter::start(const Frame& frame, const MaskTarget& target, const Settings& settings,
                           const Rectangle& window, std::uint64_t number) {
  const int mask_width = mask_extent(frame.width, settings.mask_level),
            mask_height = mask_extent(frame.height, settings.mask_level);
  mask_plane_ = target.plane;
  if (!mask_plane_.data) {
    own_mask_.resize(static_cast<std::size_t>(mask_width) * mask_height);
    mask_plane_ = {own_mask_.data(), mask_width};
  }
  boundary_.assign(mask_width, static_cast<std::uint16_t>(frame.height));
  estimate_ = {};
  estimate_.frame = number;
  estimate_.frame_width = frame.width;
  estimate_.frame_height = frame.height;
  estimate_.mask = {{mask_plane_.data, mask_plane_.stride}, mask_width, mask_height};
  estimate_.mask_region = {0, 0, frame.width, frame.height};
  estimate_.boundary = boundary_;
  estimate_.window = window;
}

MutablePlane EstimateWriter::start_confidence_map(int width, int height) {
  confidence_map_.assign(static_cast<std::size_t>(width) * height, 0);
  estimate_.confidence_map = {{confidence_map_.data(), width}, width, height};
  return {confidence_map_.data(), width};
}

void EstimateWriter::label_unknown() {
  for (int y = 0; y < estimate_.mask.height; ++y)
    std::memset(mask_plane_.row(y), mask_doubtful, static_cast<std::size_t>(estimate_.mask.width));
  estimate_.flags |= flag_unknown | flag_blocked;
}

void EstimateWriter::tell_free_space(std::uint64_t traversable_pixels, const Settings& settings,
                                     int grid_level) {
  const GrayView& mask = estimate_.mask;
  estimate_.traversable_permille =
      static_cast<int>(traversable_pixels * 1000 / (static_cast<std::uint64_t>(mask.width) * mask.height));
  if (free_permille_ahead(boundary_, settings.mask_level, estimate_.window, 1 << grid_level) <
      settings.blocked_below)
    estimate_.flags |= flag_blocked;
}

void EstimateWriter::add_model(const TerrainModel& model, const ColorSpace& space) {
  estimate_.models[estimate_.model_count++] = {
      model.mean, model.variance, std::max<std::uint64_t>(model.mass >> 8, 1), rgb_of(model.mean, space)};
}

} // namespace terrainseg
