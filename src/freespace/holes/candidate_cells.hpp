// SPDX-License-Identifier: LGPL-2.1-or-later
// The few cells of a level that stand out, row by row, and boxes around them.
#pragma once

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <vector>

#include "freespace/holes/ground_outline.hpp"
#include "kernels/sides.hpp"
#include "terrainseg/frame.hpp"

namespace terrainseg {

/// Cells are numbered row by row. Allocates in start() only.
class CandidateCells {
 public:
  /// Empty, for rows `first` to `height` of `width` cells.
  void start(int width, int height, int first) {
    width_ = width;
    height_ = height;
    first_ = first;
    cells_.clear();
    // Now: not in the frame in which something is first found.
    cells_.reserve(static_cast<std::size_t>(width) * static_cast<std::size_t>(height));
    columns_.reserve(static_cast<std::size_t>(width));
    row_ends_.assign(static_cast<std::size_t>(height), 0);
  }

  /// Lists the cells whose value (0..127) is `least` or more.
  void list(const std::uint8_t* values, int least) {
    const auto w = static_cast<std::size_t>(width_);
    cells_.clear();
    for (int i = first_; i < height_; ++i) {
      const std::size_t at = static_cast<std::size_t>(i) * w;
      const std::uint8_t* const row = values + at;
      const auto take = [&](std::size_t j) {
        if (row[j] >= least)
          cells_.push_back(static_cast<std::uint32_t>(at + j));
      };
      std::size_t j = 0;
      for (; j + 8 <= w; j += 8)
        if (any_of_eight(row + j, least))
          for (std::size_t e = 0; e < 8; ++e)
            take(j + e);
      for (; j < w; ++j)
        take(j);
      row_ends_[static_cast<std::size_t>(i)] = cells_.size();
    }
  }

  const std::vector<std::uint32_t>& cells() const { return cells_; }

  /// seeds[cell] = 1 where the mean of `values` (0..127) over the ground in the box around it, which reaches
  /// reach_of(row), is `enough` or more, else 0. False where none is.
  template <typename Reach>
  bool seed(const std::uint8_t* values, const GroundOutline& ground, int enough, Reach reach_of,
            std::uint8_t* seeds) {
    bool any = false;
    sum_around(
        reach_of,
        [&](int row, int sign) {
          kernels::add_excess(values + cell_of(row), ground.row(row), enough, sign, width_, columns_.data());
        },
        [&](std::uint32_t cell, int excess) {
          seeds[cell] = excess >= 0;
          any |= excess >= 0;
        });
    return any;
  }

  /// near[cell] = 1 where a seed is in the box around it, else 0. All that are no candidates are no seeds.
  template <typename Reach> void grow(const std::uint8_t* seeds, Reach reach_of, std::uint8_t* near) {
    sum_around(
        reach_of,
        [&](int row, int sign) {
          const std::uint8_t* const of_row = seeds + cell_of(row);
          kernels::add_excess(of_row, of_row, 0, sign, width_, columns_.data());
        },
        [&](std::uint32_t cell, int count) { near[cell] = count > 0; });
  }

  /// Calls visit(row, first, end) for each stretch of a row whose cells are listed and `marked`.
  template <typename Visit> void each_stretch(const std::uint8_t* marked, Visit visit) const {
    std::size_t next = 0;
    for (int i = first_; i < height_; ++i) {
      const std::size_t at = static_cast<std::size_t>(i) * static_cast<std::size_t>(width_),
                        end = row_ends_[static_cast<std::size_t>(i)];
      while (next < end) {
        const std::uint32_t start = cells_[next++];
        if (!marked[start])
          continue;
        std::uint32_t stop = start + 1;
        for (; next < end && cells_[next] == stop && marked[stop]; ++next)
          ++stop;
        visit(i, static_cast<int>(start - at), static_cast<int>(stop - at));
      }
    }
  }

  /// `piece`: the cells that are `waiting` (1) and hang together with `start` (eight neighbours). None of
  /// them waits any longer.
  void take_piece(std::uint32_t start, std::uint8_t* waiting, std::vector<std::uint32_t>& piece) const {
    piece.clear();
    piece.push_back(start);
    waiting[start] = 0;
    const auto w = static_cast<std::uint32_t>(width_);
    for (std::size_t next = 0; next < piece.size(); ++next) {
      const int i = static_cast<int>(piece[next] / w), j = static_cast<int>(piece[next] % w);
      for (int y = std::max(i - 1, 0); y <= std::min(i + 1, height_ - 1); ++y)
        for (int x = std::max(j - 1, 0); x <= std::min(j + 1, width_ - 1); ++x) {
          const std::uint32_t other = static_cast<std::uint32_t>(y) * w + static_cast<std::uint32_t>(x);
          if (waiting[other]) {
            waiting[other] = 0;
            piece.push_back(other);
          }
        }
    }
  }

 private:
  std::size_t cell_of(int row) const {
    return static_cast<std::size_t>(row) * static_cast<std::size_t>(width_);
  }

  // Calls visit(cell, sum) for each, with the sum over the box around it that reaches reach_of(row).
  // `add(row, sign)` adds a row's values to columns_, or takes them off again: boxes move down with the rows
  // and never up, so that each row is added once.
  template <typename Reach, typename Add, typename Visit>
  void sum_around(Reach reach_of, Add add, Visit visit) {
    columns_.assign(static_cast<std::size_t>(width_), 0);
    int top = first_, bottom = first_;
    std::size_t next = 0;
    for (int i = first_; i < height_; ++i) {
      const std::size_t end = row_ends_[static_cast<std::size_t>(i)];
      if (next == end)
        continue;
      const int reach = reach_of(i), above = std::max(i - reach, first_),
                below = std::min(i + reach + 1, height_);
      if (above >= bottom) {
        std::fill(columns_.begin(), columns_.end(), 0);
        top = bottom = above;
      }
      for (; bottom < below; ++bottom)
        add(bottom, 1);
      for (; top < above; ++top)
        add(top, -1);
      const std::size_t at = static_cast<std::size_t>(i) * static_cast<std::size_t>(width_);
      int left = 0, right = 0, sum = 0;
      for (; next < end; ++next) {
        const int column = static_cast<int>(cells_[next] - at), from = std::max(column - reach, 0),
                  to = std::min(column + reach + 1, width_);
        if (from >= right) {
          left = right = from;
          sum = 0;
        }
        for (; right < to; ++right)
          sum += columns_[static_cast<std::size_t>(right)];
        for (; left < from; ++left)
          sum -= columns_[static_cast<std::size_t>(left)];
        visit(cells_[next], sum);
      }
    }
  }

  /// True where one of eight values, 0..127, is `least` or more.
  static bool any_of_eight(const std::uint8_t* values, int least) {
    constexpr std::uint64_t ones = 0x0101010101010101u;
    std::uint64_t eight = 0;
    std::memcpy(&eight, values, sizeof eight);
    return ((eight + ones * static_cast<std::uint64_t>(128 - least)) & (ones << 7)) != 0;
  }

  int width_ = 0, height_ = 0, first_ = 0;
  std::vector<std::uint32_t> cells_;
  std::vector<std::int32_t> columns_; ///< sums over a box's rows
  std::vector<std::size_t> row_ends_; ///< of each row's cells
};

} // namespace terrainseg
