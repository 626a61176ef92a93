// SPDX-License-Identifier: LGPL-2.1-or-later
#include "freespace/score/coherence.hpp"

#include <algorithm>
#include <cstdlib>

#include "base/fixed_log.hpp"

namespace terrainseg {
namespace {

/// Number of rows over which luma is summed, half of them above the cell's centre; and number of rows and
/// columns over which the result is averaged.
constexpr int rows_added = 4, rows_averaged = 5;
/// Weight of the score in 1/32, because colour and texture are no longer the only evidence.
constexpr int score_weight = 25;
/// Coherence without evidence (Q8); reduction of the score per additional octave (Q4); and the limits of the
/// evidence (five eighths of a nat against ground, a third for it).
constexpr int neutral = -40, weight = 336, against = -20 * 16, in_favour = 10 * 16;
/// Sum of 64 steps below which the evidence decreases: half a grey level each. A wall without texture is as
/// incoherent as sand, and stones in haze have upright edges of one grey level.
constexpr int full_contrast = 32;
/// Upper limit of the evidence in the lower third, where the row prior already favours ground. With 0, 2 %
/// more of the obstacles' pixels there are called ground.
constexpr int near_by = -4 * 16;

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
  sums_.assign(static_cast<std::size_t>(grid.height) * width_, 0);
  steps_.assign(sums_.size(), 0);
  luma_.resize(width_);
  for (int y = 0; y < pyramid.height(level_); ++y) {
    const std::uint8_t* luma = pyramid.plane(level_, 0).row(y);
    if (rgb) {
      transform_luma_row(transform, {luma, pyramid.plane(level_, 1).row(y), pyramid.plane(level_, 2).row(y)},
                         luma_.data(), static_cast<int>(width_));
      luma = luma_.data();
    }
    const std::size_t row = static_cast<std::size_t>(y >> (grid.level - level_)) * width_;
    std::uint16_t* __restrict const sums = &sums_[row], * __restrict const steps = &steps_[row];
    for (std::size_t x = 0; x < width_; ++x)
      sums[x] = static_cast<std::uint16_t>(sums[x] + luma[x]);
    for (std::size_t x = 0; x + 1 < width_; ++x)
      steps[x] = static_cast<std::uint16_t>(steps[x] + std::abs(luma[x + 1] - luma[x]));
  }
}

// Compares the largest step of the sums with the sum of the steps, around each cell's centre.
void UprightCoherence::compare(const Grid& grid) {
  const int shift = grid.level - level_, scale = 2 - shift; // scales to a cell of four columns and rows
  const auto columns = static_cast<std::size_t>(grid.width), per_cell = std::size_t{1} << shift,
             before = per_cell / 2;
  coherence_.resize(grid.size());
  contrast_.resize(grid.size());
  const std::size_t padded = std::max(before + width_, per_cell * columns);
  for (int i = 0; i < grid.height; ++i) {
    column_sums_.assign(width_, 0);
    column_all_.assign(padded, 0);
    column_most_.assign(padded, 0);
    for (int k = -rows_added / 2; k < rows_added / 2; ++k) {
      const std::size_t row = static_cast<std::size_t>(std::clamp(i + k, 0, grid.height - 1)) * width_;
      const std::uint16_t *const sums = &sums_[row], *const steps = &steps_[row];
      std::uint16_t* __restrict const all_sums = column_sums_.data(), * __restrict const all_steps =
                                                                          &column_all_[before];
      for (std::size_t x = 0; x < width_; ++x)
        all_sums[x] = static_cast<std::uint16_t>(all_sums[x] + sums[x]);
      for (std::size_t x = 0; x + 1 < width_; ++x)
        all_steps[x] = static_cast<std::uint16_t>(all_steps[x] + steps[x]);
    }
    for (std::size_t x = 0; x + 1 < width_; ++x)
      column_most_[before + x] = static_cast<std::uint16_t>(std::abs(column_sums_[x + 1] - column_sums_[x]));
    for (std::size_t j = 0; j < columns; ++j) {
      unsigned most = 0, all = 0;
      for (std::size_t x = j * per_cell; x < (j + 1) * per_cell; ++x) {
        most = std::max<unsigned>(most, column_most_[x]);
        all += column_all_[x];
      }
      all <<= 2 * scale;
      // Q8 of log2 of (1 + 4 most / 16) / (1 + 4 all / 64).
      coherence_[grid.at(i, 0) + j] =
          static_cast<std::int16_t>(log2_q8(4 + (most << scale)) - log2_q8(16 + all) + 512);
      contrast_[grid.at(i, 0) + j] = static_cast<std::uint16_t>(std::min<unsigned>(all, full_contrast));
    }
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
  for (int i = 0; i < grid.height; ++i)
    for (int j = 0; j < grid.width; ++j) {
      const std::size_t cell = grid.at(i, j);
      const int says = std::clamp(((neutral - average_[cell]) * weight) >> 8, against, in_favour) *
                       contrast_[cell] / full_contrast;
      const int added = i >= near_row ? std::min(says, near_by) : says;
      if (!grid.ignored[cell])
        score[cell] = static_cast<std::int16_t>(((score[cell] * score_weight) >> 5) + added);
    }
}

} // namespace terrainseg
