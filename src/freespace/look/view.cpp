// SPDX-License-Identifier: LGPL-2.1-or-later
#include "freespace/look/view.hpp"

#include <algorithm>
#include <cstdlib>

#include "base/tuning.hpp"
#include "coarse/grid.hpp"
#include "coarse/window.hpp"
#include "kernels/cells.hpp"

namespace terrainseg {

PyramidPlan coarse_plan(PixelFormat format, int coarsest) {
  const int texture = texture_level(coarsest);
  // Luma of RGB is a mixture of all three components, so its texture bands need all three.
  const int color = layout_of(format).rgb ? texture : refinement_level(coarsest);
  // The finest level that is read is never sparse. At 4K, with one more sparse level of luma, more ground of
  // rendered trails is missed.
  return {coarsest, color, texture, std::clamp(texture - 1, 0, 1), std::clamp(color - 1, 0, 2)};
}

Grid GridReader::read(const Pyramid& pyramid, int level, const ColorTransform& transform,
                      std::span<const Rectangle> ignore_regions) {
  const Grid source = pyramid.grid(level);
  const int width = source.width;
  bytes_.assign(4 * source.size(), 0);
  const auto part = [&](std::size_t index) { return bytes_.data() + index * source.size(); };
  for (int i = 0; i < source.height; ++i) {
    const std::size_t row = source.at(i, 0);
    transform_row(transform, source.row(i), {part(0) + row, part(1) + row, part(2) + row}, width);
  }
  fill_ignored(ignore_regions, level, width, source.height, 1, part(3));
  return {{Plane{part(0), width}, Plane{part(1), width}, Plane{part(2), width}},
          width,
          source.height,
          level,
          {part(3), source.size()}};
}

void LumaLevels::read(const Pyramid& pyramid, int finest, int coarsest, const ColorTransform& transform,
                      bool rgb) {
  gain_ = rgb ? 1 << 16 : transform.matrix[0][0];
  for (int level = finest; level <= coarsest; ++level) {
    GrayView& luma = levels_[level];
    luma = {pyramid.plane(level, 0), pyramid.width(level), pyramid.height(level)};
    if (!rgb)
      continue;
    const Grid grid = pyramid.grid(level);
    auto& converted = converted_[level];
    converted.resize(grid.size());
    for (int i = 0; i < grid.height; ++i)
      transform_luma_row(transform, grid.row(i), &converted[grid.at(i, 0)], grid.width);
    luma.plane = {converted.data(), grid.width};
  }
}

namespace {

TERRAINSEG_TUNED(int, texture, bands_wanted, 3);

// Adds |right - left| to the sums of the columns: for every pair of pixels, or without pairs for every two
// neighbours.
void add_differences(const std::uint8_t* luma, int step, int whole, int count, int width,
                     std::uint16_t* sums) {
  if (step == 2)
    kernels::add_differences(luma, whole, sums);
  else
    for (int j = 0; j < whole; ++j)
      sums[j] = static_cast<std::uint16_t>(sums[j] + std::abs(luma[j + 1] - luma[j]));
  const int last = std::abs(luma[width - 1] - luma[width - 2]);
  for (int j = whole; j < count; ++j)
    sums[j] = static_cast<std::uint16_t>(sums[j] + last);
}

} // namespace

void TextureReader::read(const LumaLevels& luma, const Grid& grid, std::vector<std::uint16_t>& texture) {
  texture.assign(grid.size(), 0);
  const int bands = std::clamp(grid.level, 1, bands_wanted);
  for (int band = 1; band <= bands; ++band) {
    const int level = std::max(grid.level - band, 0);
    // Level 0 has no finer band: one difference per cell, between neighbouring columns.
    const int step = grid.level == 0 ? 1 : 2, per_cell = 1 << (band - 1);
    // Centres the box of differences on the cell.
    const int before = per_cell / 2;
    const auto& [plane, width, height] = luma.level(level);
    if (width < 2)
      continue;
    const int count = grid.width * per_cell, whole = std::min(count, (width - (step == 1 ? 1 : 0)) / step);
    columns_.resize(before + count);
    std::uint16_t* columns = columns_.data() + before;
    for (int i = 0; i < grid.height; ++i) {
      std::fill(columns_.begin(), columns_.end(), std::uint16_t{0});
      for (int k = 0; k < per_cell; ++k) {
        const int row = std::min(std::max(i * per_cell + k - before, 0) * step, (height - 1) / step * step);
        add_differences(plane.row(row), step, whole, count, width, columns);
      }
      const int shift = 4 - 2 * (band - 1);              // Q4 of the mean of per_cell^2 differences
      std::fill_n(columns_.begin(), before, columns[0]); // the first cell's box ends at the edge of the
                                                         // picture
      kernels::add_boxes(columns_.data(), per_cell, shift, grid.width, &texture[grid.at(i, 0)]);
    }
  }
  const int gain = (luma.gain() * bands_wanted / bands) >> 8;
  if (gain != 256)
    for (std::uint16_t& t : texture)
      t = static_cast<std::uint16_t>(std::min(65535, (t * gain) >> 8));
}

View FrameReader::read(const FrameTask& task, std::uint32_t& exposure_mean, std::uint32_t& black,
                       StageClock& clock) {
  pyramid_.build(task.frame, coarse_plan(task.frame.format, task.grid_level), &task.workers);
  clock.lap(Stage::pyramid);
  const TrainingArea area{
      task.window,      task.supervision,  task.settings.ignore_regions,
      task.frame.width, task.frame.height, VetoArea(task.veto, task.frame.width, task.frame.height)};
  select_cells(area, task.grid_level, window_cells_);
  const Rectangle window =
      window_cells_.empty() ? task.window : training_bounds(area, task.grid_level, window_cells_);
  grid_ = pyramid_.grid(task.grid_level);
  const bool blank = is_blank(grid_);
  vetoed_.reserve(grid_.size()); // so that the first veto does not allocate
  vetoed_.assign(area.veto.empty() ? 0 : grid_.size(), 0);
  area.veto.fill_cells(task.grid_level, grid_.width, grid_.height, 1, vetoed_.data());
  clock.lap(Stage::prefilter);
  if (!blank)
    read_cells(task, exposure_mean, black);
  clock.lap(Stage::features);
  return {task,    pyramid_, luma_, transform_, window,    window_cells_, area.veto,
          vetoed_, blank,    grid_, texture_,   exposure_, cells_,        connected_};
}

void FrameReader::read_cells(const FrameTask& task, std::uint32_t& exposure_mean, std::uint32_t& black) {
  const Settings& settings = task.settings;
  const bool rgb = layout_of(task.frame.format).rgb;
  transform_ = color_transform_of(rgb, task.frame.colorimetry);
  luma_.read(pyramid_, texture_level(task.grid_level), task.grid_level, transform_, rgb);
  grid_ = grid_reader_.read(pyramid_, task.grid_level, transform_, settings.ignore_regions);
  if (settings.texture)
    texture_reader_.read(luma_, grid_, texture_);
  else
    texture_.assign(grid_.size(), 0);
  Light now, light;
  if (settings.exposure) {
    now = light_of(grid_);
    if (settings.learning || black == 0)
      black = follow_slowly(exposure_mean == 0 ? 0 : black, now.black);
    if (settings.learning)
      exposure_mean = follow_slowly(exposure_mean, now.mean);
    light = {exposure_mean, black};
  }
  if (light_of_tables_ != light)
    fill_exposure(light, exposure_);
  light_of_tables_ = light;
  bin_cells(grid_, texture_, exposure_, now.mean, cells_);
  if (settings.connected_ground)
    connected_.look(grid_, cells_);
}

} // namespace terrainseg
