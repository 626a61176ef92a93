// SPDX-License-Identifier: LGPL-2.1-or-later
#include "freespace/curve/ground_tracer.hpp"

#include <algorithm>

#include "freespace/curve/boundary.hpp"
#include "freespace/curve/refinement.hpp"
#include "freespace/look/connected_ground.hpp"
#include "freespace/look/view.hpp"

namespace terrainseg {
namespace {

/// The first row that may be ground. Ground may extend 1/32 of the height above the plane's end, because it
/// may rise.
int first_row_before(const FrameLine& end, const View& view) {
  return end.row_of_level(view.grid.level, view.task.frame.height >> 5);
}

/// Removes ground behind obstacles above that row.
void cut_above(int row, GroundBehind& behind) {
  for (std::size_t x = 0; x < behind.first.size(); ++x) {
    behind.first[x] = std::max(behind.first[x], static_cast<std::uint16_t>(row));
    if (behind.first[x] >= behind.end[x])
      behind.first[x] = behind.end[x] = 0;
  }
}

} // namespace

const Ground& GroundTracer::trace(const View& view, const Scores& scores, int first_row, const FrameLine& end,
                                  bool continued, GridCurve& last, std::uint32_t& slow_horizon) {
  const Settings& settings = view.task.settings;
  const Grid& grid = view.grid;
  if (!continued)
    last.clear();
  search_.look(grid, scores.steps, view.exposure.gain, last);
  if (settings.connected_ground)
    search_.price_edgeless(grid, view.connected.edgeless(grid));
  search(view, scores, end, slow_horizon);
  GridCurve& boundary = ground_.boundary;
  if (settings.second_look &&
      reestimation_.revise(grid, view.cells, boundary, scores.penalty, scores.average, revised_))
    search_.find(grid, revised_, prior_, settings.ground_behind, boundary);
  const int top = std::clamp(std::max(first_row, first_row_before(end, view)), 0, grid.height);
  for (std::uint16_t& row : boundary)
    row = std::max(row, static_cast<std::uint16_t>(top));
  ground_.behind.any = false;
  if (settings.ground_behind)
    behind_search_.find(grid, scores.average, boundary, view.exposure.gain, ground_.behind);
  if (ground_.behind.any)
    cut_above(top, ground_.behind);
  walk_doubtful(grid, scores.average, settings.doubtful, boundary, ground_.safe);
  last = boundary;
  return ground_;
}

// In the first frame the horizon is unknown: search twice, the second time with the horizon found by the
// first.
void GroundTracer::search(const View& view, const Scores& scores, const FrameLine& end,
                          std::uint32_t& slow_horizon) {
  const Settings& settings = view.task.settings;
  const int height = view.task.frame.height;
  for (int pass = slow_horizon == 0 ? 0 : 1; pass < 2; ++pass) {
    row_prior(view.grid.height, horizon_of_prior(slow_horizon, end.part_of_height_q8(height)),
              settings.row_prior, settings.caution, prior_);
    deny_rows_before(first_row_before(end, view), prior_);
    search_.find(view.grid, scores.average, prior_, settings.ground_behind, ground_.boundary);
    slow_horizon = follow_horizon(pass == 0 ? 0 : slow_horizon, ground_.boundary, view.grid.height, scratch_);
  }
}

} // namespace terrainseg
