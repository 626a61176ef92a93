// SPDX-License-Identifier: LGPL-2.1-or-later
#include "freespace/learn/window_teacher.hpp"

#include <algorithm>
#include <array>
#include <cstdlib>

#include "base/tuning.hpp"
#include "freespace/look/connected_ground.hpp"
#include "freespace/look/view.hpp"
#include "learning/terrain_model.hpp"

namespace terrainseg {
namespace {

/// Thresholds of the mean score beside the window minus that inside, and of the mean score inside, 32 = 1
/// nat. While an obstacle is in the window lower thresholds apply, because a car's smooth flanks look like
/// the road in one frame and unlike it in the next. (A drive at dusk among queueing cars has 25 % unsafe
/// pixels with the second pair and 31 % without it; the result is nearly constant around both values.)
struct Limits {
  int gap, inside;
};
constexpr Limits to_enter{20, 16}, to_stay{8, 24};
/// The same for a third of the window's columns.
constexpr int parts = 3;
constexpr Limits of_a_third{48, 0};
TERRAINSEG_TUNED(int, window_guard, score_limit, 48);
TERRAINSEG_TUNED(int, window_guard, patience, 64); ///< frames

} // namespace

bool WindowGuard::refuses(const CellBins& cells, const LikelihoodTables& tables, int grid_width,
                          const Rectangle& window) {
  // A thing may fill a third of the window only: each third is compared too.
  struct Scores {
    std::int64_t sum = 0, cells = 0;
    void add(std::int64_t score, std::int64_t count = 1) {
      sum += score;
      cells += count;
    }
  };
  std::array<Scores, parts> thirds;
  Scores beside;
  for (int i = window.y; i < window.y + window.height; ++i)
    for (int j = 0; j < grid_width; ++j) {
      const int cell = i * grid_width + j;
      const bool in_window = j >= window.x && j < window.x + window.width;
      (in_window ? thirds[(j - window.x) * parts / window.width] : beside)
          .add(std::clamp(tables.color[cells.color[cell]] + tables.texture[cells.texture[cell]], -score_limit,
                          score_limit));
    }
  const auto differs = [&beside](const Scores& inside, const Limits& limits) {
    return inside.cells > 0 && beside.cells > 0 && inside.sum < limits.inside * inside.cells &&
           beside.sum * inside.cells - inside.sum * beside.cells > limits.gap * inside.cells * beside.cells;
  };
  Scores whole;
  for (const Scores& third : thirds)
    whole.add(third.sum, third.cells);
  const bool foreign = differs(whole, held_ > 0 ? to_stay : to_enter) ||
                       std::any_of(thirds.begin(), thirds.end(),
                                   [&](const Scores& third) { return differs(third, of_a_third); });
  if (!foreign || held_ >= patience) {
    // After the limit is reached the count decreases slowly, so that the decision does not alternate.
    held_ = std::max(held_ - 4, 0);
    return false;
  }
  ++held_;
  return true;
}

namespace {

/// Grey levels between a cell and its neighbours to the right and below from which it has contrast. Such a
/// cell has changed when it differs from the earlier frame by a quarter of its contrast.
TERRAINSEG_TUNED(int, still_window, least_contrast, 6);
/// Inverse of the largest share of the window's cells with contrast that have changed while it is still.
TERRAINSEG_TUNED(int, still_window, most_changed, 8);
/// Changes of the picture above the window until the window is still, and the largest count.
TERRAINSEG_TUNED(int, still_window, enough, 8);
TERRAINSEG_TUNED(int, still_window, most, 16);

/// Cells with contrast, and those of them that have changed.
struct Changes {
  int all = 0, changed = 0;
  /// Adds `count` cells of a row. Auto-vectorised, in 16 bits.
  void add(const Grid& grid, const std::uint8_t* all_before, int row, int column, int count) {
    using Short = std::int16_t;
    const auto difference = [](std::uint8_t a, std::uint8_t b) {
      return static_cast<Short>(std::max(a, b) - std::min(a, b));
    };
    const std::uint8_t* const here = grid.planes[0].row(row) + column;
    const std::uint8_t* const below = here + grid.planes[0].stride;
    const std::uint8_t* const ignored = &grid.ignored[grid.at(row, column)];
    const std::uint8_t* const before = all_before + grid.at(row, column);
    Short counted = 0, others = 0;
    for (int j = 0; j < count; ++j) {
      const auto contrast =
          static_cast<Short>(difference(here[j], here[j + 1]) + difference(here[j], below[j]));
      const Short counts = (contrast >= static_cast<Short>(least_contrast)) & (ignored[j] == 0);
      counted = static_cast<Short>(counted + counts);
      const Short change = 4 * difference(here[j], before[j]) >= contrast;
      others = static_cast<Short>(others + (counts & change));
    }
    all += counted;
    changed += others;
  }
};

} // namespace

bool StillWindow::look(const Grid& grid, const Rectangle& window) {
  const auto keep = [&] {
    before_.resize(grid.size());
    for (int i = 0; i < grid.height; ++i)
      std::copy_n(grid.planes[0].row(i), grid.width, &before_[grid.at(i, 0)]);
  };
  if (before_.size() != grid.size()) {
    changes_ = 0;
    keep();
    return false;
  }
  Changes above;
  for (int i = 0; i < std::min(window.y, grid.height - 1); ++i)
    above.add(grid, before_.data(), i, 0, grid.width - 1);
  if (above.all == 0 || 5 * above.changed < 3 * above.all)
    return changes_ >= enough; // the picture has not changed enough to compare the window
  Changes inside;
  int columns = 0; // with contrast
  const int bottom = std::min(window.y + window.height, grid.height - 1),
            right = std::min(window.x + window.width, grid.width - 1);
  for (int j = window.x; j < right; ++j) {
    const int counted = inside.all;
    for (int i = window.y; i < bottom; ++i)
      inside.add(grid, before_.data(), i, j, 1);
    columns += inside.all > counted;
  }
  const bool still = 2 * columns >= window.width && most_changed * inside.changed <= inside.all;
  changes_ = still ? std::min(changes_ + 1, most) : std::max(changes_ - 4, 0);
  keep();
  return changes_ >= enough;
}

namespace {

/// Mean roughness of the window (Q8 of an octave) up to which it is smooth, and from which it teaches
/// nothing.
TERRAINSEG_TUNED(int, window_clarity, smooth, 5 << 8);
TERRAINSEG_TUNED(int, window_clarity, rough, 9 << 8);
TERRAINSEG_TUNED(int, window_clarity, half_at_difference,
                 30); ///< mean difference of the window's lumas from their mean that halves the confidence
/// Q8: the clarity of a usual window, which leaves the confidence as it is.
TERRAINSEG_TUNED(int, window_clarity, usual, 179);

} // namespace

int clarity_of_window(const Grid& grid, const CellBins& cells, std::span<const Cell> window) {
  if (window.empty())
    return 256;
  const auto count = static_cast<std::int64_t>(window.size());
  std::int64_t roughness = 0, luma = 0, difference = 0;
  for (const Cell& cell : window) {
    roughness += cells.roughness[grid.at(cell.y, cell.x)];
    luma += cells.luma[grid.at(cell.y, cell.x)];
  }
  for (const Cell& cell : window)
    difference += std::abs(cells.luma[grid.at(cell.y, cell.x)] - luma / count);
  const std::int64_t calm =
      std::clamp<std::int64_t>(256 * (rough - roughness / count) / (rough - smooth), 0, 256);
  return static_cast<int>(256 * calm * half_at_difference * count /
                          (usual * (half_at_difference * count + difference)));
}

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
  const int width = view.grid.width;
  const auto colors = std::span(view.cells.color).subspan(window.y * width, window.height * width);
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
  if (settings.near_clear)
    memory.clarity = follow_slowly(
        memory.clarity,
        static_cast<std::uint32_t>(clarity_of_window(view.grid, view.cells, view.window_cells)) << 8);
  lesson.clarity = memory.clarity == 0 ? 256 : static_cast<int>(memory.clarity >> 8);
  const Grid colors = view.colors();
  const Gaussian moments = moments_of(colors, view.window_cells);
  prefilter(colors, view.window_cells, moments,
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
