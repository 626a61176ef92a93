// SPDX-License-Identifier: LGPL-2.1-or-later
#include "freespace/score/cell_scorer.hpp"

#include <algorithm>
#include <cstdlib>
#include <numeric>

#include "base/tuning.hpp"
#include "kernels/cells.hpp"
#include "learning/terrain_model.hpp"

namespace terrainseg {
namespace {

/// Number of rows over which luma is summed, half of them above the cell's centre; and number of rows and
/// columns over which the result is averaged.
constexpr int rows_added = 4, rows_averaged = 5;
/// Weight of the score in 1/32, because colour and texture are no longer the only evidence.
TERRAINSEG_TUNED(int, upright, score_weight, 25);
/// Coherence without evidence (Q8); reduction of the score per additional octave (Q4); and the limits of the
/// evidence (five eighths of a nat against ground, a third for it).
TERRAINSEG_TUNED(int, upright, neutral, -40);
TERRAINSEG_TUNED(int, upright, weight, 336);
TERRAINSEG_TUNED(int, upright, against, -20 * 16);
TERRAINSEG_TUNED(int, upright, in_favour, 10 * 16);
/// Sum of 64 steps below which the evidence decreases: half a grey level each. A wall without texture is as
/// incoherent as sand, and stones in haze have upright edges of one grey level.
constexpr int full_contrast = 32; // as in kernels::weigh_upright()
/// Upper limit of the evidence in the lower third (Q4), where the row prior already favours ground. With 0, 2
/// % more of the obstacles' pixels there are called ground.
TERRAINSEG_TUNED(int, upright, near_by, -4 * 16);

} // namespace

void UprightCoherence::look(const LumaLevels& luma, const Grid& grid) {
  level_ = refinement_level(grid.level);
  add_rows(luma.level(level_), grid);
  compare(grid);
  average(grid);
}

// Sums luma and steps over the rows of each cell.
void UprightCoherence::add_rows(const GrayView& luma, const Grid& grid) {
  width_ = static_cast<std::size_t>(luma.width);
  const int per_cell = 1 << (grid.level - level_);
  sums_.resize(static_cast<std::size_t>(grid.height) * width_);
  steps_.resize(sums_.size());
  for (int i = 0; i < grid.height; ++i) {
    const int top = i * per_cell, rows = std::min(per_cell, luma.height - top);
    std::array<const std::uint8_t*, 4> row{};
    for (int k = 0; k < rows; ++k)
      row[k] = luma.plane.row(top + k);
    const std::size_t at = static_cast<std::size_t>(i) * width_;
    kernels::sum_rows(row, rows, luma.width, &sums_[at], &steps_[at]);
  }
}

// Compares the largest step of the sums with the sum of the steps, around each cell's centre.
void UprightCoherence::compare(const Grid& grid) {
  const int shift = grid.level - level_, scale = 2 - shift; // scales to a cell of four columns and rows
  const auto columns = static_cast<std::size_t>(grid.width), per_cell = std::size_t{1} << shift,
             before = per_cell / 2, padded = std::max(before + width_, per_cell * columns) + 1;
  coherence_.resize(grid.size());
  contrast_.resize(grid.size());
  most_.resize(columns);
  values_.resize(2 * columns);
  logs_.resize(2 * columns);
  // Steps are 0 beyond the picture: its edges are repeated there.
  column_sums_.assign(padded, 0);
  column_steps_.assign(padded, 0);
  const auto add = [&](int i, int sign) {
    const std::size_t row = static_cast<std::size_t>(std::clamp(i, 0, grid.height - 1)) * width_;
    const auto add_to = [&](const std::uint16_t* values, std::size_t count, std::uint16_t* __restrict all) {
      for (std::size_t x = 0; x < count; ++x)
        all[x] = static_cast<std::uint16_t>(sign > 0 ? all[x] + values[x] : all[x] - values[x]);
    };
    add_to(&sums_[row], width_, &column_sums_[before]);
    add_to(&steps_[row], width_ - 1, &column_steps_[before]);
  };
  for (int k = -rows_added / 2; k < rows_added / 2; ++k)
    add(k, 1);
  for (int i = 0; i < grid.height; ++i) {
    std::fill_n(column_sums_.begin(), before, column_sums_[before]);
    const auto last = column_sums_.begin() + static_cast<std::ptrdiff_t>(before + width_);
    std::fill(last, column_sums_.end(), last[-1]);
    kernels::largest_steps(column_sums_.data(), static_cast<int>(per_cell), grid.width, most_.data());
    std::uint16_t* const contrast = &contrast_[grid.at(i, 0)];
    std::fill_n(contrast, columns, std::uint16_t{0});
    kernels::add_boxes(column_steps_.data(), static_cast<int>(per_cell), 2 * scale, grid.width, contrast);
    // Q8 of log2 of (1 + 4 most / 16) / (1 + 4 all / 64).
    for (std::size_t j = 0; j < columns; ++j) {
      values_[j] = (4 + (std::uint32_t{most_[j]} << scale)) << 8;
      values_[columns + j] = (16 + std::uint32_t{contrast[j]}) << 8;
    }
    log2_q8(values_.data(), static_cast<int>(2 * columns), logs_.data());
    for (std::size_t j = 0; j < columns; ++j) {
      coherence_[grid.at(i, 0) + j] = static_cast<std::int16_t>(logs_[j] - logs_[columns + j] + 512);
      contrast[j] = std::min(contrast[j], std::uint16_t{full_contrast});
    }
    add(i - rows_added / 2, -1);
    add(i + rows_added / 2, 1);
  }
}

// Averages over 3 x 5 cells. Cells at the edge of the picture are repeated beyond it.
void UprightCoherence::average(const Grid& grid) {
  const auto columns = static_cast<std::size_t>(grid.width);
  constexpr int reach = rows_averaged / 2;
  average_.resize(grid.size());
  down_.assign(columns, 0);
  const auto add = [&](int row, int sign) {
    const std::int16_t* const own = &coherence_[grid.at(std::clamp(row, 0, grid.height - 1), 0)];
    for (std::size_t j = 0; j < columns; ++j)
      down_[j] = static_cast<std::int16_t>(down_[j] + sign * own[j]);
  };
  for (int row = -reach; row <= reach; ++row)
    add(row, 1);
  for (int i = 0; i < grid.height; ++i) {
    for (std::size_t j = 0; j < columns; ++j) {
      const int sum = down_[j > 0 ? j - 1 : 0] + down_[j] + down_[std::min(j + 1, columns - 1)];
      average_[grid.at(i, 0) + j] =
          static_cast<std::int16_t>((sum * ((1 << 16) / (3 * rows_averaged))) >> 16);
    }
    add(i - reach, -1);
    add(i + reach + 1, 1);
  }
}

void UprightCoherence::weigh(const Grid& grid, CellScores& score) const {
  const int near_row = grid.height * 2 / 3;
  for (int i = 0; i < grid.height; ++i) {
    const std::size_t row = grid.at(i, 0);
    kernels::weigh_upright(&average_[row], &contrast_[row], &grid.ignored[row],
                           {neutral, weight, against, in_favour, i >= near_row ? near_by : in_favour},
                           score_weight, grid.width, &score[row]);
  }
}

namespace {

TERRAINSEG_TUNED(std::int64_t, temporal, longest_gap,
                 2'000'000'000); ///< largest interval; after it the scores are outdated even if the pictures
                                 ///< are similar
/// Largest difference for averaging, as the inverse of a share of the variation. The decision uses the
/// picture instead of the clock: averaging over the jumps of a 1 Hz sequence costs 0.8 to 6 points of error,
/// over two similar pictures a second apart nothing. Frames of one motion differ by less than a fifth of the
/// picture's own variation: a drive in town at 15 Hz by 0.07 to 0.2, pictures a second apart by 0.3 and more.
TERRAINSEG_TUNED(std::uint64_t, temporal, likeness, 5);
/// Inverse of the cells by which a picture may have moved for the last one's obstacles to stay where they
/// were. Rendered drives at 30 Hz: straight ones move by 1/2.5 (road) to 1/16 (plain), most frames of bumpy
/// ones by more than a third.
TERRAINSEG_TUNED(std::uint64_t, temporal, steadiness, 3);

} // namespace

bool shows_same_place(const LastPicture& last, const Grid& grid, std::int64_t pts, Temporal mode) {
  if (last.luma.size() != grid.size() || mode == Temporal::on)
    return last.luma.size() == grid.size();
  if (pts >= 0 && last.pts >= 0 && std::llabs(pts - last.pts) > longest_gap)
    return false;
  std::uint64_t sum = 0;
  for (int i = 0; i < grid.height; ++i)
    sum = std::accumulate(grid.planes[0].row(i), grid.planes[0].row(i) + grid.width, sum);
  const int mean = static_cast<int>(sum / grid.size());
  std::uint64_t change = 0, spread = 0;
  for (int i = 0; i < grid.height; ++i) {
    const std::uint8_t *const now = grid.planes[0].row(i), *const before = &last.luma[grid.at(i, 0)];
    for (int j = 0; j < grid.width; ++j) {
      change += static_cast<std::uint64_t>(std::abs(now[j] - before[j]));
      spread += static_cast<std::uint64_t>(std::abs(now[j] - mean));
    }
  }
  return change * likeness <= spread;
}

bool has_hardly_moved(const LastPicture& last, const Grid& grid) {
  if (last.luma.size() != grid.size())
    return false;
  const auto difference = [](std::uint8_t a, std::uint8_t b) { return std::max(a, b) - std::min(a, b); };
  std::uint64_t change = 0, steps = 0;
  for (int i = 0; i + 1 < grid.height; ++i) {
    const std::uint8_t *const now = grid.planes[0].row(i), *const below = grid.planes[0].row(i + 1),
                              *const before = &last.luma[grid.at(i, 0)];
    for (int j = 0; j + 1 < grid.width; ++j) {
      change += difference(now[j], before[j]);
      steps += std::max(difference(now[j], now[j + 1]), difference(now[j], below[j]));
    }
  }
  return change * steadiness < steps;
}

void remember(const Grid& grid, std::int64_t pts, LastPicture& last) {
  last.luma.clear();
  for (int i = 0; i < grid.height; ++i)
    last.luma.insert(last.luma.end(), grid.planes[0].row(i), grid.planes[0].row(i) + grid.width);
  last.pts = pts;
}

void average_scores(const CellScores& score, bool continued, CellScores& average) {
  if (!continued || average.size() != score.size()) {
    average.assign(score.begin(), score.end());
    return;
  }
  // Weight of three quarters, so that objects that move in the picture leave no trail. A half doubles the
  // unsafe pixels of a drive at 15 Hz, and saves an eighth of the flicker.
  for (std::size_t i = 0; i < score.size(); ++i)
    average[i] = static_cast<std::int16_t>(average[i] + (((score[i] - average[i]) * 3) >> 2));
}

namespace {

TERRAINSEG_TUNED(int, local_reference, follow_below,
                 48); ///< distance within which it is the same surface in another light
TERRAINSEG_TUNED(int, local_reference, free_below, 34); ///< distance without a penalty
/// Three quarters of a nat. With 36/32 nat places of other kinds lose more ground than the stage finds
/// obstacles; without the stage a car in the window is not called blocked.
TERRAINSEG_TUNED(int, local_reference, greatest, 24);

} // namespace

std::array<int, 3> mean_color(const Grid& grid, std::span<const Cell> cells) {
  std::array<std::int64_t, 3> sum{};
  for (const Cell& cell : cells) {
    const Color color = grid.color(cell);
    for (int c = 0; c < 3; ++c)
      sum[c] += color[c];
  }
  std::array<int, 3> color{};
  for (int c = 0; c < 3; ++c)
    color[c] = static_cast<int>(16 * sum[c] / static_cast<std::int64_t>(cells.size()));
  return color;
}

void LocalReference::climb(const Grid& grid, const std::array<int, 3>& start, int gain,
                           CellPenalties& penalty) {
  const int width = grid.width;
  penalty.resize(grid.size());
  for (int c = 0; c < 3; ++c) {
    reference_[c].assign(width, start[c]);
    smooth_[c].resize(width);
  }
  const kernels::FollowRule rule{gain, free_below, greatest, follow_below};
  for (int i = grid.height - 1; i >= 0; --i) {
    const std::size_t row = grid.at(i, 0);
    kernels::follow_row(grid.row(i), &grid.ignored[row], rule,
                        {reference_[0].data(), reference_[1].data(), reference_[2].data()}, width,
                        &penalty[row]);
    for (int c = 0; c < 3; ++c) {
      kernels::smooth_row(reference_[c].data(), width, smooth_[c].data());
      reference_[c].swap(smooth_[c]);
    }
  }
}

namespace {

constexpr int far = 1 << 20; ///< beyond all distances
/// Distance without a penalty, and the largest penalty. It may outweigh colour alone, but not colour and
/// texture together.
TERRAINSEG_TUNED(int, geodesic, free_distance, 10);
TERRAINSEG_TUNED(int, geodesic, most, 40);
/// Largest step without a cost: 7/4 of the ground's own mean step plus one. It is limited because in the dark
/// the gain amplifies every grey level. With 2 plus twice the mean's integer part, a drive in town has 2.95 /
/// 8.3 (error / unsafe %) instead of 2.88 / 7.9; with 1 plus that, rendered roads have 6.2 % instead of 4.8
/// %.
TERRAINSEG_TUNED(int, geodesic, least_own_step, 1);
TERRAINSEG_TUNED(int, geodesic, greatest_own_step, 8);
TERRAINSEG_TUNED(int, geodesic, own_step_quarters, 7);
/// With every row the distance decreases by an eighth, so that a stop line across the whole road does not cut
/// off the ground behind it. Cropped to the road, a drive in town has 4.4 % error with it and 5.6 % without.
TERRAINSEG_TUNED(int, geodesic, forgive_shift, 3);

// The largest step without a cost, from the steps between the window's cells and the cells to their left and
// above them.
int own_step(const Grid& grid, const ColorSteps& steps, std::span<const Cell> seeds) {
  std::int64_t sum = 0, count = 0;
  for (const Cell& seed : seeds) {
    const std::size_t cell = grid.at(seed.y, seed.x);
    if (seed.x > 0) {
      sum += steps.right[cell - 1];
      ++count;
    }
    if (seed.y > 0) {
      sum += steps.down[cell - grid.width];
      ++count;
    }
  }
  const int own = count > 0 ? static_cast<int>(own_step_quarters * sum / (4 * count)) : 0;
  return std::min(least_own_step + own, greatest_own_step);
}

} // namespace

void GeodesicPenalty::raise(const Grid& grid, const ColorSteps& steps, std::span<const Cell> seeds,
                            CellPenalties& penalty) {
  if (seeds.empty())
    return;
  const int width = grid.width;
  const auto size = static_cast<std::size_t>(width);
  const int free = own_step(grid, steps, seeds);
  is_seed_.assign(grid.size(), 0);
  int lowest = 0;
  for (const Cell& seed : seeds) {
    is_seed_[grid.at(seed.y, seed.x)] = 1;
    lowest = std::max(lowest, int{seed.y});
  }
  here_.resize(size);
  below_.assign(size, far);
  place_.assign(size, 0);
  for (int i = lowest; i >= 0; --i) {
    const std::size_t row = grid.at(i, 0);
    int* here = here_.data();
    for (int j = 0; j < width; ++j)
      here[j] = is_seed_[row + j] ? 0 : far;
    // From the cells below, `side` columns apart.
    const auto come_from = [&](const std::vector<std::uint16_t>& step, int side) {
      const int from = side > 0, to = side < 0;
      const std::uint8_t* const ignored = grid.ignored.data() + row;
      kernels::pass_distances(below_.data() + from, step.data() + row + to, ignored + size + from,
                              ignored + to, free, width - std::abs(side), here + to);
    };
    if (i < lowest) {
      come_from(steps.down, 0);
      come_from(steps.down_left, -1);
      come_from(steps.down_right, 1);
    }
    for (std::size_t j = 1; j < size; ++j) {
      const std::size_t left = row + j - 1;
      // Ignored cells are crossed without a cost.
      const bool costs = (grid.ignored[left] | grid.ignored[left + 1]) == 0;
      place_[j] = place_[j - 1] + (costs ? std::max(steps.right[left] - free, 0) : 0);
    }
    kernels::spread_least(here, place_.data(), width);
    kernels::raise_penalties(here, free_distance, most, forgive_shift, width, &penalty[row]);
    here_.swap(below_);
  }
}

namespace {

/// The mean colour of the trusted cells, or of the learned model with the largest mass when there are none.
std::array<int, 3> reference_color(const View& view, std::span<const Cell> trusted, const Terrain& terrain) {
  if (!trusted.empty())
    return mean_color(view.grid, trusted);
  const TerrainModel model = in_this_light(terrain.models[heaviest(terrain.models)], view.exposure);
  return {model.mean[0] >> 4, model.mean[1] >> 4, model.mean[2] >> 4};
}

/// The columns in which ground may be in another light. None when training pixels are supplied, because these
/// show the ground in all lights, and none when the window is not trusted.
Columns in_one_light(const View& view, std::span<const Cell> trusted) {
  const bool one_light = view.task.settings.light_ahead && !trusted.empty() && view.task.supervision.empty();
  return one_light ? columns_ahead(view.window_of_grid(), view.grid.width) : Columns{};
}

} // namespace

const ColorSteps& CellScorer::look(const View& view) {
  const Settings& settings = view.task.settings;
  measure_color_steps(view.grid, view.exposure.gain, settings.geodesic, steps_);
  if (settings.upright)
    coherence_.look(view.luma, view.grid);
  return steps_;
}

Scores CellScorer::score(const View& view, const Vouched& trusted, bool continued, CellScores& average,
                         TerrainTables& tables, const Terrain& terrain) {
  const Settings& settings = view.task.settings;
  if (settings.local_reference)
    local_reference_.climb(view.grid, reference_color(view, trusted.seeds, terrain), view.exposure.gain,
                           penalty_);
  else
    penalty_.assign(view.grid.size(), 0);
  if (settings.geodesic)
    geodesic_.raise(view.grid, steps_, trusted.seeds, penalty_);
  score_cells(view.grid, view.cells, tables.of(terrain, settings, view.cells.color), penalty_, trusted,
              in_one_light(view, trusted.seeds), score_);
  if (settings.upright)
    coherence_.weigh(view.grid, score_);
  average_scores(score_, continued, average);
  return {average, penalty_};
}

} // namespace terrainseg
