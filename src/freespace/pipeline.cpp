// SPDX-License-Identifier: LGPL-2.1-or-later
#include "freespace/pipeline.hpp"

#include <algorithm>
#include <optional>

#include "base/lattice.hpp"
#include "coarse/horizon.hpp"
#include "freespace/answer/confidence.hpp"
#include "freespace/curve/doubtful.hpp"
#include "freespace/curve/row_prior.hpp"
#include "learning/terrain_model.hpp"

namespace terrainseg {
namespace {

/// Even ground of one colour keeps its noise (Q8).
constexpr std::uint32_t prefilter_floor = 41 << 8;
/// Of a training model, per component (Q8).
constexpr std::uint32_t least_variance = 180 << 8;
/// Rows of cells below the slow horizon that are searched for odd spots in cells half as large: a fifth of
/// the usual picture. Of what stands on rendered plains 76 % is called ground without them, with 24 rows 58,
/// with 32 51, 36 46, 48 45, 60 43; the drives' mean error grows by 0.01 with 36, by 0.02 with 48.
constexpr int far_rows = 36;

/// What is known of the ground's vanishing line before the frame is seen. A setting that lies below the frame
/// is none: there would be no ground.
FrameLine known_line(const FrameTask& task) {
  const int row = task.settings.vanishing_row;
  if (row != -1 && row < task.frame.height)
    return {FrameLine::Source::setting, row * 256};
  constexpr std::int32_t farthest = 1 << 24;
  if (task.frame.vanishing_row)
    return {FrameLine::Source::pose, std::clamp(*task.frame.vanishing_row, -farthest, farthest)};
  return {};
}

/// Where the ground plane ends, as far as it lies within the frame: at its vanishing line, from the setting,
/// else from the pose and what motion corrects of it, else from motion in the frame before.
FrameLine end_of_plane(const FrameTask& task, bool continued, const MotionTrack& track) {
  const FrameLine known = known_line(task);
  const bool by_motion = task.settings.motion != Motion::off;
  if (!known.known())
    return continued && by_motion ? track.line : FrameLine{};
  const bool corrected = by_motion && known.source == FrameLine::Source::pose;
  return known.lower_by(corrected ? track.line_offset : 0).within(task.frame.height);
}

PrefilterRule prefilter_rule(const Settings& settings) {
  return {settings.window_sigma_q8, prefilter_floor, PrefilterRule::Scarce::all_below_one_quarter};
}

} // namespace

void FreeSpacePipeline::process(const FrameTask& task, Terrain& terrain, EstimateWriter& out,
                                StageClock& clock) {
  const Settings& settings = task.settings;
  Estimate& estimate = out.estimate();

  // 1. The octave pyramid (paper, A).
  pyramid_.build(task.frame, coarse_plan(task.frame.format, task.grid_level), &task.workers);
  clock.lap(Stage::pyramid);

  const Grid grid = pyramid_.grid(task.grid_level);
  const MutablePlane confidence_map = out.start_confidence_map(grid.width, grid.height);

  // 2. The training window, or what stands in for it (B).
  const TrainingArea area{task.window, task.supervision, settings.ignore_regions, task.frame.width,
                          task.frame.height};
  select_cells(area, task.grid_level, window_cells_);
  if (!window_cells_.empty())
    estimate.window = training_bounds(area, task.grid_level, window_cells_);
  if (is_blank(grid)) {
    estimate.flags = learning_flag(settings, true);
    out.label_unknown();
    clock.lap(Stage::mask);
    return;
  }

  clock.lap(Stage::prefilter);

  // 3. Every cell's colour and texture, freed of the light.
  read_cells(task, terrain);
  const Grid colors = colors_of(cells_, grid_);
  const Rectangle window = cells_of_window(estimate.window, grid_.level, grid_.width, grid_.height);
  clock.lap(Stage::features);

  // 4. The window's pre-filter, without the rover's own shadow, and whether something stands in the window.
  const bool shaded = settings.own_shadow && task.supervision.empty() &&
                      leave_own_shadow(colors, window, window_cells_, lit_cells_);
  const std::span<const Cell> taught = shaded ? lit_cells_ : window_cells_;
  const Gaussian window_moments = moments_of(colors, taught);
  prefilter(colors, taught, window_moments, prefilter_rule(settings), kept_);
  const bool foreign = window_is_foreign(task, window, terrain);
  estimate.flags =
      learning_flag(settings, kept_.cells.empty() || foreign || grid_.size() < samples_per_model);
  clock.lap(Stage::prefilter);

  // 5. What the window teaches: Gaussians (C, D), and histograms of what stands against it.
  if (estimate.flags & flag_learned)
    learn_window(settings, colors, terrain, clock);
  else
    rely_on_memory();
  if (heaviest(terrain.models) < 0) {
    out.label_unknown();
    return;
  }

  // 6. The paper's horizon (D), where it is asked for.
  Horizon horizon;
  if (settings.horizon == HorizonMode::paper)
    horizon = find_horizon(colors, window_moments, window.y, window.y + window.height);
  clock.lap(Stage::horizon);

  // 7. Scores: how much likelier a cell is terrain, averaged over frames that show the same (E).
  const bool from_memory = foreign || !settings.near_clear; // what is in front has not been looked at
  const std::span<const Cell> trusted = from_memory ? std::span<const Cell>{} : kept_.cells;
  // A teacher shows the ground in all lights; what stands in the window lies in none.
  const bool one_light = settings.light_ahead && !trusted.empty() && task.supervision.empty();
  const Columns ahead = one_light ? columns_ahead(window, grid_.width) : Columns{};
  weigh_cells(settings, trusted, ahead, terrain);
  const bool continued = settings.temporal != Temporal::off &&
                         shows_same_place(memory_.last, grid_, task.frame.pts, settings.temporal);
  remember(grid_, task.frame.pts, memory_.last);
  average_scores(score_, continued, memory_.average);
  clock.lap(Stage::scoring);

  // 8. The boundary of the ground, once more with what the frame itself looks like on both its sides.
  find_boundary(task, continued, terrain);
  if (settings.second_look &&
      reestimation_.revise(grid_, cells_, memory_.boundary, penalty_, memory_.average, revised_))
    search_.find(grid_, revised_, prior_, settings.ground_behind, memory_.boundary);
  for (std::uint16_t& row : memory_.boundary)
    row = std::max(row, static_cast<std::uint16_t>(std::clamp(horizon.row, 0, grid_.height)));

  // 9. Ground behind obstacles, doubtful ground before them, and how sure all of it is.
  behind_.any = false;
  if (settings.ground_behind)
    behind_search_.find(grid_, memory_.average, memory_.boundary, exposure_.gain, behind_);
  const std::uint8_t confidence = mask_confidence(grid_, memory_.average, memory_.boundary, behind_);
  walk_doubtful(grid_, memory_.average, settings.doubtful, memory_.boundary, safe_);

  // 10. The curves at the picture's own edges, in rows of the frame: what stands in the open below them (what
  // looks odd does not where it moves as the ground does), what is reachable, where the horizon lies.
  refine_curves(task, settings.mask_level, curves_);
  below_things_ = curves_.safe;
  if (!continued)
    memory_.stones.look_again();
  const bool stands = find_standing(task, estimate);
  find_spots(task, estimate.window, terrain.horizon);
  reachable_rows(below_things_, settings.mask_level, estimate.window, task.frame.height, out.boundary());
  if (settings.horizon == HorizonMode::paper) {
    estimate.horizon_row = horizon.row < 0 ? -1 : horizon.row << grid_.level;
    estimate.horizon_confidence = horizon.confidence;
  } else if (settings.horizon == HorizonMode::automatic) {
    const HorizonRow seen = horizon_of(curves_.boundary, grid_.level, settings.mask_level, task.frame.height,
                                       confidence, scratch_);
    const HorizonRow told = memory_.horizon.follow(seen, continued);
    estimate.horizon_row = told.row;
    estimate.horizon_confidence = told.confidence;
    if (told.held)
      estimate.flags |= flag_horizon_held;
  }
  estimate.confidence = from_memory ? confidence / 2 : confidence;
  clock.lap(Stage::boundary);

  // 11. The mask, and how sure it is of each cell.
  std::uint64_t traversable = free_space_.write(curves_, settings.mask_level, settings.ignore_regions,
                                                out.mask(), estimate.mask.height, task.workers);
  for (const SpotSearch& search : spot_searches_)
    if (search.found)
      traversable -=
          search.spots.mark(out.mask(), estimate.mask.width, estimate.mask.height, settings.mask_level);
  if (in_stones_)
    traversable -=
        stone_field_.mark(out.mask(), estimate.mask.width, estimate.mask.height, settings.mask_level);
  if (stands)
    traversable -= standing_.mark(out.mask(), estimate.mask.width, estimate.mask.height, settings.mask_level);
  out.tell_free_space(traversable, settings, grid_.level);
  tell_confidence(settings, stands, estimate, confidence_map);
  clock.lap(Stage::mask);
}

// The exposure follows the frame unless nothing is to be learned.
void FreeSpacePipeline::read_cells(const FrameTask& task, Terrain& terrain) {
  const Settings& settings = task.settings;
  const bool rgb = layout_of(task.frame.format).rgb;
  transform_ = color_transform_of(rgb, task.frame.colorimetry);
  grid_ = grid_reader_.read(pyramid_, task.grid_level, transform_, settings.ignore_regions);
  if (settings.texture)
    texture_reader_.read(pyramid_, grid_, transform_, rgb, texture_);
  else
    texture_.assign(grid_.size(), 0);
  if (settings.exposure && settings.learning)
    terrain.exposure_mean = follow_exposure(terrain.exposure_mean, mean_luma(grid_));
  const std::uint32_t mean = settings.exposure ? terrain.exposure_mean : 0;
  if (exposure_of_tables_ != mean)
    fill_exposure(mean, exposure_);
  exposure_of_tables_ = mean;
  bin_cells(grid_, texture_, exposure_, cells_);
  if (settings.connected_ground)
    connected_.look(grid_, cells_);
}

// Whether the window holds something that is not the terrain to its left and right. Nobody guards what is not
// learned or comes from a teacher.
bool FreeSpacePipeline::window_is_foreign(const FrameTask& task, const Rectangle& window,
                                          const Terrain& terrain) {
  if (!task.settings.learning || !task.settings.near_clear || !task.supervision.empty() ||
      heaviest(terrain.models) < 0)
    return false;
  return memory_.guard.refuses(cells_, likelihoods(task.settings, terrain), grid_.width, window);
}

// The mixture is evaluated at bin centres, but learned from unshifted colours: as accurate, and the models'
// colours are those of the ground.
void FreeSpacePipeline::learn_window(const Settings& settings, const Grid& colors, Terrain& terrain,
                                     StageClock& clock) {
  clusters_.reserve(window_cells_.size());
  training_ = cluster(
      colors, kept_.cells,
      {settings.training_models, {0, 0, 0}, {least_variance, least_variance, least_variance}, settings.seed},
      clusters_);
  clock.lap(Stage::clustering);
  learn(terrain.models, training_.span(), learning_rule(settings, window_cells_.size()));
  std::span<const std::uint8_t> same_ground;
  vouched_ = {};
  if (settings.connected_ground) {
    connected_.grow(grid_, kept_.cells);
    same_ground = connected_.taught();
    vouched_ = connected_.vouched(grid_, kept_.cells, texture_);
  }
  mark_lessons(grid_, window_cells_, kept_.cells, same_ground, settings.negatives, memory_.boundary,
               lessons_);
  learn_histograms(cells_, lessons_, settings.forget_shift, terrain);
  ++terrain.generation;
  taught_q8_ = static_cast<int>(256 * window_cells_.size() / grid_.size());
  tables_are_old_ = true;
  clock.lap(Stage::update);
}

// This frame's window is not learned: only what was learned before speaks.
void FreeSpacePipeline::rely_on_memory() {
  vouched_ = {};
  if (training_.count > 0)
    tables_are_old_ = true;
  training_.count = 0;
}

// Colour and texture speak for and against a cell; its distance from the `trusted` ground speaks against it.
void FreeSpacePipeline::weigh_cells(const Settings& settings, std::span<const Cell> trusted,
                                    const Columns& ahead, const Terrain& terrain) {
  if (settings.local_reference)
    local_reference_.climb(grid_, reference_color(trusted, terrain), exposure_.gain, penalty_);
  else
    penalty_.assign(grid_.size(), 0);
  measure_color_steps(grid_, exposure_.gain, settings.geodesic, steps_);
  if (settings.geodesic)
    geodesic_.raise(grid_, steps_, trusted, penalty_);
  score_cells(grid_, cells_, likelihoods(settings, terrain), penalty_, {vouched_, trusted}, ahead, score_);
}

// The slow horizon follows the boundary.
void FreeSpacePipeline::find_boundary(const FrameTask& task, bool continued, Terrain& terrain) {
  const Settings& settings = task.settings;
  before_.clear();
  if (continued)
    before_.swap(memory_.boundary);
  search_.look(grid_, steps_, exposure_.gain, before_);
  if (settings.connected_ground)
    search_.price_edgeless(grid_, connected_.edgeless(grid_));
  const FrameLine line = end_of_plane(task, continued, memory_.motion);
  const int line_q8 = line.part_of_height_q8(task.frame.height);
  // The first frame knows no horizon: it is searched twice, the second time with its own.
  for (int pass = terrain.horizon == 0 ? 0 : 1; pass < 2; ++pass) {
    row_prior(grid_.height, horizon_of_prior(terrain.horizon, line_q8), settings.row_prior, settings.caution,
              prior_);
    // A 32nd of the height above the plane's end there may be ground: it may rise a little.
    deny_rows_before(line.row_of_level(grid_.level, task.frame.height >> 5), prior_);
    search_.find(grid_, memory_.average, prior_, settings.ground_behind, memory_.boundary);
    terrain.horizon =
        follow_horizon(pass == 0 ? 0 : terrain.horizon, memory_.boundary, grid_.height, scratch_);
  }
}

// All curves brought to rows of the frame, one per column of a mask of that level.
void FreeSpacePipeline::refine_curves(const FrameTask& task, int mask_level, FreeSpaceCurves& curves) {
  const auto bring = [&](const GridCurve& curve, FrameCurve& rows) {
    refinement_.refine(pyramid_, grid_, transform_, curve, task.settings.refine, mask_level, task.frame.width,
                       task.frame.height, rows);
  };
  bring(memory_.boundary, curves.boundary);
  bring(safe_, curves.safe);
  for (std::size_t x = 0; x < curves.safe.size(); ++x)
    curves.safe[x] = std::max(curves.safe[x], curves.boundary[x]);
  curves.ground_behind = behind_.any;
  for (FrameCurve* rows : {&curves.behind_first, &curves.behind_end})
    rows->reserve(curves.safe.size()); // however late ground is first seen behind something
  if (!behind_.any)
    return;
  bring(behind_.first, curves.behind_first);
  bring(behind_.end, curves.behind_end);
  for (std::size_t x = 0; x < curves.safe.size(); ++x)
    curves.behind_end[x] =
        std::min(curves.behind_end[x], static_cast<std::uint16_t>(std::max(curves.boundary[x] - 1, 0)));
}

// This frame's curves with a column per 2^level of the frame: the mask's, where those are as fine.
const FreeSpaceCurves& FreeSpacePipeline::curves_at(const FrameTask& task, int level) {
  if (level == task.settings.mask_level)
    return curves_;
  refine_curves(task, level, fine_curves_);
  return fine_curves_;
}

// A mask that is smaller than the cells that are searched has too few columns for them.
void FreeSpacePipeline::find_spots(const FrameTask& task, const Rectangle& window,
                                   std::uint32_t slow_horizon) {
  const Settings& settings = task.settings;
  for (SpotSearch& search : spot_searches_)
    search.found = false;
  in_stones_ = false;
  if (!settings.odd_spots)
    return;
  const int level = std::max(grid_.level - 1, 0), finest = std::max(level - 1, 0),
            column_level = std::min(settings.mask_level, finest);
  const FreeSpaceCurves& curves = curves_at(task, column_level);
  const auto look = [&](SpotSearch& search, int cells, int rows) {
    search.found =
        search.spots.find(pyramid_, transform_, curves,
                          {cells, column_level, slow_horizon, window, settings.ignore_regions, rows});
    if (search.found && settings.motion != Motion::off)
      search.found = search.spots.drop_flat(standing_.evidence());
    if (search.found)
      search.spots.lower(settings.mask_level, below_things_);
  };
  look(spot_searches_[0], level, 0);
  if (finest < level)
    look(spot_searches_[1], finest, far_rows);
  in_stones_ = stone_field_.find(pyramid_, transform_, curves,
                                 {texture_level(grid_.level), layout_of(task.frame.format).rgb, column_level,
                                  finest, slow_horizon, window, settings.ignore_regions},
                                 memory_.stones);
  if (in_stones_)
    stone_field_.lower(settings.mask_level, below_things_);
}

// What moves as something that stands on the ground, and how the camera stands and moves over it.
bool FreeSpacePipeline::find_standing(const FrameTask& task, Estimate& estimate) {
  const Settings& settings = task.settings;
  bool any = false;
  if (settings.motion != Motion::off) {
    // As with spots: what motion sees must not depend on the mask's size.
    const int column_level =
        std::min(settings.mask_level, StandingThings::coarsest_columns(pyramid_, grid_.level));
    any =
        standing_.find(pyramid_, curves_at(task, column_level),
                       {grid_.level, column_level, task.frame.pts, settings.ignore_regions, known_line(task)},
                       memory_.motion);
    estimate.speed_over_height = memory_.motion.speed;
  }
  estimate.vanishing_row = end_of_plane(task, true, memory_.motion).row_q16(task.frame.height);
  if (any)
    standing_.lower(settings.mask_level, below_things_);
  return any;
}

// Only now: the label of a cell is what the mask has there.
void FreeSpacePipeline::tell_confidence(const Settings& settings, bool stands, const Estimate& estimate,
                                        const MutablePlane& map) {
  evidence_.start(grid_, memory_.average, memory_.boundary, behind_);
  for (const SpotSearch& search : spot_searches_)
    if (search.found)
      evidence_.subtract_oddness(search.spots.oddness());
  if (in_stones_)
    evidence_.subtract_oddness(stone_field_.oddness());
  if (stands)
    evidence_.subtract_standing(standing_.evidence());
  evidence_.tell(grid_, estimate.mask, settings.mask_level, estimate.confidence, map);
}

const LikelihoodTables& FreeSpacePipeline::likelihoods(const Settings& settings, const Terrain& terrain) {
  if (tables_are_old_)
    likelihood_.build(terrain, training_.span(), taught_q8_, settings, tables_);
  tables_are_old_ = false;
  return tables_;
}

// Where no ground is trusted the heaviest model stands in for it.
std::array<int, 3> FreeSpacePipeline::reference_color(std::span<const Cell> trusted,
                                                      const Terrain& terrain) const {
  if (!trusted.empty())
    return mean_color(grid_, trusted);
  const TerrainModel model =
      in_this_light(terrain.models[static_cast<std::size_t>(heaviest(terrain.models))]);
  return {model.mean[0] >> 4, model.mean[1] >> 4, model.mean[2] >> 4};
}

TerrainModel FreeSpacePipeline::in_this_light(const TerrainModel& learned) const {
  return terrainseg::in_this_light(learned, exposure_);
}

void FreeSpacePipeline::adapt(const Settings& settings, int /*grid_level*/) {
  forget_terrain();
  if (settings.horizon != HorizonMode::automatic)
    memory_.horizon = {};
}

void FreeSpacePipeline::forget_frames() {
  memory_ = {};
}

void FreeSpacePipeline::forget_terrain() {
  training_.count = 0;
  taught_q8_ = 0;
  tables_are_old_ = true;
}

} // namespace terrainseg
