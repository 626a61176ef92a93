// SPDX-License-Identifier: LGPL-2.1-or-later
// The order of the stages: the paper's, and the default pipeline beside it.
#include "terrainseg/segmenter.hpp"

#include <algorithm>

#include "reach.hpp"
#include "segmenter_state.hpp"
#include "terrain_model.hpp"

namespace terrainseg {
namespace {

/// Fewest cells that a Gaussian is made of (the paper's window has 8 at 1/32: too few).
constexpr int samples_per_model = 16;

} // namespace

// The paper's figure 2.
Status Segmenter::process(const Frame& frame, const Supervision& supervision, const MaskTarget& target) {
  State& s = *state_;
  if (Status status = s.admit(frame, target); !status.ok())
    return status;
  s.adapt(frame);
  s.start_estimate(frame, target);
  if (s.settings.free_space) {
    s.find_free_space(frame, supervision);
    s.describe_models();
    return {};
  }
  const TrainingArea area{s.window, supervision, s.settings.ignore_regions, frame.width, frame.height};
  const int training_level =
      select_training_level(area, s.level, samples_per_model * s.settings.training_models, s.window_cells);
  s.plan.finest_color = s.plan.finest_luma = std::min(s.plan.finest_color, training_level);
  StageClock clock(s.times);

  // A: the octave pyramid.
  s.pyramid.build(frame, s.plan, &*s.workers);
  const Grid grid = s.grid_at(s.level), training_grid = s.grid_at(training_level);
  clock.lap(Stage::pyramid);

  // B: the window and its pre-filter.
  const bool blank = is_blank(grid);
  const Moments window = moments_of(training_grid, s.window_cells);
  prefilter(training_grid, s.window_cells, window, {s.settings.window_sigma_q8}, s.kept);
  if (!s.window_cells.empty())
    s.estimate.window = training_bounds(area, training_level, s.window_cells);
  s.estimate.flags = s.gate(blank || s.window_cells.size() < samples_per_model);
  clock.lap(Stage::prefilter);

  // C: clustering in the perception sub-space.
  TrainingModels training;
  if (s.estimate.flags & flag_learned)
    training = s.cluster_window(training_grid);
  clock.lap(Stage::clustering);

  // D: the horizon.
  Horizon horizon;
  if (const auto ground = s.ground_color(window);
      ground && !blank && s.settings.horizon != HorizonMode::off) {
    const Rectangle rows = cells_of_window(s.estimate.window, s.level, grid.width, grid.height);
    horizon = find_horizon(grid, *ground, rows.y, rows.y + rows.height);
  }
  clock.lap(Stage::horizon);

  // The learned mixture takes in the training models.
  if (s.estimate.flags & flag_learned)
    s.update(training);
  clock.lap(Stage::update);

  // E: scoring, coarse and back-projected.
  if (blank || heaviest(s.terrain.models) < 0)
    s.label_unknown();
  else
    s.label_by_score(frame, grid, horizon, clock);
  s.describe_models();
  return {};
}

// The default pipeline: the same stages, and those beyond the paper.
void Segmenter::State::find_free_space(const Frame& frame, const Supervision& supervision) {
  StageClock clock(times);
  pyramid.build(frame, coarse_plan(frame.format, level), &*workers);
  clock.lap(Stage::pyramid);

  const TrainingArea area{window, supervision, settings.ignore_regions, frame.width, frame.height};
  select_cells(area, level, window_cells);
  if (!window_cells.empty())
    estimate.window = training_bounds(area, level, window_cells);
  if (is_blank(grid_at(level))) {
    estimate.flags = gate(true);
    label_unknown();
    clock.lap(Stage::mask);
    return;
  }
  path.look(frame, pyramid, level, settings, !settings.learning, terrain);
  const Grid colors = path.colors();
  const Rectangle rows = cells_of_window(estimate.window, level, colors.width, colors.height);
  PrefilterRule rule{settings.window_sigma_q8};
  rule.variance_floor = 41 << 8; // even ground of one colour keeps its noise
  rule.scarce = PrefilterRule::Scarce::all_below_one_quarter;
  const Moments moments = moments_of(colors, window_cells);
  prefilter(colors, window_cells, moments, rule, kept);
  const bool may_learn = settings.learning && settings.near_clear;
  const bool foreign = may_learn && supervision.empty() && path.window_is_foreign(rows, settings, terrain);
  estimate.flags = gate(kept.cells.empty() || foreign || colors.width * colors.height < samples_per_model);
  clock.lap(Stage::prefilter);

  if (estimate.flags & flag_learned) {
    // The mixture is evaluated at bin centres, but learned from unshifted colours: as accurate, and the
    // models' colours are those of the ground.
    constexpr std::uint32_t least_variance = 180 << 8;
    const ClusterRule bins{
        settings.training_models, {0, 0, 0}, {least_variance, least_variance, least_variance}, settings.seed};
    clusters.samples.reserve(window_cells.size()); // what the pre-filter keeps differs from frame to frame
    clusters.cluster_of.reserve(window_cells.size());
    const TrainingModels training = cluster(colors, kept.cells, bins, clusters);
    clock.lap(Stage::clustering);
    update(training);
    path.learn(window_cells, kept.cells, training, settings, terrain);
    clock.lap(Stage::update);
  } else {
    path.rely_on_memory();
  }
  if (heaviest(terrain.models) < 0) {
    label_unknown();
    return;
  }
  if (!settings.near_clear || foreign)
    kept.cells.clear();
  int horizon_limit = 0;
  if (settings.horizon == HorizonMode::paper) {
    const Horizon horizon =
        find_horizon(colors, {moments.mean, moments.variance}, rows.y, rows.y + rows.height);
    horizon_limit = std::max(horizon.row, 0);
    estimate.horizon_row = horizon.row < 0 ? -1 : horizon.row << level;
    estimate.horizon_confidence = horizon.confidence;
  }
  clock.lap(Stage::horizon);
  path.score(kept.cells, frame.pts, settings, terrain);
  clock.lap(Stage::scoring);
  path.find_boundary(settings, horizon_limit, terrain);
  label_free_space(frame, clock);
  if (foreign || !settings.near_clear)
    estimate.confidence /= 2; // from memory only: what is in front has not been looked at
}

void Segmenter::State::label_free_space(const Frame& frame, StageClock& clock) {
  const FreeSpaceCurves& curves = path.refine(pyramid, frame, settings);
  reachable_rows(curves.safe, settings.mask_level, estimate.window, frame.height, boundary);
  if (settings.horizon == HorizonMode::automatic) {
    const DefaultPath::HorizonRow horizon = path.horizon(frame.height, settings.mask_level);
    estimate.horizon_row = horizon.row;
    estimate.horizon_confidence = horizon.confidence;
  }
  estimate.confidence = path.confidence();
  clock.lap(Stage::boundary);
  const GrayView& view = estimate.mask;
  const std::uint64_t traversable = free_space.write(curves, settings.mask_level, settings.ignore_regions,
                                                     mask_plane, view.height, *workers);
  estimate.traversable_permille =
      static_cast<int>(traversable * 1000 / (static_cast<std::uint64_t>(view.width) * view.height));
  if (free_permille_ahead(boundary, settings.mask_level, estimate.window, 1 << level) <
      settings.blocked_below)
    estimate.flags |= flag_blocked;
  clock.lap(Stage::mask);
}

/// Whether this frame's window is learned, and if not, why.
std::uint32_t Segmenter::State::gate(bool starved) {
  if (!settings.learning) {
    ++counters.skipped_frozen;
    return flag_frozen;
  }
  if (!settings.near_clear) {
    ++counters.skipped_near;
    return flag_frozen;
  }
  if (starved) {
    ++counters.skipped_starved;
    return flag_starved;
  }
  ++counters.learned;
  return flag_learned;
}

/// "The dominant color model, which corresponds to the ROI": the window where it is trusted, else the
/// heaviest learned model.
std::optional<GroundColor> Segmenter::State::ground_color(const Moments& window_moments) const {
  GroundColor ground;
  if (estimate.flags & flag_learned) {
    ground = {window_moments.mean, window_moments.variance};
    for (std::uint32_t& variance : ground.variance)
      variance = std::max(variance, variance_floor(0));
    return ground;
  }
  const int model = heaviest(terrain.models);
  if (model < 0)
    return std::nullopt;
  return GroundColor{terrain.models[model].mean, terrain.models[model].variance};
}

TrainingModels Segmenter::State::cluster_window(const Grid& grid) {
  const int b = settings.bit_shift;
  const std::uint32_t floor = variance_floor(b);
  clusters.samples.reserve(window_cells.size());
  clusters.cluster_of.reserve(window_cells.size());
  return cluster(grid, kept.cells,
                 {settings.training_models, {b, b, b}, {floor, floor, floor}, settings.seed}, clusters);
}

void Segmenter::State::update(const TrainingModels& training) {
  LearningRule rule;
  rule.match_threshold_q8 = static_cast<std::uint32_t>(settings.match_threshold_q8);
  rule.mass_cap = static_cast<std::uint64_t>(settings.mass_cap) * window_cells.size() << 8;
  rule.forget_shift = settings.forget_shift;
  learn(terrain.models, training.span(), rule);
  ++terrain.generation;
  table_is_old = true;
}

/// The paper's scoring: each pixel by its own colour.
void Segmenter::State::label_by_score(const Frame& frame, const Grid& grid, const Horizon& horizon,
                                      StageClock& clock) {
  if (table_is_old)
    table.build(terrain.models, settings.threshold_q8, settings.bit_shift);
  table_is_old = false;
  table.score(grid, scores);
  const Rectangle covered = cells_of_window(estimate.window, level, grid.width, grid.height);
  estimate.confidence = mean_closeness(scores, grid.width, covered);
  clock.lap(Stage::scoring);

  const GrayView& view = estimate.mask;
  const int horizon_row = horizon.row < 0 ? 0 : horizon.row << level,
            first_row = subsampled(horizon_row, settings.mask_level);
  std::uint64_t traversable =
      settings.mask_level == 0 ? table.label(frame, first_row, mask_plane, *workers)
                               : table.label(grid_at(settings.mask_level), first_row, mask_plane, *workers);
  traversable -=
      mark_ignored(settings.ignore_regions, settings.mask_level, mask_plane, view.width, view.height);
  clock.lap(Stage::mask);

  for (std::uint8_t& cell : scores)
    cell = cell <= kernels::score_limit;
  std::fill_n(scores.begin(), static_cast<std::ptrdiff_t>(std::max(horizon.row, 0)) * grid.width, 0);
  for (const Rectangle& pixels : settings.ignore_regions) {
    const Rectangle cells = cells_in(pixels, level, grid.width, grid.height);
    for (int y = cells.y; y < cells.y + cells.height; ++y)
      std::fill_n(scores.begin() + static_cast<std::ptrdiff_t>(y) * grid.width + cells.x, cells.width, 0);
  }
  reach(scores, grid.width, covered, top);
  refine_reach(grid, top, view, settings.mask_level, height, boundary);
  const int free = free_permille_ahead(boundary, settings.mask_level, estimate.window, 1 << level);
  clock.lap(Stage::boundary);

  estimate.horizon_row = horizon.row < 0 ? -1 : horizon_row;
  estimate.horizon_confidence = horizon.confidence;
  estimate.traversable_permille =
      static_cast<int>(traversable * 1000 / (static_cast<std::uint64_t>(view.width) * view.height));
  if (free < settings.blocked_below)
    estimate.flags |= flag_blocked;
}

} // namespace terrainseg
