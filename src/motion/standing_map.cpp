// SPDX-License-Identifier: LGPL-2.1-or-later
#include "motion/standing_map.hpp"

#include <algorithm>
#include <utility>

#include "base/tuning.hpp"
#include "kernels/ground_warp.hpp"

namespace terrainseg {
namespace {

TERRAINSEG_TUNED(int, standing_map, one, 4096); ///< Q12
/// Evidence above which a cell becomes standing, and above which it remains standing, Q8.
TERRAINSEG_TUNED(int, standing_map, least_to_appear, 17);
TERRAINSEG_TUNED(int, standing_map, least_to_stay, 8);
/// Largest number of frames kept when one is added, Q12, so that repeated weak evidence does not accumulate.
/// With the memory of a moving camera the number never exceeds it.
TERRAINSEG_TUNED(int, standing_map, most_kept, 7 * one);
TERRAINSEG_TUNED(int, standing_map, most_ratio,
                 1843); ///< 0.45: largest distance of an obstacle's foot, as a part of the way to the
                        ///< vanishing line

/// Updates which cells stand, from their evidence and their previous state. Limits the evidence of other
/// cells to least_standing. Returns whether any cell stands. Auto-vectorised.
bool settle(int count, std::int16_t* __restrict evidence, std::uint8_t* __restrict stood) {
  constexpr std::int16_t none = least_standing;
  std::uint8_t any = 0;
  for (int j = 0; j < count; ++j) {
    const std::int16_t value = evidence[j];
    const bool stands = value > (stood[j] ? least_to_stay : least_to_appear);
    stood[j] = stands;
    any |= stood[j];
    evidence[j] = stands || value < none ? value : none;
  }
  return any != 0;
}

} // namespace

void StandingMap::reset(int columns, int rows) {
  columns_ = columns;
  rows_ = rows;
  sums_.assign(static_cast<std::size_t>(columns) * rows, {});
  moved_.assign(sums_.size(), {});
  stood_.assign(sums_.size(), 0);
  nodes_.resize(2 * (columns / 4 + 2));
  across_.resize(columns / 4 + 2);
  stood_before_.assign(sums_.size(), 0);
  columns_stand_.assign(columns, 0);
  first_filled_ = first_filled_before_ = rows;
  first_stood_ = end_stood_ = 0;
}

void StandingMap::move(const PlaneMotion& step, const GroundCamera& view, int keep) {
  static_assert(sizeof(Sum) == 4 * sizeof(std::int16_t));
  const kernels::PointMap map = pixel_map(step, view);
  const int first = std::clamp((view.vanishing_row >> 8) / 4, 0, rows_), nodes = columns_ / 4 + 2;
  const int filled = std::min(first_filled_before_, first);
  std::fill_n(moved_.begin() + filled * columns_, (first - filled) * columns_, Sum{});
  const int first_before = std::exchange(first_stood_, rows_), end_before = std::exchange(end_stood_, 0);
  const bool any_stood = first_before < end_before;
  if (any_stood) {
    stood_.swap(stood_before_);
    std::fill(stood_.begin(), stood_.end(), std::uint8_t{0});
  }
  for (int k = 0; k < nodes; ++k)
    across_[k] = across(view, 16 * k) + 3;
  for (int i = first; i < rows_; ++i) {
    const int down = below(view, 4 * i) + 384;
    kernels::map_row(map, across_.data(), down, nodes, nodes_.data());
    for (std::int32_t& node : nodes_)
      node -= 384;
    kernels::moved_sums({&sums_.data()->quality, columns_, rows_}, nodes_.data(), columns_, keep,
                        &moved_[i * columns_].quality);
    if (any_stood && move_stood(i, first_before, end_before)) {
      first_stood_ = std::min(first_stood_, i);
      end_stood_ = i + 1;
    }
  }
  sums_.swap(moved_);
  first_filled_before_ = first_filled_;
  first_filled_ = first;
}

/// Moves the standing cells of rows first .. end - 1 to the nearest cell, with a row's nodes. Returns false
/// when there was none.
bool StandingMap::move_stood(int row, int first, int end) {
  int least = nodes_[1], most = nodes_[1];
  for (std::size_t k = 3; k < nodes_.size(); k += 2) {
    least = std::min(least, nodes_[k]);
    most = std::max(most, nodes_[k]);
  }
  if ((most + 512) >> 10 < first || (least + 512) >> 10 >= end)
    return false;
  std::uint8_t* out = stood_.data() + row * columns_;
  for (int j = 0; j < columns_; ++j) {
    const std::int32_t* node = nodes_.data() + j / 4 * 2;
    const int u = node[0] + (node[2] - node[0]) * (j % 4) / 4,
              v = node[1] + (node[3] - node[1]) * (j % 4) / 4;
    const int column = (u + 512) >> 10, from = (v + 512) >> 10; // Q8, in units of 4 pixels
    if (column >= 0 && from >= 0 && column < columns_ && from < rows_)
      out[j] = stood_before_[from * columns_ + column];
  }
  return true;
}

/// Reduces a sum to the given number of frames.
StandingMap::Sum StandingMap::faded(const Sum& sum, int frames_q12) {
  const auto part = [&](int value) { return static_cast<std::int16_t>(value * frames_q12 / sum.count); };
  return {part(sum.quality), part(sum.count), part(sum.weight), part(sum.ratio)};
}

void StandingMap::add(std::span<const CellParallax> cells, std::span<const std::uint8_t> judged) {
  const auto sum = [](int a, int b) { return static_cast<std::int16_t>(std::clamp(a + b, -32767, 32767)); };
  for (int row = 0; row < rows_; ++row) {
    bool any = false;
    for (int i = row * columns_; i < (row + 1) * columns_; ++i) {
      if (!judged[i])
        continue;
      any = true;
      Sum& s = sums_[i];
      if (s.count > most_kept)
        s = faded(s, most_kept);
      const int weight = std::max<int>(cells[i].quality, 0);
      s.quality = sum(s.quality, cells[i].quality);
      s.count = sum(s.count, one);
      s.weight = sum(s.weight, weight);
      s.ratio = sum(s.ratio, weight * cells[i].ratio >> 12);
    }
    if (any)
      first_filled_ = std::min(first_filled_, row);
  }
}

void StandingMap::fill_foot(const GroundCamera& view, int column, std::vector<std::int16_t>& standing) const {
  const auto cell = [&](int row) -> std::int16_t& { return standing[row * columns_ + column]; };
  for (int i = first_stood_; i < rows_;) {
    if (cell(i) <= least_standing) {
      ++i;
      continue;
    }
    const int first = i;
    int foot = i;
    std::int16_t most = 0;
    for (; i < rows_ && cell(i) > least_standing; ++i) {
      const Sum& sum = sums_[i * columns_ + column];
      const int ratio = sum.weight > 0 ? std::min(sum.ratio * one / sum.weight, most_ratio) : 0;
      const int down = below(view, 4 * i) + 384;
      foot = std::max(foot, ((down + down * ratio / one) + view.vanishing_row) >> 10);
      most = std::max(most, cell(i));
    }
    const int end = std::min({foot + 1, i + (i - first) + 1, rows_});
    for (; i < end; ++i)
      cell(i) = std::max(cell(i), most);
  }
}

/// Whether at least two of a standing cell's neighbours stand too.
bool StandingMap::has_company(int row, int column) const {
  int count = 0;
  for (int i = std::max(row - 1, 0); i <= std::min(row + 1, rows_ - 1); ++i)
    for (int j = std::max(column - 1, 0); j <= std::min(column + 1, columns_ - 1); ++j)
      count += stood_[i * columns_ + j];
  return count > 2;
}

void StandingMap::read(const GroundCamera& view, std::vector<std::int16_t>& standing) {
  standing.resize(sums_.size());
  first_stood_ = rows_;
  end_stood_ = 0;
  std::fill_n(standing.begin(), first_filled_ * columns_, std::int16_t{0});
  for (int i = first_filled_; i < rows_; ++i) {
    const int at = i * columns_;
    kernels::evidence_of_sums(&sums_[at].quality, columns_, &standing[at]);
    if (settle(columns_, &standing[at], &stood_[at])) {
      first_stood_ = std::min(first_stood_, i);
      end_stood_ = i + 1;
    }
  }
  if (first_stood_ >= end_stood_)
    return;
  std::fill(columns_stand_.begin(), columns_stand_.end(), std::uint8_t{0});
  for (int i = first_stood_; i < end_stood_; ++i)
    for (int j = 0; j < columns_; ++j) {
      const int at = i * columns_ + j;
      if (!stood_[at])
        continue;
      std::int16_t& value = standing[at];
      constexpr std::int16_t none = least_standing, some = least_standing + 1;
      if (has_company(i, j)) {
        value = std::max(value, some);
        columns_stand_[j] = 1;
      } else {
        value = std::min(value, none);
      }
    }
  for (int j = 0; j < columns_; ++j)
    if (columns_stand_[j])
      fill_foot(view, j, standing);
}

} // namespace terrainseg
