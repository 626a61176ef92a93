// SPDX-License-Identifier: LGPL-2.1-or-later
#include "default_path.hpp"

#include <algorithm>

#include "confidence.hpp"
#include "doubtful.hpp"
#include "row_prior.hpp"
#include "terrain_model.hpp"

namespace terrainseg {
namespace {

constexpr int score_limit = 48;      ///< 1.5 nats: no cell outweighs two neighbours
constexpr int horizon_percent = 5;   ///< of the columns lie higher: outliers
constexpr int least_confidence = 48; ///< of the mask, for the horizon to mean anything

} // namespace

void DefaultPath::look(const Frame& frame, const Pyramid& pyramid, int level, const Settings& settings,
                       bool frozen, Terrain& terrain) {
  const bool rgb = layout_of(frame.format).rgb;
  transform_ = color_transform_of(rgb, frame.colorimetry);
  read_grid(pyramid, level, transform_, settings.ignore_regions, grid_);
  if (settings.texture)
    texture_reader_.read(pyramid, grid_, transform_, rgb, texture_);
  else
    texture_.assign(grid_.size(), 0);
  if (settings.exposure && !frozen)
    terrain.exposure_mean = follow_exposure(terrain.exposure_mean, mean_luma(grid_));
  const std::uint32_t mean = settings.exposure ? terrain.exposure_mean : 0;
  if (exposure_of_tables_ != mean)
    fill_exposure(mean, exposure_);
  exposure_of_tables_ = mean;
  index_cells(grid_, texture_, exposure_, cells_);
}

Grid DefaultPath::colors() const {
  return {{Plane{cells_.luma.data(), grid_.width}, Plane{cells_.u.data(), grid_.width},
           Plane{cells_.v.data(), grid_.width}},
          grid_.width,
          grid_.height,
          grid_.level};
}

bool DefaultPath::window_is_foreign(const Rectangle& window, const Settings& settings,
                                    const Terrain& terrain) {
  if (heaviest(terrain.models) < 0)
    return false;
  refresh_tables(settings, terrain);
  return guard_.refuses(cells_, tables_, grid_.width, window);
}

void DefaultPath::learn(const std::vector<Cell>& window, const std::vector<Cell>& kept,
                        const TrainingModels& training, const Settings& settings, Terrain& terrain) {
  training_ = training;
  taught_q8_ = static_cast<int>(256 * window.size() / grid_.size());
  lessons_.assign(grid_.size(), Lesson::against);
  if (settings.negatives == Negatives::split && boundary_.size() == static_cast<std::size_t>(grid_.width))
    for (int j = 0; j < grid_.width; ++j)
      for (int i = boundary_[static_cast<std::size_t>(j)]; i < grid_.height; ++i)
        lessons_[grid_.at(i, j)] = Lesson::against_little;
  for (std::size_t i = 0; i < grid_.size(); ++i)
    if (grid_.ignored[i])
      lessons_[i] = Lesson::nothing;
  for (const Cell& cell : window)
    lessons_[grid_.at(cell.y, cell.x)] = Lesson::nothing;
  for (const Cell& cell : kept)
    lessons_[grid_.at(cell.y, cell.x)] = Lesson::terrain;
  learn_histograms(cells_, lessons_, settings.forget_shift, terrain);
  tables_are_old_ = true;
}

void DefaultPath::rely_on_memory() {
  if (training_.count > 0)
    tables_are_old_ = true;
  training_.count = 0;
}

void DefaultPath::refresh_tables(const Settings& settings, const Terrain& terrain) {
  if (tables_are_old_)
    evidence_.build(terrain, training_.span(), taught_q8_, settings, tables_);
  tables_are_old_ = false;
}

void DefaultPath::score(const std::vector<Cell>& trusted, std::int64_t pts, const Settings& settings,
                        const Terrain& terrain) {
  refresh_tables(settings, terrain);
  if (settings.local_reference)
    local_reference_.climb(grid_, reference_color(trusted, terrain), exposure_.gain, penalty_);
  else
    penalty_.assign(grid_.size(), 0);
  measure_color_steps(grid_, exposure_.gain, settings.geodesic, steps_);
  if (settings.geodesic)
    geodesic_.raise(grid_, steps_, trusted, penalty_);
  score_.resize(grid_.size());
  for (std::size_t i = 0; i < grid_.size(); ++i) {
    const int evidence = tables_.color[cells_.color[i]] + tables_.texture[cells_.texture[i]] - penalty_[i];
    score_[i] = static_cast<std::int16_t>(
        grid_.ignored[i] ? 0 : 16 * std::clamp(evidence, -score_limit, score_limit));
  }
  continued_ = averaging_.continues(grid_, pts, settings.temporal);
  averaging_.add(score_, continued_, average_);
}

std::array<int, 3> DefaultPath::reference_color(const std::vector<Cell>& trusted,
                                                const Terrain& terrain) const {
  std::array<int, 3> color{};
  if (trusted.empty()) {
    const int model = heaviest(terrain.models);
    if (model >= 0) {
      const auto mean = in_this_light(terrain.models[static_cast<std::size_t>(model)]).mean;
      for (int c = 0; c < 3; ++c)
        color[c] = mean[c] >> 4;
    }
    return color;
  }
  std::array<std::int64_t, 3> sum{};
  for (const Cell& cell : trusted) {
    const std::size_t at = grid_.at(cell.y, cell.x);
    sum[0] += grid_.y[at];
    sum[1] += grid_.u[at];
    sum[2] += grid_.v[at];
  }
  for (int c = 0; c < 3; ++c)
    color[c] = static_cast<int>(16 * sum[c] / static_cast<std::int64_t>(trusted.size()));
  return color;
}

void DefaultPath::find_boundary(const Settings& settings, int horizon_limit, Terrain& terrain) {
  before_.clear();
  if (continued_)
    before_.swap(boundary_);
  search_.look(grid_, steps_, exposure_.gain, before_);
  // The first frame knows no horizon: it is searched twice, the second time with its own.
  for (int pass = terrain.horizon == 0 ? 0 : 1; pass < 2; ++pass) {
    row_prior(grid_.height, terrain.horizon, settings.row_prior, settings.caution, prior_);
    search_.find(grid_, average_, prior_, settings.ground_behind, boundary_);
    terrain.horizon = follow_horizon(pass == 0 ? 0 : terrain.horizon, boundary_, grid_.height, scratch_);
  }
  if (settings.second_look && second_look_.revise(grid_, cells_, boundary_, penalty_, average_, revised_))
    search_.find(grid_, revised_, prior_, settings.ground_behind, boundary_);
  for (std::uint16_t& row : boundary_)
    row = std::max(row, static_cast<std::uint16_t>(std::clamp(horizon_limit, 0, grid_.height)));
  if (settings.ground_behind)
    behind_search_.find(grid_, average_, boundary_, exposure_.gain, behind_);
  else
    behind_.any = false;
  confidence_ = mask_confidence(grid_, average_, boundary_, behind_);
  walk_doubtful(grid_, average_, settings.doubtful, boundary_, safe_);
}

const FreeSpaceCurves& DefaultPath::refine(const Pyramid& pyramid, const Frame& frame,
                                           const Settings& settings) {
  const auto bring = [&](const std::vector<std::uint16_t>& curve, std::vector<std::uint16_t>& rows) {
    refinement_.refine(pyramid, grid_, transform_, curve, settings.refine, settings.mask_level, frame.width,
                       frame.height, rows);
  };
  bring(boundary_, curves_.boundary);
  bring(safe_, curves_.safe);
  for (std::size_t x = 0; x < curves_.safe.size(); ++x)
    curves_.safe[x] = std::max(curves_.safe[x], curves_.boundary[x]);
  curves_.ground_behind = behind_.any;
  if (behind_.any) {
    bring(behind_.first, curves_.behind_first);
    bring(behind_.end, curves_.behind_end);
    for (std::size_t x = 0; x < curves_.safe.size(); ++x)
      curves_.behind_end[x] =
          std::min(curves_.behind_end[x], static_cast<std::uint16_t>(std::max(curves_.boundary[x] - 1, 0)));
  }
  return curves_;
}

DefaultPath::HorizonRow DefaultPath::horizon(int frame_height, int mask_level) {
  // The curve bends at the refinement's columns only: those are enough.
  const int step = std::max(1 << refinement_level(grid_.level) >> mask_level, 1);
  scratch_.clear();
  for (std::size_t x = 0; x < curves_.boundary.size(); x += static_cast<std::size_t>(step))
    scratch_.push_back(curves_.boundary[x]);
  const int row = percentile(scratch_, horizon_percent),
            spread = percentile(scratch_, 10) - percentile(scratch_, 2);
  if (row <= 0 || row >= frame_height || confidence_ < least_confidence)
    return {};
  return {row, horizon_confidence(confidence_, spread, frame_height)};
}

TerrainModel DefaultPath::in_this_light(const TerrainModel& learned) const {
  TerrainModel model = learned;
  const int luma = std::min(learned.mean[0] * 256 / exposure_.gain, 255 << 8); // Q8
  const int chroma_gain = std::max<int>(exposure_.chroma_gain[static_cast<std::size_t>(luma >> 8)], 1);
  for (int c = 0; c < 3; ++c) {
    const int gain = c == 0 ? exposure_.gain : chroma_gain;
    if (c > 0)
      model.mean[c] = static_cast<std::uint16_t>(
          std::clamp((128 << 8) + (learned.mean[c] - (128 << 8)) * 256 / gain, 0, 255 << 8));
    model.variance[c] = static_cast<std::uint32_t>(std::max<std::uint64_t>(
        std::uint64_t{learned.variance[c]} * 65536 / static_cast<std::uint64_t>(gain * gain), 1));
  }
  model.mean[0] = static_cast<std::uint16_t>(luma);
  return model;
}

void DefaultPath::forget_frames() {
  averaging_.forget();
  guard_.forget();
  boundary_.clear();
}

void DefaultPath::forget_terrain() {
  training_.count = 0;
  taught_q8_ = 0;
  tables_are_old_ = true;
}

} // namespace terrainseg
