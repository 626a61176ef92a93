// SPDX-License-Identifier: LGPL-2.1-or-later
#include "freespace/score/cell_scorer.hpp"

#include "freespace/look/view.hpp"
#include "freespace/score/temporal.hpp"
#include "learning/terrain_model.hpp"

namespace terrainseg {
namespace {

/// The mean colour of the trusted cells, or of the learned model with the largest mass when there are none.
std::array<int, 3> reference_color(const View& view, std::span<const Cell> trusted, const Terrain& terrain) {
  if (!trusted.empty())
    return mean_color(view.grid, trusted);
  const TerrainModel model =
      in_this_light(terrain.models[static_cast<std::size_t>(heaviest(terrain.models))], view.exposure);
  return {model.mean[0] >> 4, model.mean[1] >> 4, model.mean[2] >> 4};
}

/// The columns in which ground may be in another light. None when training pixels are supplied, because these
/// show the ground in all lights, and none when the window is not trusted.
Columns in_one_light(const View& view, std::span<const Cell> trusted) {
  const bool one_light = view.task.settings.light_ahead && !trusted.empty() && view.task.supervision.empty();
  return one_light ? columns_ahead(view.window_of_grid(), view.grid.width) : Columns{};
}

} // namespace

Scores CellScorer::score(const View& view, const Vouched& trusted, bool continued, CellScores& average,
                         TerrainTables& tables, const Terrain& terrain) {
  const Settings& settings = view.task.settings;
  if (settings.local_reference)
    local_reference_.climb(view.grid, reference_color(view, trusted.seeds, terrain), view.exposure.gain,
                           penalty_);
  else
    penalty_.assign(view.grid.size(), 0);
  measure_color_steps(view.grid, view.exposure.gain, settings.geodesic, steps_);
  if (settings.geodesic)
    geodesic_.raise(view.grid, steps_, trusted.seeds, penalty_);
  score_cells(view.grid, view.cells, tables.of(terrain, settings, view.cells.color), penalty_, trusted,
              in_one_light(view, trusted.seeds), score_);
  if (settings.upright) {
    coherence_.look(view.pyramid, view.grid, view.transform, layout_of(view.task.frame.format).rgb);
    coherence_.weigh(view.grid, score_);
  }
  average_scores(score_, continued, average);
  return {average, penalty_, steps_};
}

} // namespace terrainseg
