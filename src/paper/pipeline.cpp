// SPDX-License-Identifier: LGPL-2.1-or-later
#include "paper/pipeline.hpp"

#include <algorithm>

#include "base/lattice.hpp"
#include "terrainseg/estimate.hpp"

namespace terrainseg {
namespace {

/// Extends the reached cells of a row to their free neighbours.
void spread(const std::uint8_t* free_row, std::span<std::uint8_t> reached) {
  const int width = static_cast<int>(reached.size());
  for (int x = 1; x < width; ++x)
    reached[x] |= reached[x - 1] & static_cast<std::uint8_t>(free_row[x] != 0);
  for (int x = width - 2; x >= 0; --x)
    reached[x] |= reached[x + 1] & static_cast<std::uint8_t>(free_row[x] != 0);
}

/// The row between `start` and `last`, searched upwards, that best separates traversable pixels below from
/// others above.
int parting_row(const GrayView& mask, int x, int start, int last) {
  int best = start, agreement = 0, most = 0;
  for (int y = start - 1; y >= last; --y) {
    agreement += mask.plane.row(y)[x] == mask_traversable ? 1 : -1;
    if (agreement > most) {
      most = agreement;
      best = y;
    }
  }
  return best;
}

/// "The dominant color model, which corresponds to the ROI" (paper): the window's Gaussian when the window is
/// learned, otherwise the learned model with the largest mass.
std::optional<Gaussian> ground_color(bool learned, Gaussian window, const Terrain& terrain) {
  if (!learned) {
    const int model = heaviest(terrain.models);
    return model < 0 ? std::nullopt : std::optional(terrain.models[model]);
  }
  for (std::uint32_t& variance : window.variance)
    variance = std::max(variance, variance_floor(0));
  return window;
}

} // namespace

void find_reachable(std::span<const std::uint8_t> free_cells, int width, const Rectangle& window_cells,
                    std::vector<std::int16_t>& top) {
  top.assign(width, -1);
  std::array<std::uint8_t, 32768> reached; // large enough for any grid
  const std::span<std::uint8_t> row_reached(reached.data(), static_cast<std::size_t>(width));
  const auto is_free = [&](int x, int y) { return free_cells[static_cast<std::size_t>(y) * width + x] != 0; };

  for (int y = window_cells.y + window_cells.height - 1; y >= window_cells.y; --y) {
    std::fill(row_reached.begin(), row_reached.end(), std::uint8_t{0});
    for (int x = window_cells.x; x < window_cells.x + window_cells.width; ++x)
      row_reached[x] = is_free(x, y);
    spread(&free_cells[static_cast<std::size_t>(y) * width], row_reached);
    for (int x = 0; x < width; ++x)
      if (row_reached[x])
        top[x] = static_cast<std::int16_t>(y);
  }
  for (int x = 0; x < width; ++x)
    while (top[x] > 0 && is_free(x, top[x] - 1))
      --top[x];
}

void refine_reachable(const Grid& grid, std::span<const std::int16_t> top, const GrayView& mask,
                      int mask_level, int frame_height, std::span<std::uint16_t> boundary) {
  const int half = (1 << grid.level) >> 1;
  for (int x = 0; x < mask.width; ++x) {
    const int cell = std::min(((x << mask_level) + half) >> grid.level, grid.width - 1);
    const int row = top[cell];
    if (row < 0) {
      boundary[x] = static_cast<std::uint16_t>(frame_height);
      continue;
    }
    const int centre = row << grid.level, above = std::max(row - 1, 0) << grid.level;
    const int parting =
        parting_row(mask, x, std::min(centre >> mask_level, mask.height - 1), above >> mask_level);
    boundary[x] = static_cast<std::uint16_t>(parting << mask_level);
  }
}

void PaperPipeline::adapt(const Settings& settings, int grid_level) {
  plan_.coarsest = std::max(grid_level, settings.mask_level);
  plan_.finest_color = settings.mask_level > 0 ? std::min(grid_level, settings.mask_level) : grid_level;
  plan_.finest_luma = plan_.finest_color;
  table_is_old_ = true;
}

void PaperPipeline::process(const FrameTask& task, Terrain& terrain, EstimateWriter& out, StageClock& clock) {
  const Settings& settings = task.settings;
  Estimate& estimate = out.estimate();

  // A: octave pyramid.
  const TrainingArea area{
      task.window,      task.supervision,  settings.ignore_regions,
      task.frame.width, task.frame.height, VetoArea(task.veto, task.frame.width, task.frame.height)};
  const int training_level = select_training_level(
      area, task.grid_level, samples_per_model * settings.training_models, window_cells_);
  plan_.finest_color = plan_.finest_luma = std::min(plan_.finest_color, training_level);
  pyramid_.build(task.frame, plan_, &task.workers);
  const Grid grid = pyramid_.grid(task.grid_level), training_grid = pyramid_.grid(training_level);
  clock.lap(Stage::pyramid);

  // B: training window and its pre-filter.
  const bool blank = is_blank(grid);
  const Gaussian window = moments_of(training_grid, window_cells_);
  prefilter(training_grid, window_cells_, window, {settings.window_sigma_q8}, kept_);
  if (!window_cells_.empty())
    estimate.window = training_bounds(area, training_level, window_cells_);
  const Rectangle window_cells = cells_of_window(estimate.window, grid.level, grid.width, grid.height);
  estimate.flags = learning_flag(settings, blank || window_cells_.size() < samples_per_model);
  const bool learns = estimate.flags & flag_learned;
  clock.lap(Stage::prefilter);

  // C: clustering in the perception sub-space.
  TrainingModels training;
  if (learns) {
    const int b = settings.bit_shift;
    const std::uint32_t floor = variance_floor(b);
    clusters_.reserve(window_cells_.size());
    training =
        cluster(training_grid, kept_.cells,
                {settings.training_models, {b, b, b}, {floor, floor, floor}, settings.seed}, clusters_);
  }
  clock.lap(Stage::clustering);

  // D: horizon.
  Horizon horizon;
  if (const auto ground = ground_color(learns, window, terrain);
      ground && !blank && settings.horizon != HorizonMode::off)
    horizon = find_horizon(grid, *ground, window_cells.y, window_cells.y + window_cells.height);
  clock.lap(Stage::horizon);

  // Update of the learned models with the training models.
  if (learns) {
    learn(terrain.models, training.span(), learning_rule(settings, window_cells_.size()));
    ++terrain.generation;
    table_is_old_ = true;
  }
  clock.lap(Stage::update);

  if (blank || heaviest(terrain.models) < 0)
    return out.label_unknown();
  if (table_is_old_)
    table_.build(terrain.models, settings.threshold_q8, settings.bit_shift);
  table_is_old_ = false;
  label(task, grid, window_cells, horizon, area.veto, out, clock);
}

// E: back-projection of the learned models.
void PaperPipeline::label(const FrameTask& task, const Grid& grid, const Rectangle& window_cells,
                          const Horizon& horizon, const VetoArea& veto, EstimateWriter& out,
                          StageClock& clock) {
  const Settings& settings = task.settings;
  Estimate& estimate = out.estimate();

  // Scores of the cells, for the confidence.
  table_.score(grid, scores_);
  estimate.confidence = mean_closeness(scores_, grid.width, window_cells);
  estimate.horizon_row = horizon.row < 0 ? -1 : horizon.row << grid.level;
  estimate.horizon_confidence = horizon.confidence;
  clock.lap(Stage::scoring);

  // Each pixel is labelled by its own colour.
  const GrayView& mask = estimate.mask;
  const int first_row = subsampled(std::max(estimate.horizon_row, 0), settings.mask_level);
  std::uint64_t traversable =
      settings.mask_level == 0
          ? table_.label(task.frame, first_row, out.mask(), task.workers)
          : table_.label(pyramid_.grid(settings.mask_level), first_row, out.mask(), task.workers);
  traversable -=
      mark_ignored(settings.ignore_regions, settings.mask_level, out.mask(), mask.width, mask.height);
  traversable -= veto.mark(settings.mask_level, out.mask(), mask.width, mask.height);
  clock.lap(Stage::mask);

  // The free space that is connected to the training window.
  find_reach(grid, window_cells, horizon, veto, settings, out);
  out.tell_free_space(traversable, settings, grid.level);
  clock.lap(Stage::boundary);
}

// An addition to the paper: finds the free cells connected to the window. Replaces the scores by 1 (free) or
// 0.
void PaperPipeline::find_reach(const Grid& grid, const Rectangle& window_cells, const Horizon& horizon,
                               const VetoArea& veto, const Settings& settings, EstimateWriter& out) {
  for (std::uint8_t& cell : scores_)
    cell = cell <= kernels::score_limit;
  std::fill_n(scores_.begin(), static_cast<std::ptrdiff_t>(std::max(horizon.row, 0)) * grid.width, 0);
  fill_ignored(settings.ignore_regions, grid.level, grid.width, grid.height, 0, scores_.data());
  veto.fill_cells(grid.level, grid.width, grid.height, 0, scores_.data());
  find_reachable(scores_, grid.width, window_cells, top_);
  const Estimate& estimate = out.estimate();
  refine_reachable(grid, top_, estimate.mask, settings.mask_level, estimate.frame_height, out.boundary());
  if (veto.empty())
    return;
  veto.lower(settings.mask_level, out.boundary());
  for (std::uint16_t& row : out.boundary())
    if (row >= estimate.window.y + estimate.window.height)
      row = static_cast<std::uint16_t>(estimate.frame_height); // no ground is left in the window's rows
}

} // namespace terrainseg
