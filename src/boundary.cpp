// SPDX-License-Identifier: LGPL-2.1-or-later
#include "boundary.hpp"

#include <algorithm>
#include <array>
#include <cstdlib>

#include "fixed_log.hpp"

namespace terrainseg {
namespace {

// All in units of the score, 32 = 1 nat; used in Q4.
constexpr int edge_limit = 288;
constexpr int edge_per_octave = 88;
constexpr int shadow_limit = 160;
constexpr int shadow_per_grey = 10;
constexpr int step_price = 160;
constexpr int least_step_price = 16;
/// What an upright edge takes off the price, per octave above a difference of 32: obstacles have upright
/// sides. Takes 0.2 points of error and a tenth of the unsafe pixels off a drive in town.
constexpr int upright_per_octave = 72;
constexpr int upright_floor = 32;
/// For leaving the last frame's row, per row, two rows at most: 0.2 points less flicker at 15 Hz.
constexpr int leave_price = 24;
constexpr int leave_rows = 2;

// Logarithms of the few hundred values that a colour step is worth looking up for.
template <int floor, int per_octave>
constexpr auto octaves = [] {
  std::array<std::int16_t, 1024> table{};
  for (int e = 0; e < 1024; ++e)
    table[static_cast<std::size_t>(e)] = static_cast<std::int16_t>(
        ((log2_q8(static_cast<std::uint64_t>(e + floor)) - log2_q8(floor)) * per_octave) >> 8);
  return table;
}();

// The break between the row above the curve and the row below it.
int edge_at(const CoarseGrid& grid, std::size_t above, std::size_t below, int gain_q8) {
  if (grid.ignored[above] || grid.ignored[below])
    return 0;
  const int step = std::min(color_step(grid, above, below, gain_q8), 1023);
  const int edge = std::min<int>(edge_limit, octaves<4, edge_per_octave>[static_cast<std::size_t>(step)]);
  // The base of an obstacle lies in its own shadow.
  const int darker = ((grid.y[below] - grid.y[above]) * gain_q8) >> 8;
  return edge + std::clamp(shadow_per_grey * darker, 0, shadow_limit);
}

} // namespace

void BoundarySearch::find(const CoarseGrid& grid, const std::vector<std::int16_t>& score,
                          const std::vector<std::int16_t>& prior, int gain_q8,
                          const std::vector<std::uint16_t>& before, std::vector<std::uint16_t>& boundary) {
  const int rows = grid.height + 1;
  const auto column_of = [rows](auto& table, int j) { return &table[static_cast<std::size_t>(j) * rows]; };
  weigh_columns(grid, score, prior, gain_q8, before);
  best_.assign(utility_.begin(), utility_.begin() + rows);
  came_from_.resize(utility_.size());
  step_.resize(static_cast<std::size_t>(grid.height));
  for (int j = 1; j < grid.width; ++j) {
    // The best predecessor of every row: a distance transform, down and up.
    price_steps(grid, j, gain_q8);
    std::uint16_t* from = column_of(came_from_, j);
    std::int32_t* best = best_.data();
    const std::int32_t* step = step_.data();
    for (int r = 0; r < rows; ++r)
      from[r] = static_cast<std::uint16_t>(r);
    for (int r = 1; r < rows; ++r)
      if (best[r - 1] - step[r - 1] > best[r]) {
        best[r] = best[r - 1] - step[r - 1];
        from[r] = from[r - 1];
      }
    for (int r = rows - 2; r >= 0; --r)
      if (best[r + 1] - step[r] > best[r]) {
        best[r] = best[r + 1] - step[r];
        from[r] = from[r + 1];
      }
    const std::int32_t* utility = column_of(utility_, j);
    for (int r = 0; r < rows; ++r)
      best[r] += utility[r];
  }
  boundary.resize(static_cast<std::size_t>(grid.width));
  auto row = static_cast<std::uint16_t>(std::max_element(best_.begin(), best_.end()) - best_.begin());
  for (int j = grid.width - 1; j >= 0; --j) {
    boundary[static_cast<std::size_t>(j)] = row;
    if (j > 0)
      row = column_of(came_from_, j)[row];
  }
}

void BoundarySearch::weigh_columns(const CoarseGrid& grid, const std::vector<std::int16_t>& score,
                                   const std::vector<std::int16_t>& prior, int gain_q8,
                                   const std::vector<std::uint16_t>& before) {
  const int rows = grid.height + 1;
  utility_.resize(static_cast<std::size_t>(grid.width) * rows);
  for (int j = 0; j < grid.width; ++j) {
    std::int32_t* utility = &utility_[static_cast<std::size_t>(j) * rows];
    std::int32_t sum = 0;
    for (int i = 0; i < grid.height; ++i)
      sum += score[grid.at(i, j)] + 16 * prior[static_cast<std::size_t>(i)];
    utility[0] = sum;
    for (int r = 1; r < rows; ++r) {
      const std::size_t above = grid.at(r - 1, j);
      sum -= 2 * (score[above] + 16 * prior[static_cast<std::size_t>(r - 1)]);
      utility[r] = sum + (r < grid.height ? 16 * edge_at(grid, above, above + grid.width, gain_q8) : 0);
    }
    if (!before.empty())
      for (int r = 0; r < rows; ++r)
        utility[r] -=
            16 * leave_price * std::min(std::abs(r - before[static_cast<std::size_t>(j)]), leave_rows);
  }
}

// What it costs the curve to pass row r between column - 1 and column.
void BoundarySearch::price_steps(const CoarseGrid& grid, int column, int gain_q8) {
  for (int r = 0; r < grid.height; ++r) {
    const std::size_t cell = grid.at(r, column);
    const int edge = std::min(color_step(grid, cell, cell - 1, gain_q8), 1023);
    step_[static_cast<std::size_t>(r)] =
        16 * std::max(step_price - octaves<upright_floor, upright_per_octave>[static_cast<std::size_t>(edge)],
                      least_step_price);
  }
}

} // namespace terrainseg
