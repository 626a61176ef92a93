// SPDX-License-Identifier: LGPL-2.1-or-later
#include "freespace/look/view.hpp"

#include "coarse/window.hpp"

namespace terrainseg {

View FrameReader::read(const FrameTask& task, std::uint32_t& exposure_mean, StageClock& clock) {
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
    read_cells(task, exposure_mean);
  clock.lap(Stage::features);
  return {task,  pyramid_, transform_, window,    window_cells_, area.veto, vetoed_,
          blank, grid_,    texture_,   exposure_, cells_,        connected_};
}

void FrameReader::read_cells(const FrameTask& task, std::uint32_t& exposure_mean) {
  const Settings& settings = task.settings;
  const bool rgb = layout_of(task.frame.format).rgb;
  transform_ = color_transform_of(rgb, task.frame.colorimetry);
  grid_ = grid_reader_.read(pyramid_, task.grid_level, transform_, settings.ignore_regions);
  if (settings.texture)
    texture_reader_.read(pyramid_, grid_, transform_, rgb, texture_);
  else
    texture_.assign(grid_.size(), 0);
  const std::uint32_t mean_now = settings.exposure ? mean_luma(grid_) : 0;
  if (settings.exposure && settings.learning)
    exposure_mean = follow_exposure(exposure_mean, mean_now);
  const std::uint32_t mean = settings.exposure ? exposure_mean : 0;
  if (exposure_of_tables_ != mean)
    fill_exposure(mean, exposure_);
  exposure_of_tables_ = mean;
  bin_cells(grid_, texture_, exposure_, mean_now, cells_);
  if (settings.connected_ground)
    connected_.look(grid_, cells_);
}

} // namespace terrainseg
