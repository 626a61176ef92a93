// SPDX-License-Identifier: LGPL-2.1-or-later
// The order of the stages, and what lasts from frame to frame.
#include "terrainseg/segmenter.hpp"

#include <algorithm>
#include <cstdlib>
#include <cstring>
#include <optional>
#include <vector>

#include "clustering.hpp"
#include "color.hpp"
#include "default_path.hpp"
#include "frame_check.hpp"
#include "horizon.hpp"
#include "pyramid.hpp"
#include "reach.hpp"
#include "scoring.hpp"
#include "stage_clock.hpp"
#include "terrain_model.hpp"
#include "window.hpp"
#include "workers.hpp"

namespace terrainseg {
namespace {

/// Fewest cells that a Gaussian is made of (the paper's window has 8 at 1/32: too few).
constexpr int samples_per_model = 16;

/// The level that is scored coarse. -1 = the first under 96 cells wide; never so coarse that fewer than 4
/// rows or columns are left, where neither a window nor a horizon has a place.
int grid_level(int wanted, int width, int height) {
  int level = std::max(wanted, 0);
  if (wanted < 0)
    while (level < max_pyramid_levels && subsampled(width, level) >= 96)
      ++level;
  while (level > 0 && subsampled(std::min(width, height), level) < 4)
    --level;
  return level;
}

/// True when a picture shows nothing: a covered lens, a dead camera. All of it would look like its window.
bool is_blank(const Grid& grid) {
  constexpr int noise = 2;
  for (const Plane& plane : grid.planes) {
    int least = 255, most = 0;
    for (int y = 0; y < grid.height; ++y) {
      const auto [low, high] = std::minmax_element(plane.row(y), plane.row(y) + grid.width);
      least = std::min<int>(least, *low);
      most = std::max<int>(most, *high);
    }
    if (most - least > noise)
      return false;
  }
  return true;
}

std::string text_of(const Rectangle& r) {
  return std::to_string(r.width) + "x" + std::to_string(r.height);
}

} // namespace

ColorSpace learning_space(const Settings& settings, const ColorSpace& frames) {
  if (settings.free_space)
    return normalised_space;
  ColorSpace space = frames;
  if (space.rgb)
    space.colorimetry.matrix = ColorMatrix::bt601; // means nothing there: must not tell two spaces apart
  return space;
}

const char* name_of(Stage stage) {
  constexpr const char* names[stage_count] = {"pyramid", "prefilter", "clustering", "update",
                                              "horizon", "scoring",   "boundary",   "mask"};
  return names[static_cast<int>(stage)];
}

struct Segmenter::State {
  explicit State(const Settings& initial) : settings(initial) {
    resize_mixture(terrain.models, settings.learned_models);
  }

  Status admit(const Frame& frame, const MaskTarget& target) const;
  void adapt(const Frame& frame);
  void forget();
  Grid grid_at(int pyramid_level) const;
  std::uint32_t gate(bool starved);
  void find_free_space(const Frame& frame, const Supervision& supervision);
  std::optional<GroundColor> ground_color(const Moments& window) const;
  TrainingModels cluster_window(const Grid& grid);
  void update(const TrainingModels& training);
  void start_estimate(const Frame& frame, const MaskTarget& target);
  void label_by_score(const Frame& frame, const Grid& grid, const Horizon& horizon, StageClock& clock);
  void label_free_space(const Frame& frame, StageClock& clock);
  void label_unknown();
  void describe_models();

  // What was asked for, and what follows from it for frames of one size.
  Settings settings;
  int width = 0, height = 0;
  std::optional<ColorSpace> space; ///< of the last frame
  bool stale = true;               ///< settings changed: adapt() starts anew
  int level = 0;                   ///< of the grid
  PyramidPlan plan;
  Rectangle window;

  // What lasts.
  Terrain terrain;
  Counters counters;
  std::array<std::int64_t, stage_count> times{};

  // Room for one frame.
  std::optional<Workers> workers;
  Pyramid pyramid;
  DefaultPath path;
  FreeSpace free_space;
  std::vector<Cell> window_cells;
  Prefiltered kept;
  ClusterScratch clusters;
  ScoreTable table;
  bool table_is_old = true;
  std::vector<std::uint8_t> scores, mask;
  std::vector<std::int16_t> top;
  std::vector<std::uint16_t> boundary;
  MutablePlane mask_plane;
  Estimate estimate;
};

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
    path.learn(window_cells, kept.cells, settings, terrain);
    clock.lap(Stage::update);
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

Status Segmenter::State::admit(const Frame& frame, const MaskTarget& target) const {
  if (std::string flaw = flaw_of(frame); !flaw.empty())
    return {Status::Code::bad_frame, std::move(flaw)};
  if (!place_window(settings, frame.width, frame.height))
    return {Status::Code::window_outside_frame,
            "the training window (window-width = " + std::to_string(settings.window_width) +
                ", window-height = " + std::to_string(settings.window_height) +
                ", window-bottom = " + std::to_string(settings.window_bottom) +
                ", window-x = " + std::to_string(settings.window_x) + ") does not fit a frame of " +
                text_of({0, 0, frame.width, frame.height}) + ": make it smaller, or 0 to follow the frame"};
  if (target.plane.data) {
    const Rectangle needed{0, 0, mask_extent(frame.width, settings.mask_level),
                           mask_extent(frame.height, settings.mask_level)};
    if (target.width != needed.width || target.height != needed.height)
      return {Status::Code::bad_target, "the mask target is " + text_of({0, 0, target.width, target.height}) +
                                            ", the mask of this frame is " + text_of(needed)};
    if (std::abs(target.plane.stride) < target.width && target.height > 1)
      return {Status::Code::bad_target, "the mask target's stride of " + std::to_string(target.plane.stride) +
                                            " bytes is shorter than its row of " +
                                            std::to_string(target.width)};
  }
  return {};
}

/// Follows the frame's size and colour space. What was learned survives a change of size, not one of colours.
void Segmenter::State::adapt(const Frame& frame) {
  const ColorSpace now = learning_space(settings, {layout_of(frame.format).rgb, frame.colorimetry});
  if (terrain.space != now) {
    if (heaviest(terrain.models) >= 0)
      forget();
    terrain.space = now;
  }
  space = now;
  if (!stale && frame.width == width && frame.height == height)
    return;
  stale = false;
  const int new_level = grid_level(settings.pyramid_levels, frame.width, frame.height);
  if (frame.width != width || frame.height != height || new_level != level)
    path.forget_frames();
  width = frame.width;
  height = frame.height;
  level = new_level;
  plan.coarsest = std::max(level, settings.mask_level);
  plan.finest_color = settings.mask_level > 0 ? std::min(level, settings.mask_level) : level;
  plan.finest_luma = plan.finest_color;
  window = *place_window(settings, width, height);
  path.forget_terrain();
  resize_mixture(terrain.models, settings.learned_models);
  table_is_old = true;
  if (!workers || workers->count() != settings.n_threads)
    workers.emplace(settings.n_threads);
}

void Segmenter::State::forget() {
  const std::uint32_t generation = terrain.generation + 1;
  terrain = {};
  terrain.generation = generation;
  if (space)
    terrain.space = *space;
  resize_mixture(terrain.models, settings.learned_models);
  table_is_old = true;
  path.forget_frames();
  path.forget_terrain();
}

Grid Segmenter::State::grid_at(int pyramid_level) const {
  return {{pyramid.plane(pyramid_level, 0), pyramid.plane(pyramid_level, 1), pyramid.plane(pyramid_level, 2)},
          pyramid.width(pyramid_level),
          pyramid.height(pyramid_level),
          pyramid_level};
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

void Segmenter::State::start_estimate(const Frame& frame, const MaskTarget& target) {
  const int mask_width = mask_extent(frame.width, settings.mask_level),
            mask_height = mask_extent(frame.height, settings.mask_level);
  mask_plane = target.plane;
  if (!mask_plane.data) {
    mask.resize(static_cast<std::size_t>(mask_width) * mask_height);
    mask_plane = {mask.data(), mask_width};
  }
  boundary.assign(static_cast<std::size_t>(mask_width), static_cast<std::uint16_t>(frame.height));
  estimate = {};
  estimate.frame = counters.frames++;
  estimate.frame_width = frame.width;
  estimate.frame_height = frame.height;
  estimate.mask = {{mask_plane.data, mask_plane.stride}, mask_width, mask_height};
  estimate.mask_region = {0, 0, frame.width, frame.height};
  estimate.boundary = boundary;
  estimate.window = window;
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

void Segmenter::State::label_unknown() {
  for (int y = 0; y < estimate.mask.height; ++y)
    std::memset(mask_plane.row(y), mask_doubtful, static_cast<std::size_t>(estimate.mask.width));
  estimate.flags |= flag_unknown | flag_blocked;
}

void Segmenter::State::describe_models() {
  estimate.model_generation = terrain.generation;
  for (TerrainModel model : terrain.models) {
    if (model.mass == 0)
      continue;
    if (settings.free_space)
      model = path.in_this_light(model);
    estimate.models[static_cast<std::size_t>(estimate.model_count++)] = {
        model.mean, model.variance, std::max<std::uint64_t>(model.mass >> 8, 1),
        rgb_of(model.mean, terrain.space)};
  }
}

Segmenter::Segmenter(const Settings& settings) : state_(std::make_unique<State>(settings)) {}
Segmenter::~Segmenter() = default;
Segmenter::Segmenter(Segmenter&&) noexcept = default;
Segmenter& Segmenter::operator=(Segmenter&&) noexcept = default;

void Segmenter::configure(const Settings& settings) {
  if (settings == state_->settings)
    return;
  // The two pipelines learn in different colours.
  if (settings.free_space != state_->settings.free_space && heaviest(state_->terrain.models) >= 0)
    state_->forget();
  state_->settings = settings;
  state_->stale = true;
}

const Settings& Segmenter::settings() const {
  return state_->settings;
}

const Estimate& Segmenter::estimate() const {
  return state_->estimate;
}

void Segmenter::reset() {
  state_->forget();
}

void Segmenter::reset_temporal() {
  state_->path.forget_frames();
}

Terrain Segmenter::terrain() const {
  return state_->terrain;
}

Status Segmenter::adopt(const Terrain& terrain) {
  State& s = *state_;
  if (s.space && *s.space != terrain.space)
    return {Status::Code::foreign_terrain,
            "the terrain was learned in another colour space than that of the frames: learn it anew"};
  const bool of_default_path = !terrain.negative_colors.empty();
  if (heaviest(terrain.models) >= 0 && of_default_path != s.settings.free_space)
    return {Status::Code::foreign_terrain,
            "the terrain was learned with free-space = " + std::string(of_default_path ? "true" : "false") +
                ", which learns other colours: set it alike, or learn the terrain anew"};
  const auto has_shape = [](const auto& histogram, std::size_t bins) {
    return histogram.empty() || histogram.size() == bins;
  };
  constexpr std::uint32_t most_variance = 256u * 256 << 8;
  const bool sound = std::all_of(terrain.models.begin(), terrain.models.end(), [](const TerrainModel& model) {
    return model.mass == 0 || std::all_of(model.variance.begin(), model.variance.end(),
                                          [](std::uint32_t v) { return v > 0 && v <= most_variance; });
  });
  if (terrain.models.size() > max_models || !has_shape(terrain.negative_colors, color_bins) ||
      !has_shape(terrain.terrain_texture, texture_bins) ||
      !has_shape(terrain.negative_texture, texture_bins) || !sound)
    return {Status::Code::foreign_terrain,
            "the terrain has another shape than this version learns: learn it anew"};
  s.terrain = terrain;
  resize_mixture(s.terrain.models, s.settings.learned_models);
  s.table_is_old = true;
  s.path.forget_terrain();
  return {};
}

const Counters& Segmenter::counters() const {
  return state_->counters;
}

const std::array<std::int64_t, stage_count>& Segmenter::stage_times() const {
  return state_->times;
}

} // namespace terrainseg
