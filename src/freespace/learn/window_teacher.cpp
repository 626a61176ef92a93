// SPDX-License-Identifier: LGPL-2.1-or-later
#include "freespace/learn/window_teacher.hpp"

#include <algorithm>

#include "base/tuning.hpp"
#include "freespace/learn/own_shadow.hpp"
#include "freespace/look/connected_ground.hpp"
#include "freespace/look/view.hpp"
#include "learning/terrain_model.hpp"

namespace terrainseg {
namespace {

/// Floor of the variance (Q8): uniform ground of one colour still has noise.
TERRAINSEG_TUNED(std::uint32_t, window_teacher, prefilter_floor, 41 << 8);
/// Smallest variance of a training model, per component (Q8).
TERRAINSEG_TUNED(std::uint32_t, window_teacher, least_variance, 180 << 8);

/// Whether the window contains something other than the terrain to its left and right. Not checked when the
/// window is not learned or training pixels are supplied.
bool is_foreign(const View& view, WindowGuard& guard, TerrainTables& tables, const Terrain& terrain) {
  const Settings& settings = view.task.settings;
  if (!settings.window_guard || !settings.learning || !settings.near_clear ||
      !view.task.supervision.empty() || heaviest(terrain.models) < 0)
    return false;
  const Rectangle window = view.window_of_grid();
  const auto width = static_cast<std::size_t>(view.grid.width);
  const auto colors = std::span(view.cells.color)
                          .subspan(static_cast<std::size_t>(window.y) * width,
                                   static_cast<std::size_t>(window.height) * width);
  return guard.refuses(view.cells, tables.of(terrain, settings, colors), view.grid.width, window);
}

} // namespace

WindowLesson WindowTeacher::learn(const View& view, const GridCurve& last, WindowMemory& memory,
                                  TerrainTables& tables, Terrain& terrain, StageClock& clock) {
  const Settings& settings = view.task.settings;
  WindowLesson lesson;
  lesson.flags = learning_flag(settings, true);
  if (view.blank)
    return lesson;
  const Grid colors = view.colors();
  const std::span<const Cell> taught = lit_window(view);
  const Gaussian moments = moments_of(colors, taught);
  prefilter(colors, taught, moments,
            {settings.window_sigma_q8, prefilter_floor, PrefilterRule::Scarce::all_below_one_quarter}, kept_);
  const bool foreign = is_foreign(view, memory.guard, tables, terrain);
  lesson.flags = learning_flag(settings, kept_.cells.empty() || foreign || colors.size() < samples_per_model);
  if (settings.window_guard && view.task.supervision.empty() &&
      memory.still.look(view.grid, view.window_of_grid()))
    lesson.flags |= flag_window_still;
  clock.lap(Stage::prefilter);

  if (lesson.flags & flag_learned)
    lesson.trusted.cells = teach(view, last, tables, terrain, clock);
  else
    tables.rely_on_memory();
  lesson.known = heaviest(terrain.models) >= 0;
  lesson.from_memory = foreign || !settings.near_clear;
  if (!lesson.from_memory)
    lesson.trusted.seeds = kept_.cells;
  if (lesson.known && settings.horizon == HorizonMode::paper) {
    const Rectangle window = view.window_of_grid();
    lesson.horizon = find_horizon(colors, moments, window.y, window.y + window.height);
  }
  clock.lap(Stage::horizon);
  return lesson;
}

// The window's cells outside the rover's own shadow.
std::span<const Cell> WindowTeacher::lit_window(const View& view) {
  const bool shaded = view.task.settings.own_shadow && view.task.supervision.empty() &&
                      leave_own_shadow(view.colors(), view.window_of_grid(), view.window_cells, lit_cells_);
  return shaded ? lit_cells_ : view.window_cells;
}

// Models are learned from unquantised colours and evaluated at bin centres. This is as accurate, and the
// models have the colours of the ground. Returns the cells for which the window vouches.
std::span<const std::uint8_t> WindowTeacher::teach(const View& view, const GridCurve& last,
                                                   TerrainTables& tables, Terrain& terrain,
                                                   StageClock& clock) {
  const Settings& settings = view.task.settings;
  clusters_.reserve(view.window_cells.size());
  const TrainingModels training = cluster(
      view.colors(), kept_.cells,
      {settings.training_models, {0, 0, 0}, {least_variance, least_variance, least_variance}, settings.seed},
      clusters_);
  clock.lap(Stage::clustering);
  terrainseg::learn(terrain.models, training.span(), learning_rule(settings, view.window_cells.size()));
  std::span<const std::uint8_t> same_ground, vouched;
  if (settings.connected_ground) {
    view.connected.grow(view.grid, kept_.cells);
    same_ground = view.connected.taught();
    vouched = view.connected.vouched(view.grid, kept_.cells, view.texture);
  }
  mark_lessons(view.grid, view.window_cells, kept_.cells, same_ground, settings.negatives, last, lessons_);
  for (std::size_t i = 0; i < view.vetoed.size(); ++i)
    if (view.vetoed[i])
      lessons_[i] = Lesson::nothing;
  learn_histograms(view.cells, lessons_, settings.forget_shift, terrain);
  ++terrain.generation;
  tables.learned(training, static_cast<int>(256 * view.window_cells.size() / view.grid.size()));
  clock.lap(Stage::update);
  return vouched;
}

} // namespace terrainseg
