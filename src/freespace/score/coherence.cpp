// SPDX-License-Identifier: LGPL-2.1-or-later
#include "freespace/score/coherence.hpp"

#include <algorithm>

#include "base/tuning.hpp"
#include "freespace/look/view.hpp"
#include "kernels/cells.hpp"

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

void UprightCoherence::look(const Pyramid& pyramid, const Grid& grid, const ColorTransform& transform,
                            bool rgb) {
  add_rows(pyramid, grid, transform, rgb);
  compare(grid);
  average(grid);
}

// Sums luma and steps over the rows of each cell.
void UprightCoherence::add_rows(const Pyramid& pyramid, const Grid& grid, const ColorTransform& transform,
                                bool rgb) {
  level_ = refinement_level(grid.level);
  width_ = static_cast<std::size_t>(pyramid.width(level_));
  const int width = static_cast<int>(width_), height = pyramid.height(level_),
            per_cell = 1 << (grid.level - level_);
  sums_.resize(static_cast<std::size_t>(grid.height) * width_);
  steps_.resize(sums_.size());
  luma_.resize(static_cast<std::size_t>(per_cell) * width_);
  for (int i = 0; i < grid.height; ++i) {
    const int top = i * per_cell, rows = std::min(per_cell, height - top);
    std::array<const std::uint8_t*, 4> row{};
    for (std::size_t k = 0; k < static_cast<std::size_t>(rows); ++k)
      row[k] = luma_row(pyramid, level_, top + static_cast<int>(k), transform, rgb, &luma_[k * width_]);
    const std::size_t at = static_cast<std::size_t>(i) * width_;
    kernels::sum_rows(row, rows, width, &sums_[at], &steps_[at]);
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

} // namespace terrainseg
