// SPDX-License-Identifier: LGPL-2.1-or-later
#include "freespace/curve/boundary.hpp"

#include <algorithm>
#include <array>
#include <cstdlib>

#include "base/fixed.hpp"
#include "base/tuning.hpp"
#include "freespace/curve/refinement.hpp"
#include "freespace/look/connected_ground.hpp"
#include "freespace/look/view.hpp"
#include "kernels/cells.hpp"

namespace terrainseg {
namespace {

TERRAINSEG_TUNED(int, row_prior, strongest,
                 32); ///< 1 nat at the top and bottom of the picture; 24 and 40 give 0.1 points more error
TERRAINSEG_TUNED(int, row_prior, middle,
                 51); ///< offset of the neutral row below the horizon: Q8 of the height
TERRAINSEG_TUNED(int, row_prior, middle_per_row, 214); ///< slope of the neutral row over the horizon, Q8
TERRAINSEG_TUNED(int, row_prior, first_middle, 128);
/// Largest distance of the prior's horizon below the vanishing row, Q8 of the height. With 24 the error falls
/// from 5.43 to 5.16 % on 16 rendered trails, and from 17.3 to 13.3 % on six in low sun. With 16 these are
/// 5.10 and 13.0 %, but 11.1 % of 15 Hz are unsafe instead of 10.7 %. With 32 they are 5.26 and 14.0 %.
TERRAINSEG_TUNED(int, row_prior, most_below, 24);
TERRAINSEG_TUNED(int, row_prior, upper_end, 14); ///< percent of the columns

} // namespace

void row_prior(int grid_height, std::uint32_t slow_horizon, bool enabled, int caution, RowPriors& prior) {
  const int neutral =
      slow_horizon == 0 ? first_middle : middle + ((middle_per_row * static_cast<int>(slow_horizon)) >> 8);
  prior.resize(grid_height);
  for (int i = 0; i < grid_height; ++i) {
    const int slope = std::clamp(2 * ((2 * i + 1) * 128 / grid_height - neutral), -128, 128);
    prior[i] = static_cast<std::int16_t>((enabled ? (2 * strongest * slope) >> 8 : 0) - caution);
  }
}

std::uint32_t horizon_of_prior(std::uint32_t slow_horizon, int vanishing_row) {
  return vanishing_row < 0 ? slow_horizon
                           : std::min(slow_horizon, static_cast<std::uint32_t>(vanishing_row + most_below));
}

void deny_rows_before(int first, RowPriors& prior) {
  // 8 nats per cell. With 2 nats a ridge of the ground's colour stays ground where there is no edge between
  // them.
  constexpr int denied = 256;
  for (int i = 0; i < std::min(first, static_cast<int>(prior.size())); ++i)
    prior[i] = static_cast<std::int16_t>(prior[i] - denied);
}

std::uint32_t follow_horizon(std::uint32_t slow_horizon, const GridCurve& boundary, int grid_height,
                             std::vector<std::uint16_t>& scratch) {
  scratch.assign(boundary.begin(), boundary.end());
  const int now = std::clamp(256 * percentile(scratch, upper_end) / grid_height, 1, 255);
  if (slow_horizon == 0)
    return static_cast<std::uint32_t>(now);
  const int slow = static_cast<int>(slow_horizon);
  return static_cast<std::uint32_t>(std::max(slow + ((now - slow) >> 2), 1));
}

namespace {

// All in units of the score (32 = 1 nat); applied in Q4.
TERRAINSEG_TUNED(int, boundary, edge_limit, 288);
TERRAINSEG_TUNED(int, boundary, edge_per_octave, 88);
/// Chosen by measurement. With 200, India has 8.15 % error instead of 8.07 %; with 230, 15 Hz has 2.46 %
/// instead of 2.42 %.
TERRAINSEG_TUNED(int, boundary, shadow_limit, 215);
TERRAINSEG_TUNED(int, boundary, shadow_per_grey, 10);
TERRAINSEG_TUNED(int, boundary, step_price, 140);
/// Reduction of the step price per octave of an upright edge above a difference of 32, because obstacles have
/// upright sides. Reduces the error of a drive in town by 0.2 points and its unsafe pixels by a tenth.
TERRAINSEG_TUNED(int, boundary, upright_per_octave, 72);
TERRAINSEG_TUNED(int, boundary, upright_floor, 32);
/// Price for leaving the last frame's row, per row, for at most three rows. Measured at 15 Hz (error / unsafe
/// %): with 48 for two rows 2.70 / 12.1 instead of 2.45 / 10.7, and 1.62 % flicker instead of 1.48 %; with 96
/// 2.64 / 11.0. With four rows roads and trails get worse.
TERRAINSEG_TUNED(int, boundary, leave_price, 80);
TERRAINSEG_TUNED(int, boundary, leave_rows, 3);
/// Price for ground above an obstacle, and for a curve where the picture has no edge. Without ground behind
/// obstacles, a column is cut at an obstacle only when the ground behind it has less weight. Below 300, kerbs
/// and markings also cut the ground.
TERRAINSEG_TUNED(int, boundary, behind_price, 360);

// Table of the value of a colour step, in Q4. The values are logarithms of a small range.
template <typename Worth> constexpr std::array<std::int16_t, most_color_step + 1> table_of(Worth worth) {
  std::array<std::int16_t, most_color_step + 1> table{};
  for (int step = 0; step <= most_color_step; ++step)
    table[step] = static_cast<std::int16_t>(16 * worth(step));
  return table;
}
constexpr int octaves_above(int step, int floor, int per_octave) {
  return ((log2_q8(static_cast<std::uint64_t>(step + floor)) - log2_q8(static_cast<std::uint64_t>(floor))) *
          per_octave) >>
         8;
}
TERRAINSEG_TUNED_TABLE(edge_worth, table_of([](int step) {
                         return std::min(edge_limit, octaves_above(step, 4, edge_per_octave));
                       }));
TERRAINSEG_TUNED_TABLE(step_prices, table_of([](int step) {
                         return std::max(step_price - octaves_above(step, upright_floor, upright_per_octave),
                                         0);
                       }));

} // namespace

void BoundarySearch::look(const Grid& grid, const ColorSteps& steps, int gain_q8, const GridCurve& before) {
  weigh_edges(grid, steps, gain_q8, before);
  price_steps(grid, steps);
}

void BoundarySearch::find(const Grid& grid, const CellScores& score, const RowPriors& prior,
                          bool ground_behind, GridCurve& boundary) {
  const int rows = grid.height + 1;
  weigh_columns(grid, score, prior, ground_behind);
  loss_.resize(utility_.size());
  base_.resize(grid.width);
  for (int j = 0; j < grid.width; ++j) {
    std::int32_t* loss = &loss_[j * rows];
    if (j == 0) {
      std::fill_n(loss, rows, 0);
    } else {
      std::copy_n(loss - rows, rows, loss);
      kernels::spread_least(loss, &place_[j * rows], rows);
    }
    // Subtracting a constant does not change the best curve. It keeps the sums small for every grid.
    const std::int32_t* utility = &utility_[j * rows];
    base_[j] = loss[0];
    for (int r = 0; r < rows; ++r)
      loss[r] -= utility[r] + base_[j];
  }
  boundary.resize(grid.width);
  int row = static_cast<int>(std::min_element(loss_.end() - rows, loss_.end()) - (loss_.end() - rows));
  for (int j = grid.width - 1; j >= 0; --j) {
    boundary[j] = static_cast<std::uint16_t>(row);
    if (j > 0)
      row = predecessor(j, row, rows);
  }
}

/// The row of the column to the left from which the best curve comes. Of equal ones the nearest, and one
/// above rather than one below.
int BoundarySearch::predecessor(int column, int row, int rows) const {
  const std::int32_t *loss = &loss_[(column - 1) * rows], *place = &place_[column * rows];
  const std::int32_t least = loss_[column * rows + row] + utility_[column * rows + row] + base_[column];
  const auto is_from = [&](int r) { return loss[r] + std::abs(place[row] - place[r]) == least; };
  for (int r = row; r >= 0; --r)
    if (is_from(r))
      return r;
  int r = row + 1;
  while (!is_from(r))
    ++r;
  return r;
}

// Computes the value of a curve at each row from the edges of the picture and the last frame's curve.
void BoundarySearch::weigh_edges(const Grid& grid, const ColorSteps& steps, int gain_q8,
                                 const GridCurve& before) {
  const auto width = static_cast<std::size_t>(grid.width), rows = static_cast<std::size_t>(grid.height) + 1;
  edges_.assign(width * rows, 0);
  for (int r = 1; r < grid.height; ++r) {
    // The edge between the row above the curve and the row below it.
    const std::size_t above = grid.at(r - 1, 0), below = grid.at(r, 0);
    const std::uint8_t *const luma_above = grid.planes[0].row(r - 1), *const luma_below =
                                                                          grid.planes[0].row(r);
    for (std::size_t j = 0; j < width; ++j) {
      // The base of an obstacle is often darkened by its own shadow.
      const int darker = ((luma_below[j] - luma_above[j]) * gain_q8) >> 8;
      const int edge =
          edge_worth[steps.down[above + j]] + 16 * std::clamp(shadow_per_grey * darker, 0, shadow_limit);
      const bool seen = (grid.ignored[above + j] | grid.ignored[below + j]) == 0;
      edges_[j * rows + r] = seen ? edge : 0;
    }
  }
  if (!before.empty())
    for (std::size_t j = 0; j < width; ++j)
      for (std::size_t r = 0; r < rows; ++r)
        edges_[j * rows + r] -=
            16 * leave_price * std::min(std::abs(static_cast<int>(r) - before[j]), leave_rows);
}

void BoundarySearch::price_edgeless(const Grid& grid, const std::vector<std::uint8_t>& edgeless) {
  const auto width = static_cast<std::size_t>(grid.width), height = static_cast<std::size_t>(grid.height);
  for (std::size_t j = 0; j < width; ++j)
    for (std::size_t r = 0; r < height; ++r)
      edges_[j * (height + 1) + r] -= 16 * behind_price * edgeless[r * width + j];
}

// Computes per row the sum of the scores below minus the sum above, plus the value of the edge, plus the gain
// of the best stretch of ground above the curve minus its price.
void BoundarySearch::weigh_columns(const Grid& grid, const CellScores& score, const RowPriors& prior,
                                   bool ground_behind) {
  const auto width = static_cast<std::size_t>(grid.width), height = static_cast<std::size_t>(grid.height),
             rows = height + 1;
  utility_.resize(width * rows);
  sums_.assign(width, 0);
  stretch_.assign(width, 0);
  behind_.assign(width, 0);
  const auto weight = [&](std::size_t row, std::size_t j) {
    return score[row * width + j] + 16 * prior[row];
  };
  for (std::size_t i = 0; i < height; ++i)
    for (std::size_t j = 0; j < width; ++j)
      sums_[j] += weight(i, j);
  for (std::size_t r = 0; r < rows; ++r) {
    if (r > 0)
      for (std::size_t j = 0; j < width; ++j)
        sums_[j] -= 2 * weight(r - 1, j);
    if (ground_behind && r > 1)
      for (std::size_t j = 0; j < width; ++j) {
        const std::int32_t stretch = std::max(stretch_[j], 0) + 2 * weight(r - 2, j);
        stretch_[j] = stretch;
        behind_[j] = std::max(behind_[j], stretch - 16 * behind_price);
      }
    std::int32_t* const utility = &utility_[r];
    const std::int32_t* const edges = &edges_[r];
    for (std::size_t j = 0; j < width; ++j)
      utility[j * rows] = sums_[j] + behind_[j] + edges[j * rows];
  }
}

// Adds up the prices for the curve to pass rows between a column and the one to its left.
void BoundarySearch::price_steps(const Grid& grid, const ColorSteps& steps) {
  const auto width = static_cast<std::size_t>(grid.width), height = static_cast<std::size_t>(grid.height),
             rows = height + 1;
  place_.resize(width * rows);
  for (std::size_t j = 0; j < width; ++j)
    place_[j * rows] = 0;
  for (std::size_t r = 0; r < height; ++r)
    for (std::size_t j = 1; j < width; ++j)
      place_[j * rows + r + 1] =
          place_[j * rows + r] +
          step_prices[steps.right[grid.at(static_cast<int>(r), static_cast<int>(j)) - 1]];
}

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

void GroundTracer::look(const View& view, const ColorSteps& steps, const GridCurve& before) {
  search_.look(view.grid, steps, view.exposure.gain, before);
  if (view.task.settings.connected_ground)
    search_.price_edgeless(view.grid, view.connected.edgeless(view.grid));
}

const Ground& GroundTracer::trace(const View& view, const Scores& scores, int first_row, const FrameLine& end,
                                  GridCurve& last, std::uint32_t& slow_horizon) {
  const Settings& settings = view.task.settings;
  const Grid& grid = view.grid;
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
