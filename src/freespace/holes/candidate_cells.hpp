// SPDX-License-Identifier: LGPL-2.1-or-later
// A sparse list of the cells of a level that differ from the ground, row by row, with sums over boxes around
// them.
#pragma once

#include <algorithm>
#include <bit>
#include <cstdint>
#include <cstring>
#include <span>
#include <vector>

#include "freespace/holes/hole.hpp"
#include "kernels/sides.hpp"
#include "terrainseg/frame.hpp"

namespace terrainseg {

/// Cells are numbered row by row. Allocates only in start().
class CandidateCells {
 public:
  /// Clears the list for rows `first` to `height` of `width` cells.
  void start(int width, int height, int first) {
    width_ = width;
    height_ = height;
    first_ = first;
    count_ = 0;
    // All cells may be candidates; no later frame of this size allocates.
    if (const std::size_t all = static_cast<std::size_t>(width) * static_cast<std::size_t>(height);
        cells_.size() < all)
      cells_.resize(all);
    columns_.reserve(static_cast<std::size_t>(width));
    row_ends_.assign(static_cast<std::size_t>(height), 0);
    has_seeds_.reserve(static_cast<std::size_t>(height));
  }

  /// Lists the cells whose value (0..127) is at least `least`.
  void list(const std::uint8_t* values, int least) {
    const auto w = static_cast<std::size_t>(width_);
    std::uint32_t* next = cells_.data();
    for (int i = first_; i < height_; ++i) {
      const std::size_t at = static_cast<std::size_t>(i) * w;
      const std::uint8_t* const row = values + at;
      std::size_t j = 0;
      for (; j + 8 <= w; j += 8)
        for (std::uint64_t found = enough_of_eight(row + j, least); found; found &= found - 1)
          *next++ =
              static_cast<std::uint32_t>(at + j) + static_cast<std::uint32_t>(std::countr_zero(found)) / 8;
      for (; j < w; ++j)
        if (row[j] >= least)
          *next++ = static_cast<std::uint32_t>(at + j);
      row_ends_[static_cast<std::size_t>(i)] = static_cast<std::size_t>(next - cells_.data());
    }
    count_ = static_cast<std::size_t>(next - cells_.data());
  }

  std::span<const std::uint32_t> cells() const { return {cells_.data(), count_}; }

  /// Sets seeds[cell] = 1 where the mean of `values` (0..127) over the ground in the surrounding box is at
  /// least `enough`, otherwise 0. The box extends reach_of(row) cells in each direction. Returns false when
  /// there is no seed.
  template <typename Reach>
  bool seed(const std::uint8_t* values, const GroundOutline& ground, int enough, Reach reach_of,
            std::uint8_t* seeds) {
    has_seeds_.assign(static_cast<std::size_t>(height_), 0);
    sum_around(
        reach_of,
        [&](int row, int sign) {
          kernels::add_excess(values + cell_of(row), ground.row(row), enough, sign, width_, columns_.data());
        },
        [&](int row, std::uint32_t cell, int excess) {
          seeds[cell] = excess >= 0;
          has_seeds_[static_cast<std::size_t>(row)] |= seeds[cell];
        });
    return std::find(has_seeds_.begin(), has_seeds_.end(), 1) != has_seeds_.end();
  }

  /// Sets near[cell] = 1 where the surrounding box contains a seed of seed(), otherwise 0.
  template <typename Reach> void grow(const std::uint8_t* seeds, Reach reach_of, std::uint8_t* near) {
    sum_around(
        reach_of,
        [&](int row, int sign) {
          const std::uint8_t* const of_row = seeds + cell_of(row);
          if (has_seeds_[static_cast<std::size_t>(row)])
            kernels::add_excess(of_row, of_row, 0, sign, width_, columns_.data());
        },
        [&](int, std::uint32_t cell, int count) { near[cell] = count > 0; });
  }

  /// Calls visit(row, first, end) for each run of listed cells of a row that are `marked`.
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

  /// Collects in `piece` the cells with `waiting` = 1 that are connected to `start` (eight neighbours), and
  /// sets their `waiting` to 0.
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

  // Calls visit(row, cell, sum) for each listed cell with the sum over the surrounding box, which extends
  // reach_of(row) cells. `add(row, sign)` adds a row's values to columns_ or subtracts them. Boxes only move
  // down with the rows, so each row is added once.
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
        visit(i, cells_[next], sum);
      }
    }
  }

  /// The highest bit of byte k, from the lowest byte on, is set where value k (0..127) of eight is at least
  /// `least`.
  static std::uint64_t enough_of_eight(const std::uint8_t* values, int least) {
    constexpr std::uint64_t ones = 0x0101010101010101u;
    std::uint64_t eight = 0;
    std::memcpy(&eight, values, sizeof eight);
    if constexpr (std::endian::native == std::endian::big)
      eight = __builtin_bswap64(eight);
    return (eight + ones * static_cast<std::uint64_t>(128 - least)) & (ones << 7);
  }

  int width_ = 0, height_ = 0, first_ = 0;
  std::vector<std::uint32_t> cells_; ///< the first count_ are listed
  std::size_t count_ = 0;
  std::vector<std::int16_t> columns_;   ///< sums over the rows of a box, of which there are at most 255
  std::vector<std::size_t> row_ends_;   ///< end of each row in cells_
  std::vector<std::uint8_t> has_seeds_; ///< of each row
};

} // namespace terrainseg
