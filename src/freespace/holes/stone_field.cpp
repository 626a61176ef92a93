// SPDX-License-Identifier: LGPL-2.1-or-later
#include "freespace/holes/stone_field.hpp"

#include <algorithm>

#include "base/tuning.hpp"
#include "kernels/sides.hpp"

namespace terrainseg {
namespace {

/// Width and height of a block in cells. The ground is measured in every fourth row of a block.
constexpr int block_shift = 4, block = 1 << block_shift, row_step = 4;
/// Reach of the box around a block in 1/16 of the distance.
TERRAINSEG_TUNED(int, stone_field, box_reach, 8);
constexpr int most_reach = 15; ///< blocks, within which the sums of squares do not overflow
/// Inverse of the smallest share of a box that must be ground.
TERRAINSEG_TUNED(int, stone_field, least_ground, 4);
/// Cells beyond this many deviations do not count as ground; and the smallest deviation, in grey levels.
TERRAINSEG_TUNED(int, stone_field, trim, 2);
TERRAINSEG_TUNED(int, stone_field, deviation_floor, 5);
/// Q4 of a deviation: threshold of a cell, and of the mean in a seed's box.
TERRAINSEG_TUNED(int, stone_field, odd_enough, 24);
TERRAINSEG_TUNED(int, stone_field, seed_enough, 31);
/// Half the size of a seed's box and of the box in which pieces grow around a seed, in 1/1024 of the
/// distance.
TERRAINSEG_TUNED(int, stone_field, seed_reach, 20);
/// Largest width and height of a stone in 1/64 of the distance, and the smallest deviation of its clearest
/// cell.
TERRAINSEG_TUNED(int, stone_field, stone_size, 44);
TERRAINSEG_TUNED(int, stone_field, stone_peak, 48);
/// The same limits for the stones that prove a field.
TERRAINSEG_TUNED(int, stone_field, sure_size, 18);
TERRAINSEG_TUNED(int, stone_field, sure_peak, 80);
/// A field has at least this many of them, and they have at least a sixth of all differing cells.
TERRAINSEG_TUNED(int, stone_field, least_sure, 16);
TERRAINSEG_TUNED(int, stone_field, least_share, 6);
/// Number of frames to skip after each successive search without a result.
constexpr std::array<int, 4> pauses{0, 2, 4, 8};

std::uint32_t root(std::uint32_t square) {
  std::uint32_t result = 0;
  for (std::uint32_t bit = 1u << 15; bit != 0; bit >>= 1)
    if ((result + bit) * (result + bit) <= square)
      result += bit;
  return result;
}

template <typename Value> void spread(const Value* values, int width, std::vector<Value>& cells) {
  cells.resize(width);
  for (int x = 0; x < width; x += block)
    std::fill_n(&cells[x], std::min(block, width - x), values[x >> block_shift]);
}

} // namespace

/// Properties of a connected piece.
struct StoneField::Piece {
  int left, right, top, bottom, cells = 0, peak = 0;
  bool inside = true; ///< surrounded by ground
};

// Distance from the horizon in rows.
int StoneField::distance(int row) const {
  return row - horizon_row_;
}

bool StoneField::find(const GrayView& luma, const FreeSpaceCurves& curves, const StoneView& view,
                      Watch& watch, std::vector<Hole>& holes) {
  holes.clear();
  for (const Run& run : runs_) // only these cells are marked
    std::fill_n(&oddness_[cell_of(run.row, run.from)], run.to - run.from, std::uint8_t{0});
  runs_.clear();
  if (watch.frames_to_wait > 0) {
    --watch.frames_to_wait;
    return false;
  }
  const bool in_field = look(luma, curves, view);
  watch.looks_in_vain = in_field ? 0 : std::min(watch.looks_in_vain + 1, pauses.size() - 1);
  watch.frames_to_wait = pauses[watch.looks_in_vain];
  holes.reserve(runs_.capacity());
  for (const Run& run : runs_)
    holes.push_back(hole_of_cells(view_.level, run.row, run.from, run.to));
  return in_field;
}

bool StoneField::look(const GrayView& luma, const FreeSpaceCurves& curves, const StoneView& view) {
  view_ = view;
  width_ = luma.width;
  height_ = luma.height;
  horizon_row_ = static_cast<int>(view.horizon) * height_ >> 8;
  const int size = width_ * height_;
  for (auto* cells : {&deviation_, &marked_, &oddness_})
    cells->resize(size);
  // Reserved now, so that the first frame with a stone does not allocate.
  candidates_.reserve(width_, height_);
  pieces_.reserve(width_, height_);
  runs_.reserve(size / 2);
  const bool any_ground =
      ground_.draw(curves, {view.level, width_, height_, view.column_spacing, view.ignored, width_});
  first_ = std::min(ground_.first(), height_);
  if (!any_ground)
    return false;
  measure_ground(luma.plane);
  measure_deviations(luma.plane);
  const auto reach_of = [&](int row) { return reach(row); };
  const std::uint8_t* const deviations = deviation_.data();
  const CandidateCells::View cells{deviations, ground_, width_, height_, first_};
  int clear = 0;
  for (int i = cells.cell_of(first_); i < size; i += 255) {
    std::uint8_t some = 0;
    for (int j = i; j < std::min(i + 255, size); ++j)
      some = static_cast<std::uint8_t>(some + (deviations[j] >= sure_peak));
    clear += some;
  }
  if (clear < least_sure) // each piece has at least one such cell
    return false;
  if (!candidates_.mark(cells, odd_enough, seed_enough, reach_of, reach_of, marked_.data()))
    return false;
  pieces_.find(marked_.data(), width_, first_, height_);
  if (!list_stones()) {
    runs_.clear();
    return false;
  }
  for (const Run& run : runs_)
    std::fill_n(&oddness_[cell_of(run.row, run.from)], run.to - run.from, run.odd);
  return true;
}

int StoneField::block_reach(int block_row) const {
  const int away = distance((block_row << block_shift) + block / 2);
  return std::clamp((box_reach * away / 16 + block / 2) >> block_shift, 1, most_reach);
}

// Sums per block over the measured rows, as integrals. `add_row(row)` adds a row to the columns.
template <typename AddRow> void StoneField::sum_blocks(AddRow add_row) {
  const int columns = width_, stride = blocks_x_ + 1;
  for (auto& sums : blocks_) {
    sums.resize(stride * (blocks_y_ + 1)); // large enough for any first row of the ground
    std::fill_n(sums.begin(), stride, 0u);
  }
  for (int I = first_block_; I < blocks_y_; ++I) {
    for (auto* values : {&cells_, &sums_, &distances_})
      values->assign(columns, 0);
    squares_.assign(columns, 0);
    const int top = I << block_shift, bottom = std::min(top + block, height_);
    for (int i = top; i < bottom; i += row_step)
      if (i >= first_)
        add_row(i);
    const int above = (I - first_block_) * stride;
    std::array<std::uint32_t, 3> run{};
    for (auto& sums : blocks_)
      sums[above + stride] = 0;
    for (int b = 0; b < blocks_x_; ++b) {
      for (int x = b << block_shift; x < std::min((b + 1) << block_shift, columns); ++x) {
        run[0] += cells_[x];
        run[1] += sums_[x];
        run[2] += squares_[x] + distances_[x]; // one of the two is 0
      }
      for (std::size_t s = 0; s < 3; ++s)
        blocks_[s][above + stride + b + 1] = blocks_[s][above + b + 1] + run[s];
    }
  }
}

// Of the box around a block: the number of counted cells, their sum, and the sum of their squares or
// distances.
std::array<std::uint32_t, 3> StoneField::box_around(int block_row, int column, int reach) const {
  const int stride = blocks_x_ + 1, top = std::max(block_row - reach - first_block_, 0) * stride,
            bottom = (std::min(block_row + reach + 1, blocks_y_) - first_block_) * stride,
            left = std::max(column - reach, 0), right = std::min(column + reach + 1, blocks_x_);
  std::array<std::uint32_t, 3> box{};
  for (std::size_t s = 0; s < 3; ++s) {
    const std::uint32_t* const sums = blocks_[s].data();
    box[s] = sums[bottom + right] - sums[top + right] - sums[bottom + left] + sums[top + left];
  }
  return box;
}

// Computes per block the mean of the surrounding ground and its mean deviation, in two passes. The second
// pass leaves out cells beyond `trim` deviations of the first.
void StoneField::measure_ground(const Plane& luma) {
  blocks_x_ = (width_ + block - 1) >> block_shift;
  blocks_y_ = (height_ + block - 1) >> block_shift;
  first_block_ = first_ >> block_shift;
  middle_.resize(blocks_x_ * blocks_y_);
  reach_.resize(middle_.size());
  scale_.resize(middle_.size());
  const auto each_block = [&](auto visit) {
    for (int I = first_block_; I < blocks_y_; ++I) {
      const int reach = block_reach(I);
      for (int J = 0; J < blocks_x_; ++J)
        visit(I * blocks_x_ + J, box_around(I, J, reach), reach);
    }
  };

  sum_blocks([&](int i) {
    kernels::add_moments(luma.row(i), ground_.row(i), width_, {cells_.data(), sums_.data(), squares_.data()});
  });
  each_block([&](int b, const std::array<std::uint32_t, 3>& box, int reach) {
    const auto [n, sum, squares] = box;
    const auto side = static_cast<std::uint32_t>(2 * reach + 1) << block_shift;
    reach_[b] = 0; // too little ground: no result
    if (least_ground * row_step * n < side * side)
      return;
    // Relative to 128, so that the sums of squares do not overflow.
    const std::int64_t count = n, off = static_cast<std::int64_t>(sum) - 128 * count;
    const auto variance_q8 =
        static_cast<std::uint32_t>(256 * (squares * count - off * off) / (count * count));
    middle_[b] = static_cast<std::uint8_t>((sum + n / 2) / n);
    reach_[b] = static_cast<std::uint8_t>(
        std::clamp<std::uint32_t>(trim * root(variance_q8) >> 4, trim * deviation_floor, 255));
  });

  sum_blocks([&](int i) {
    if (i % block == 0 || i < first_ + row_step) {
      const int at = (i >> block_shift) * blocks_x_;
      spread(&middle_[at], width_, row_middle_);
      spread(&reach_[at], width_, row_reach_);
    }
    kernels::add_near(luma.row(i), ground_.row(i), row_middle_.data(), row_reach_.data(), width_,
                      {cells_.data(), sums_.data(), distances_.data()});
  });
  each_block([&](int b, const std::array<std::uint32_t, 3>& box, int) {
    const auto [n, sum, distances] = box;
    scale_[b] = 0;
    if (reach_[b] == 0 || n == 0)
      return;
    middle_[b] = static_cast<std::uint8_t>((sum + n / 2) / n);
    // For a normal distribution the standard deviation is 5/4 of the mean deviation.
    const std::uint32_t deviation_q4 = std::max<std::uint32_t>(20 * distances / n, 16 * deviation_floor);
    scale_[b] = static_cast<std::uint16_t>((16 << 12) / deviation_q4);
  });
}

void StoneField::measure_deviations(const Plane& luma) {
  for (int i = first_; i < height_; ++i) {
    if (i % block == 0 || i == first_) {
      const int at = (i >> block_shift) * blocks_x_;
      spread(&middle_[at], width_, row_middle_);
      spread(&scale_[at], width_, row_scale_);
    }
    kernels::deviations_from(luma.row(i), ground_.row(i), row_middle_.data(), row_scale_.data(), width_,
                             &deviation_[i * width_]);
  }
}

// Half the size of the box around a cell of that row.
int StoneField::reach(int row) const {
  return std::max((seed_reach * distance(row) + 512) >> 10, 1);
}

StoneField::Piece StoneField::look_at(std::uint32_t number) const {
  Piece piece{width_, 0, height_, 0};
  pieces_.each_run(number, [&](const Pieces::Run& run) {
    const std::uint8_t* const deviations = &deviation_[cell_of(run.row, 0)];
    piece.left = std::min(piece.left, run.from);
    piece.right = std::max(piece.right, run.to - 1);
    piece.top = std::min(piece.top, run.row);
    piece.bottom = run.row;
    piece.cells += run.to - run.from;
    piece.peak = std::max<int>(piece.peak, *std::max_element(deviations + run.from, deviations + run.to));
    piece.inside = piece.inside && run.row > first_ && ground_.is_whole(run.row - 1, run.from, run.to);
  });
  piece.inside &= piece.left > 0 && piece.right < width_ - 1 && piece.bottom < height_ - 1;
  return piece;
}

// Sizes are compared with the distance of the piece's lower end from the horizon.
bool StoneField::is_stone(const Piece& piece, int most) const {
  const int size = std::max(piece.right - piece.left, piece.bottom - piece.top) + 1;
  return piece.inside && 64 * size <= most * distance(piece.bottom);
}

// Lists the rows of all stones. Returns false when they are not a field.
bool StoneField::list_stones() {
  int sure = 0;
  std::int64_t sure_cells = 0, all_cells = 0;
  for (std::uint32_t number = 0; number < pieces_.count(); ++number) {
    const Piece piece = look_at(number);
    all_cells += piece.cells;
    if (piece.peak >= sure_peak && is_stone(piece, sure_size)) {
      ++sure;
      sure_cells += piece.cells;
    }
    if (piece.peak >= stone_peak && is_stone(piece, stone_size))
      list_rows(number, static_cast<std::uint8_t>(std::min(piece.peak, most_oddness)));
  }
  return sure >= least_sure && least_share * sure_cells >= all_cells;
}

// Lists each row of a piece between its outermost cells: between the lit and the shaded side of a stone the
// luma equals the ground's.
void StoneField::list_rows(std::uint32_t number, std::uint8_t odd) {
  const std::size_t first = runs_.size();
  pieces_.each_run(number, [&](const Pieces::Run& run) {
    if (runs_.size() > first && runs_.back().row == run.row)
      runs_.back().to = static_cast<std::uint16_t>(run.to);
    else
      runs_.push_back({static_cast<std::uint16_t>(run.row), static_cast<std::uint16_t>(run.from),
                       static_cast<std::uint16_t>(run.to), odd});
  });
}

} // namespace terrainseg
