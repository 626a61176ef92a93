// SPDX-License-Identifier: LGPL-2.1-or-later
#include "segmenter_state.hpp"

#include <algorithm>
#include <cstdlib>
#include <cstring>

#include "color.hpp"
#include "frame_check.hpp"
#include "terrain_model.hpp"

namespace terrainseg {
namespace {

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

Segmenter::State::State(const Settings& initial) : settings(initial) {
  resize_mixture(terrain.models, settings.learned_models);
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
  if (threads != settings.n_threads) {
    threads = settings.n_threads;
    workers.emplace(threads);
  }
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
  if (settings.free_space != state_->settings.free_space) {
    if (heaviest(state_->terrain.models) >= 0)
      state_->forget();
    state_->space.reset(); // unknown again until the next frame
  }
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
  if (!well_formed(terrain))
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
