// SPDX-License-Identifier: LGPL-2.1-or-later
// Selects the pipeline, checks frames, and owns the state that outlives a frame: settings, terrain, counters,
// estimate. The order of the stages is in paper/pipeline.cpp and freespace/pipeline.cpp.
#include "terrainseg/segmenter.hpp"

#include "coarse/window.hpp"
#include "freespace/pipeline.hpp"
#include "learning/terrain_model.hpp"
#include "paper/pipeline.hpp"

namespace terrainseg {
namespace {

std::unique_ptr<Pipeline> make_pipeline(PipelineKind kind) {
  if (kind == PipelineKind::paper)
    return std::make_unique<PaperPipeline>();
  return std::make_unique<FreeSpacePipeline>();
}

void count(const Settings& settings, std::uint32_t flags, Counters& counters) {
  ++(!settings.learning     ? counters.skipped_frozen
     : !settings.near_clear ? counters.skipped_near
     : flags & flag_starved ? counters.skipped_starved
                            : counters.learned);
}

} // namespace

struct Segmenter::State {
  explicit State(const Settings& initial) : settings(initial), pipeline(make_pipeline(initial.pipeline())) {
    resize_mixture(terrain.models, settings.learned_models);
  }
  Status admit(const Frame& frame, const MaskTarget& target) const;
  void adapt(const Frame& frame);
  void forget();

  Settings settings;
  std::unique_ptr<Pipeline> pipeline;
  Terrain terrain;
  Counters counters;
  std::array<std::int64_t, stage_count> times{};
  EstimateWriter out;

  // Values derived from the settings and the frame's size.
  bool stale = true; ///< the settings changed: adapt() must derive these values again
  int width = 0, height = 0, level = 0;
  Rectangle window;
  std::optional<ColorSpace> space; ///< of the last frame
  std::optional<Workers> workers;
  int threads = -1; ///< number of threads that `workers` was created with
};

const char* name_of(Stage stage) {
  constexpr const char* names[stage_count] = {"pyramid", "features", "prefilter", "clustering", "update",
                                              "horizon", "scoring",  "boundary",  "mask"};
  return names[static_cast<int>(stage)];
}

ColorSpace learning_space(const Settings& settings, const ColorSpace& frames) {
  if (settings.pipeline() == PipelineKind::free_space)
    return normalised_space;
  ColorSpace space = frames;
  if (space.rgb)
    space.colorimetry.matrix = ColorMatrix::bt601; // not used for RGB: a fixed value, so that equal spaces
                                                   // compare equal
  return space;
}

Status Segmenter::process(const Frame& frame, const Supervision& supervision, const MaskTarget& target,
                          const Veto& veto) {
  State& s = *state_;
  if (Status status = s.admit(frame, target); !status.ok())
    return status;
  s.adapt(frame);
  s.out.start(frame, target, s.settings, s.window, s.counters.frames++);
  StageClock clock(s.times);
  s.pipeline->process({frame, supervision, veto, s.settings, s.window, s.level, *s.workers}, s.terrain, s.out,
                      clock);
  Estimate& estimate = s.out.estimate();
  estimate.model_generation = s.terrain.generation;
  for (const TerrainModel& model : s.terrain.models)
    if (model.mass > 0)
      s.out.add_model(s.pipeline->in_this_light(model), s.terrain.space);
  count(s.settings, estimate.flags, s.counters);
  return {};
}

Status Segmenter::State::admit(const Frame& frame, const MaskTarget& target) const {
  if (std::string flaw = flaw_of(frame); !flaw.empty())
    return {Status::Code::bad_frame, std::move(flaw)};
  if (!place_window(settings, frame.width, frame.height))
    return {Status::Code::window_outside_frame, window_does_not_fit(settings, frame.width, frame.height)};
  if (std::string flaw = flaw_of(target, frame, settings.mask_level); !flaw.empty())
    return {Status::Code::bad_target, std::move(flaw)};
  return {};
}

/// Adapts to the frame's size and colour space. The terrain survives a change of size, but not of colour
/// space.
void Segmenter::State::adapt(const Frame& frame) {
  const ColorSpace now = learning_space(settings, {layout_of(frame.format).rgb, frame.colorimetry});
  if (terrain.space != now) {
    if (heaviest(terrain.models) >= 0)
      forget();
    terrain.space = now;
  }
  space = now;
  const bool resized = frame.width != width || frame.height != height;
  if (!stale && !resized)
    return;
  stale = false;
  const int new_level = grid_level(settings.pyramid_levels, frame.width, frame.height);
  if (resized || new_level != level)
    pipeline->forget_frames();
  width = frame.width;
  height = frame.height;
  level = new_level;
  window = *place_window(settings, width, height);
  pipeline->adapt(settings, level);
  resize_mixture(terrain.models, settings.learned_models);
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
  pipeline->forget_frames();
  pipeline->forget_terrain();
}

Segmenter::Segmenter(const Settings& settings) : state_(std::make_unique<State>(settings)) {}
Segmenter::~Segmenter() = default;
Segmenter::Segmenter(Segmenter&&) noexcept = default;
Segmenter& Segmenter::operator=(Segmenter&&) noexcept = default;

void Segmenter::configure(const Settings& settings) {
  State& s = *state_;
  if (settings == s.settings)
    return;
  // The two pipelines learn in different colour spaces.
  if (settings.pipeline() != s.settings.pipeline()) {
    if (heaviest(s.terrain.models) >= 0)
      s.forget();
    s.space.reset(); // unknown until the next frame
    s.pipeline = make_pipeline(settings.pipeline());
  }
  s.settings = settings;
  s.stale = true;
}

const Settings& Segmenter::settings() const {
  return state_->settings;
}

const Estimate& Segmenter::estimate() const {
  return state_->out.estimate();
}

void Segmenter::reset() {
  state_->forget();
}

void Segmenter::reset_temporal() {
  state_->pipeline->forget_frames();
}

Terrain Segmenter::terrain() const {
  return state_->terrain;
}

Status Segmenter::adopt(const Terrain& terrain) {
  State& s = *state_;
  if (s.space && *s.space != terrain.space)
    return {Status::Code::foreign_terrain,
            "the terrain was learned in another colour space than that of the frames: learn it again"};
  // Only the default pipeline fills negative_colors.
  const PipelineKind teacher =
      terrain.negative_colors.empty() ? PipelineKind::paper : PipelineKind::free_space;
  if (heaviest(terrain.models) >= 0 && teacher != s.settings.pipeline())
    return {Status::Code::foreign_terrain,
            "the terrain was learned with free-space = " +
                std::string(teacher == PipelineKind::free_space ? "true" : "false") +
                ": set free-space to the same value, or learn the terrain again"};
  if (!flaw_of(terrain).empty())
    return {Status::Code::foreign_terrain,
            "the terrain does not have the structure that this version uses: learn it again"};
  s.terrain = terrain;
  resize_mixture(s.terrain.models, s.settings.learned_models);
  s.pipeline->forget_terrain();
  return {};
}

const Counters& Segmenter::counters() const {
  return state_->counters;
}

const std::array<std::int64_t, stage_count>& Segmenter::stage_times() const {
  return state_->times;
}

} // namespace terrainseg
