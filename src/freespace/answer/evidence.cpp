// SPDX-License-Identifier: LGPL-2.1-or-later
#include "freespace/answer/evidence.hpp"

#include <algorithm>
#include <array>
#include <cstdlib>

#include "base/tuning.hpp"
#include "terrainseg/estimate.hpp"

namespace terrainseg {
namespace {

/// Rows on each side of the boundary whose scores measure how certain its position is, their limit (Q4), and
/// their weight. On rendered scenes the rank correlation with the error is -0.38 with them and -0.19 without.
TERRAINSEG_TUNED(int, confidence, near_rows, 3);
TERRAINSEG_TUNED(int, confidence, near_limit, 24 * 16);
TERRAINSEG_TUNED(int, confidence, near_weight, 3);
TERRAINSEG_TUNED(int, confidence, full_separation, 105 * 16); ///< Q4; the best frames reach 168
/// Smallest score of ground that is sure (Q4): half a nat. The share of the ground that is sure is a
/// factor of the confidence: where the mask swallowed something, the scores of much of its ground are low.
TERRAINSEG_TUNED(int, confidence, sure_score, 16 * 16);
TERRAINSEG_TUNED(int, confidence, half_at_jumps,
                 200); ///< percent of the grid's width: sum of the jumps in rows that halves the confidence
TERRAINSEG_TUNED(int, confidence, spread_weight, 16); ///< a spread of 1/16 of the height halves the
                                                      ///< confidence

} // namespace

std::uint8_t mask_confidence(const Grid& grid, const CellScores& score, const GridCurve& boundary,
                             const GroundBehind& behind) {
  std::int64_t ground = 0, other = 0, cells_ground = 0, sure = 0, near = 0, cells_near = 0, jumps = 0;
  for (int i = 0; i < grid.height; ++i)
    for (int j = 0; j < grid.width; ++j) {
      const bool is_ground = i >= boundary[j] || (behind.any && i >= behind.first[j] && i < behind.end[j]);
      const int s = score[grid.at(i, j)];
      (is_ground ? ground : other) += s;
      cells_ground += is_ground;
      sure += is_ground && s >= sure_score;
      if (i >= boundary[j] - near_rows && i < boundary[j] + near_rows) {
        near += std::clamp(is_ground ? s : -s, -near_limit, near_limit);
        ++cells_near;
      }
    }
  for (int j = 1; j < grid.width; ++j)
    jumps += std::abs(boundary[j] - boundary[j - 1]);
  const auto cells_other = static_cast<std::int64_t>(grid.size()) - cells_ground;
  if (cells_ground == 0 || cells_other == 0)
    return 0;
  std::int64_t separation = ground / cells_ground - other / cells_other +
                            near_weight * near / std::max<std::int64_t>(cells_near, 1);
  separation = separation * half_at_jumps / (half_at_jumps + jumps * 100 / grid.width) * sure / cells_ground;
  return static_cast<std::uint8_t>(std::clamp<std::int64_t>(separation * 255 / full_separation, 0, 255));
}

std::uint8_t horizon_confidence(std::uint8_t mask_confidence, int spread, int frame_height) {
  return static_cast<std::uint8_t>(mask_confidence * frame_height / (frame_height + spread_weight * spread));
}

namespace {

/// Cells of one colour have correlated errors: a score (Q4) therefore has only a third of its weight, as
/// found by logistic regression over 23 sets of pictures. docs/metadata.md has the measured calibration.
TERRAINSEG_TUNED(int, evidence, score_weight, 5);
TERRAINSEG_TUNED(int, evidence, score_shift, 8);
TERRAINSEG_TUNED(int, evidence, score_limit, 96 * 16);
/// Evidence per row between a cell and the boundary, 32 = 1 nat, and the largest number of rows that count.
TERRAINSEG_TUNED(int, evidence, row_weight, 10);
TERRAINSEG_TUNED(int, evidence, most_rows, 8);
/// Oddness (Q4 of a deviation) that is usual and gives no evidence; 32 more are half a nat.
TERRAINSEG_TUNED(int, evidence, usual_oddness, 24);
/// Evidence of standing: 16 of 256 are one nat; and its limit.
TERRAINSEG_TUNED(int, evidence, standing_weight, 2);
TERRAINSEG_TUNED(int, evidence, most_standing, 8 * 32);
/// Cells of spots and of motion are at most this many levels finer than the grid.
TERRAINSEG_TUNED(int, evidence, most_levels_finer, 2);
/// Evidence for the whole picture: for a label with zero confidence of the mask, and its increase at
/// confidence 255.
TERRAINSEG_TUNED(int, evidence, without_confidence, -36);
TERRAINSEG_TUNED(int, evidence, full_confidence, 80);

/// Table of 255 * tanh(x / 2) for x = 0, 1/2, 1 .. 6 nats.
constexpr int step_bits = 4;
constexpr std::array<std::uint8_t, 13> certainty{0,   62,  118, 162, 194, 216, 231,
                                                 240, 246, 249, 252, 253, 254};

/// Table of confidence_of() from 0 up to its maximum.
constexpr auto confidence_table = [] {
  std::array<std::uint8_t, (certainty.size() - 1) << step_bits> table{};
  for (std::size_t e = 0; e < table.size(); ++e) {
    const std::size_t step = e >> step_bits;
    const int part = static_cast<int>(e) & ((1 << step_bits) - 1);
    table[e] = static_cast<std::uint8_t>(certainty[step] +
                                         (((certainty[step + 1] - certainty[step]) * part) >> step_bits));
  }
  return table;
}();

int appearance(int score) {
  return std::clamp(score, -score_limit, score_limit) * score_weight >> score_shift;
}

/// Evidence of the position: half rows from the curve, positive on the ground's side.
int place(int half_rows) {
  return std::clamp(half_rows, -2 * most_rows, 2 * most_rows) * row_weight / 2;
}

void start_row(const std::int16_t* __restrict scores, const std::uint16_t* __restrict boundary, int row,
               int count, std::int16_t* __restrict sums) {
  // Counts from half a row, so that the rows next to the curve are equally far from it.
  for (int x = 0; x < count; ++x)
    sums[x] = static_cast<std::int16_t>(appearance(scores[x]) + place(2 * (row - boundary[x]) + 1));
}

template <typename Value>
void raise_to(const Value* __restrict values, int count, std::int16_t* __restrict most) {
  for (int x = 0; x < count; ++x)
    most[x] = std::max(most[x], static_cast<std::int16_t>(values[x]));
}

void look_at(const std::uint8_t* __restrict labels, const int* __restrict pixels, int count,
             std::uint8_t* __restrict out) {
  for (int x = 0; x < count; ++x)
    out[x] = labels[pixels[x]];
}

/// Computes the evidence for the label plus that of the whole picture, limited to the size of the table.
void turn_to(const std::uint8_t* __restrict labels, const std::int16_t* __restrict sums, std::int16_t whole,
             int count, std::int16_t* __restrict out) {
  constexpr auto last = static_cast<std::int16_t>(confidence_table.size() - 1);
  for (int x = 0; x < count; ++x) {
    const auto against = static_cast<std::int16_t>(-sums[x]);
    const auto sum = static_cast<std::int16_t>((labels[x] == mask_traversable ? sums[x] : against) + whole);
    const std::int16_t least = sum < 0 ? std::int16_t{0} : sum;
    out[x] = least < last ? least : last;
  }
}

void look_up(const std::int16_t* __restrict sums, const std::uint8_t* __restrict ignored, int count,
             std::uint8_t* __restrict out) {
  for (int x = 0; x < count; ++x)
    out[x] = ignored[x] ? std::uint8_t{0} : confidence_table[sums[x]];
}

bool any_of(const std::int16_t* values, int count) {
  int any = 0;
  for (int x = 0; x < count; ++x)
    any |= values[x];
  return any != 0;
}

} // namespace

std::uint8_t confidence_of(int evidence) {
  return confidence_table[std::clamp(evidence, 0, static_cast<int>(confidence_table.size()) - 1)];
}

void Evidence::start(const Grid& grid, const CellScores& score, const GridCurve& boundary,
                     const GroundBehind& behind) {
  level_ = grid.level;
  width_ = grid.width;
  height_ = grid.height;
  sums_.resize(grid.size());
  // reserved for all detectors, so that no later frame allocates
  strongest_.reserve((width_ + 1) << most_levels_finer);
  ends_.reserve(width_);
  for (int i = 0; i < height_; ++i) {
    const std::int16_t* const scores = &score[grid.at(i, 0)];
    std::int16_t* const sums = &sums_[grid.at(i, 0)];
    start_row(scores, boundary.data(), i, width_, sums);
    for (int j = 0; behind.any && j < width_; ++j)
      if (i < boundary[j] && i >= behind.first[j] && i < behind.end[j])
        sums[j] = static_cast<std::int16_t>(
            appearance(scores[j]) + place(2 * std::min(i - behind.first[j], behind.end[j] - 1 - i) + 1));
  }
}

// A cell of the grid gets the largest value of its finer cells. `strength` increases with the value; it is 0
// for values up to 0.
template <typename Value, typename Strength>
void Evidence::subtract_cells(const FinerCells<Value>& cells, Strength strength) {
  const int half = 1 << level_ >> 1;
  const auto cell_of = [&](int index, int count) {
    return std::min(((index << cells.level) + cells.middle + half) >> level_, count - 1);
  };
  // The finer cells of a cell are contiguous in each row and column; ends_ holds the ends of their columns.
  ends_.assign(width_, 0);
  for (int x = 0; x < cells.width; ++x)
    ends_[cell_of(x, width_)] = x + 1;
  strongest_.resize(cells.width);
  for (int y = 0, end; y < cells.height; y = end) {
    const int row = cell_of(y, height_);
    std::fill(strongest_.begin(), strongest_.end(), std::int16_t{0});
    for (end = y; end < cells.height && cell_of(end, height_) == row; ++end)
      raise_to(&cells.values[end * cells.stride], cells.width, strongest_.data());
    if (!any_of(strongest_.data(), cells.width))
      continue;
    std::int16_t* const out = &sums_[row * width_];
    for (int j = 0, x = 0; j < width_; ++j) {
      int most = 0;
      for (; x < ends_[j]; ++x)
        most = std::max<int>(most, strongest_[x]);
      out[j] = static_cast<std::int16_t>(out[j] - strength(most));
    }
  }
}

void Evidence::subtract(const Detection& found) {
  if (!found.oddness.values.empty())
    subtract_cells(found.oddness, [](int odd) { return std::max(odd - usual_oddness, 0) / 2; });
  if (!found.standing.values.empty())
    subtract_cells(found.standing,
                   [](int stands) { return std::clamp(stands * standing_weight, 0, most_standing); });
}

void Evidence::tell(const Grid& grid, const GrayView& mask, int mask_level, std::uint8_t frame_confidence,
                    const MutablePlane& confidence) {
  const int whole = without_confidence + full_confidence * frame_confidence / 255;
  const auto pixel = [&](int index, int count) {
    return std::min(subsampled(index << level_, mask_level), count - 1);
  };
  pixels_.resize(width_);
  for (int j = 0; j < width_; ++j)
    pixels_[j] = pixel(j, mask.width);
  labels_.resize(width_);
  turned_.resize(width_);
  for (int i = 0; i < height_; ++i) {
    look_at(mask.plane.row(pixel(i, mask.height)), pixels_.data(), width_, labels_.data());
    turn_to(labels_.data(), &sums_[grid.at(i, 0)], static_cast<std::int16_t>(whole), width_, turned_.data());
    look_up(turned_.data(), &grid.ignored[grid.at(i, 0)], width_, confidence.row(i));
  }
}

} // namespace terrainseg
