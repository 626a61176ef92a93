// SPDX-License-Identifier: LGPL-2.1-or-later
// Finds the cells of a level that differ from the ground around seeds, and their connected pieces.
#pragma once

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <span>
#include <vector>

#include "freespace/holes/hole.hpp"
#include "kernels/sides.hpp"

namespace terrainseg {

inline constexpr int most_oddness = 96; ///< Q4 of a deviation: the largest oddness of a cell

/// Marks cells around seeds. Allocates in reserve() only.
class CandidateCells {
 public:
  /// Cells of the rows `first` to `height`, with `width` elements in a row.
  struct View {
    const std::uint8_t* values; ///< 0..127
    const GroundOutline& ground;
    int width = 0, height = 0, first = 0;

    int cell_of(int row) const { return row * width; }
  };

  void reserve(int width, int height) {
    seeds_.resize(width * height);
    margin_ = std::max(height, least_margin); // for the largest reach
    columns_.reserve(width + 2 * margin_);
  }

  /// Sets marks[cell] = 1 where the value is at least `least` and the box that extends growth_reach(row)
  /// cells in each direction contains a seed, otherwise 0. A seed is a cell with such a value where the mean
  /// over the ground in the box of seed_reach(row) cells is at least `enough`. Returns false when there is
  /// none; `marks` is then not written.
  template <typename SeedReach, typename GrowthReach>
  bool mark(const View& view, int least, int enough, SeedReach seed_reach, GrowthReach growth_reach,
            std::uint8_t* marks) {
    const auto add_excess = [&](int row, int sign) {
      kernels::add_excess(view.values + view.cell_of(row), view.ground.row(row), enough, sign, view.width,
                          columns());
    };
    const auto add_seeds = [&](int row, int sign) {
      const std::uint8_t* const seeds = &seeds_[view.cell_of(row)];
      kernels::add_excess(seeds, seeds, 0, sign, view.width, columns());
    };
    return mark_boxes(view, seed_reach, add_excess, least, 0, seeds_.data()) &&
           mark_boxes(view, growth_reach, add_seeds, least, 1, marks);
  }

 private:
  static constexpr int least_margin = 4; ///< the search far away reaches two cells in a single row too

  std::int16_t* columns() { return columns_.data() + margin_; }

  // Marks the cells with a value of at least `least` around which the box has at least `least_sum`. Returns
  // whether there are any. `add(row, sign)` adds a row to columns_ or subtracts it. Boxes only move down with
  // the rows, so each row is added once.
  template <typename Reach, typename Add>
  bool mark_boxes(const View& view, Reach reach_of, Add add, int least, std::int16_t least_sum,
                  std::uint8_t* marks) {
    columns_.assign(view.width + 2 * margin_, 0);
    bool any = false;
    int top = view.first, bottom = view.first;
    for (int i = view.first; i < view.height; ++i) {
      const int reach = reach_of(i);
      for (; bottom < std::min(i + reach + 1, view.height); ++bottom)
        add(bottom, 1);
      for (; top < i - reach; ++top)
        add(top, -1);
      any |= kernels::mark_boxes({columns(), reach, least_sum}, view.values + view.cell_of(i), least,
                                 view.width, marks + view.cell_of(i));
    }
    return any;
  }

  std::vector<std::uint8_t> seeds_;
  std::vector<std::int16_t> columns_; ///< sums over the rows of a box, and zeros on both sides
  int margin_ = 0;                    ///< number of these zeros on each side
};

/// Connected pieces (eight neighbours) of marked cells, as runs of cells of a row. Allocates in reserve()
/// only.
class Pieces {
 public:
  struct Run {
    int row, from, to;   ///< in cells; `to` is exclusive
    std::uint32_t piece; ///< number of its piece
    std::uint32_t next;  ///< index of the piece's next run; its own in the last one
  };

  void reserve(int width, int height) {
    const int most = (width + 1) / 2 * height;
    for (auto* indices : {&parents_, &firsts_, &lasts_})
      indices->reserve(most);
    runs_.reserve(most);
  }

  /// Finds the pieces in the rows `first` to `height` of `width` elements, as many as were reserved. Their
  /// numbers are in the order of their first cells.
  void find(const std::uint8_t* marks, int width, int first, int height) {
    runs_.clear();
    parents_.clear();
    std::uint32_t above = 0; // the first run of the row above
    for (int i = first; i < height; ++i) {
      const auto here = static_cast<std::uint32_t>(runs_.size());
      list_runs(marks + i * width, width, i);
      join_rows(above, here);
      above = here;
    }
    number_pieces();
  }

  std::span<const Run> runs() const { return runs_; } ///< row by row
  std::uint32_t count() const { return static_cast<std::uint32_t>(firsts_.size()); }

  const Run& first_run(std::uint32_t piece) const { return runs_[firsts_[piece]]; }

  /// Calls visit(run) for each run of a piece, row by row.
  template <typename Visit> void each_run(std::uint32_t piece, Visit visit) const {
    std::uint32_t run = firsts_[piece];
    for (visit(runs_[run]); runs_[run].next != run; visit(runs_[run]))
      run = runs_[run].next;
  }

 private:
  void list_runs(const std::uint8_t* marks, int width, int row) {
    const auto next = [&](int from, int mark) {
      const void* const found = std::memchr(marks + from, mark, width - from);
      return found ? static_cast<int>(static_cast<const std::uint8_t*>(found) - marks) : width;
    };
    for (int from = next(0, 1); from < width;) {
      const int to = next(from, 0);
      parents_.push_back(static_cast<std::uint32_t>(runs_.size()));
      runs_.push_back({row, from, to, 0, 0});
      from = next(to, 1);
    }
  }

  // Joins the runs from `here` on with those of the row above that they touch, also at corners.
  void join_rows(std::uint32_t above, std::uint32_t here) {
    for (std::uint32_t a = above, b = here; a < here && b < runs_.size();) {
      if (runs_[a].row + 1 == runs_[b].row && runs_[a].from <= runs_[b].to && runs_[b].from <= runs_[a].to) {
        const std::uint32_t one = root_of(a), other = root_of(b);
        parents_[std::max(one, other)] = std::min(one, other);
      }
      runs_[a].to < runs_[b].to ? ++a : ++b;
    }
  }

  std::uint32_t root_of(std::uint32_t run) {
    for (; parents_[run] != run; run = parents_[run])
      parents_[run] = parents_[parents_[run]];
    return run;
  }

  // A root is the first run of its piece.
  void number_pieces() {
    firsts_.clear();
    lasts_.clear();
    for (std::uint32_t run = 0; run < runs_.size(); ++run) {
      const std::uint32_t root = root_of(run);
      if (root == run) {
        runs_[run].piece = count();
        firsts_.push_back(run);
        lasts_.push_back(run);
      }
      const std::uint32_t piece = runs_[run].piece = runs_[root].piece;
      runs_[lasts_[piece]].next = run;
      runs_[run].next = run;
      lasts_[piece] = run;
    }
  }

  std::vector<Run> runs_;
  std::vector<std::uint32_t> parents_;        ///< of each run, one of its piece that is not behind it
  std::vector<std::uint32_t> firsts_, lasts_; ///< runs of each piece
};

} // namespace terrainseg
