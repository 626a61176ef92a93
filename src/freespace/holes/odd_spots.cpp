// SPDX-License-Identifier: LGPL-2.1-or-later
#include "freespace/holes/odd_spots.hpp"

#include <algorithm>
#include <cstring>
#include <limits>

#include "base/fixed.hpp"
#include "base/tuning.hpp"
#include "kernels/cells.hpp"
#include "kernels/sides.hpp"

namespace terrainseg {
namespace {

/// Smallest distance from the horizon that sizes of boxes are computed with in the search far away. A box for
/// the true distance would hold few cells, mostly those of the object itself.
TERRAINSEG_TUNED(int, odd_spots, far_nearest_rows, 24);
/// Width of the boxes beside a block and half their height, in sixteenths of the distance. With 12 and 16
/// rendered trails have 0.08 points more error, snow 0.2; with 8 seven more of 390 obstacles on rendered
/// plains are called ground.
TERRAINSEG_TUNED(int, odd_spots, box_size, 10);
/// Rows of blocks that share the statistics of both sides: the boxes of neighbouring rows are nearly the
/// same. 1 to 4 differ by 0.03 points of error at most.
TERRAINSEG_TUNED(int, odd_spots, rows_together, 2);
/// Inverse of the smallest share of a side that must be ground.
TERRAINSEG_TUNED(int, odd_spots, least_side, 8);
/// Added to the deviation of luma and of both chromas, in grey levels.
constexpr std::array<int, 3> deviation_floor{5, 2, 2};
/// Height below a light cell in which a dark cell makes it a stone instead of paint, in 1/64 of the distance.
TERRAINSEG_TUNED(int, odd_spots, shadow_reach, 10);
TERRAINSEG_TUNED(int, odd_spots, dark_enough, 16); ///< Q4: one deviation
/// Q4 of a deviation: threshold of a cell, and of the mean in a seed's box. 40 instead of 48 finds a tenth
/// more of the obstacles on rendered trails and plains, but costs half a point of error on trails and 0.05
/// points in town.
TERRAINSEG_TUNED(int, odd_spots, odd_enough, 31);
TERRAINSEG_TUNED(int, odd_spots, seed_enough, 48);
/// Threshold of a seed far away. Share of the obstacles on rendered plains that are called ground with this
/// and far_nearest_rows: 32 % instead of 39 % by day, 53 % instead of 62 % at dusk, at a cost of 0.01 points
/// of error on the drives. With 12 rows the effect is half as large; a threshold of 42 gives more flicker.
TERRAINSEG_TUNED(int, odd_spots, far_seed_enough, 44);
/// Half the size of a seed's box, and the largest distance of a cell from a seed, in 1/64 of the distance.
/// For the first, 2 and 4 find as many obstacles, but with 4 twice as much of each is missed. For the second,
/// 8 includes ground around obstacles; 3 gives the same error, but calls a tenth more of the obstacles on
/// rendered plains ground.
TERRAINSEG_TUNED(int, odd_spots, seed_reach, 3);
TERRAINSEG_TUNED(int, odd_spots, growth_reach, 4);
/// Largest evidence of standing (Q8) of any cell in a flat spot, and of the spot's mean. Cells that move as
/// ground have down to -192. On 24 rendered trails these reduce the error from 5.02 to 4.82 %, with one of
/// 261 obstacles more called ground. With -5 and -20 the error is 4.68 %, but with five more, and six of 381
/// on plains.
TERRAINSEG_TUNED(int, odd_spots, flat_everywhere, -20);
TERRAINSEG_TUNED(int, odd_spots, flat_on_average, -40);

std::uint8_t largest(const std::uint8_t* values, std::size_t count) {
  std::uint8_t most = 0;
  for (std::size_t i = 0; i < count; ++i)
    most = std::max(most, values[i]);
  return most;
}

/// 4096 / sqrt(variance), Q12, within 1 %. The variance is Q8 and at least 2^10.
constexpr std::int16_t inverse_root(std::uint32_t variance_q8) {
  const int octaves = 16 * 256 - log2_q8(variance_q8) / 2, whole = octaves >> 8, part = octaves & 255;
  const int mantissa = 65536 + 256 * part - ((part * (256 - part) * 88) >> 8);
  return static_cast<std::int16_t>((mantissa << whole) >> 16);
}

/// Table over the highest nine bits of the variance, which is below 2^25. It has as many distinct values as
/// the logarithm.
constexpr int least_exponent = 10;
constexpr auto root_table = [] {
  std::array<std::int16_t, kernels::octaves_of_table * 256 + 1> table{};
  for (std::uint32_t i = 0; i + 1 < table.size(); ++i)
    table[i] = inverse_root((256 + i % 256) << (least_exponent - 8 + i / 256));
  return table;
}();

/// Elements per row in memory: whole vectors of cells from column -1 on. Column -1 is the last element of the
/// row above; cells outside the picture are not ground.
constexpr int stride_of(int width) {
  constexpr int vector = 32;
  return (width + vector) / vector * vector;
}

/// Size of a box at that distance, in blocks: its width, and its height above and below the cell.
int box_blocks(int distance) {
  return (box_size * distance / 16 + 1) >> 1;
}

/// Number of blocks of a side at that distance.
int side_reach(int distance) {
  return std::max(box_blocks(distance), 2);
}

} // namespace

// Distance from the horizon in rows.
int OddSpots::distance(int row) const {
  const int rows = row - horizon_row_;
  return is_far() ? std::max(rows, far_nearest_rows) : rows;
}

// Half the size of a box around a cell of that row, at least one cell.
int OddSpots::reach(int sixty_fourths, int row) const {
  return std::max((sixty_fourths * distance(row) + 32) >> 6, 1);
}

bool OddSpots::find(const Pyramid& pyramid, const ColorTransform& transform, const FreeSpaceCurves& curves,
                    const GroundView& view, std::vector<Hole>& holes) {
  view_ = view;
  width_ = pyramid.width(view.level);
  stride_ = stride_of(width_);
  height_ = pyramid.height(view.level);
  horizon_row_ = static_cast<int>(view.horizon) * height_ >> 8;
  if (view.rows > 0)
    height_ = std::min(height_, horizon_row_ + view.rows);
  blocks_x_ = stride_ >> 1;
  blocks_y_ = (height_ >> 1) + 1;
  const std::size_t size = stride_ * height_;
  odd_.resize(size + 1);
  odd_.back() = 0;
  spot_.assign(size, 0);
  holes.clear();
  // Reserved now, so that the first frame with a spot does not allocate.
  holes.reserve(size / 2);
  candidates_.reserve(stride_, height_);
  pieces_.reserve(stride_, height_);
  const bool any_ground =
      ground_.draw(curves, {view.level, width_, height_, view.level, view.ignored, stride_});
  first_ = std::max(ground_.first(), view.skipped > 0 ? horizon_row_ + view.skipped : 0);
  std::fill_n(odd_.begin(), std::min(first_, height_) * stride_ + 1, std::uint8_t{0});
  if (!any_ground || first_ >= height_)
    return false;
  read_cells(pyramid, transform);
  sum_blocks();
  const int most_reach = side_reach(is_far() ? std::max(view.rows, far_nearest_rows) : height_);
  for (auto& strip : strips_) // reserved for any position of the horizon
    strip.reserve(blocks_x_ + 1 + 2 * most_reach);
  nearest_dark_.assign(stride_, 30000);
  for (int block_row = blocks_y_ - 1; 2 * block_row >= first_; block_row -= rows_together) {
    const int top = std::max(2 * (block_row - rows_together) + 1, first_),
              bottom = std::min(2 * block_row, height_ - 1);
    find_extent(top, bottom);
    if (count_ > 0)
      compare_sides(block_row);
    for (int row = bottom; row >= top; --row)
      measure_row(row);
  }
  if (!mark_spots())
    return false;
  pieces_.find(spot_.data(), stride_, first_, height_);
  const bool any = keep_islands();
  list(holes);
  return any;
}

void OddSpots::read_cells(const Pyramid& pyramid, const ColorTransform& transform) {
  for (auto& plane : color_)
    plane.resize(odd_.size());
  for (int i = first_; i < height_; ++i) {
    const int row = i * stride_;
    transform_row(transform,
                  {pyramid.plane(view_.level, 0).row(i), pyramid.plane(view_.level, 1).row(i),
                   pyramid.plane(view_.level, 2).row(i)},
                  {&color_[0][row] + 1, &color_[1][row] + 1, &color_[2][row] + 1}, width_);
  }
}

// Block (I, J) holds the cells 2 I - 1 and 2 I of the columns 2 J - 1 and 2 J: its centre is a cell of the
// grid.
void OddSpots::sum_blocks() {
  const int stride = blocks_x_, first_block = (first_ + 1) >> 1;
  for (auto& sums : sums_) {
    sums.resize(stride * (blocks_y_ + 1));
    std::fill_n(&sums[first_block * stride], stride, 0u);
  }
  for (int I = first_block; I < blocks_y_; ++I) {
    const int above = I * stride, here = above + stride;
    for (auto& sums : sums_)
      std::copy_n(&sums[above], stride, &sums[here]);
    for (int i = std::max(2 * I - 1, first_); i <= std::min(2 * I, height_ - 1); ++i) {
      const int row = i * stride_;
      const std::uint8_t* const ground = ground_.row(i) - 1;
      kernels::add_blocks(ground, ground, blocks_x_, &sums_[0][here], nullptr);
      for (std::size_t c = 0; c < 3; ++c)
        kernels::add_blocks(&color_[c][row], ground, blocks_x_, &sums_[1 + c][here], &sums_[4 + c][here]);
    }
  }
}

// Prefix sums over the blocks of the rows `top` to `bottom`, padded by `pad` blocks on the left and right of
// the picture.
void OddSpots::sum_strips(int top, int bottom, int pad) {
  const int stride = blocks_x_;
  const int from = std::max(top, (first_ + 1) >> 1) * stride, to = bottom * stride;
  for (std::size_t s = 0; s < sum_count; ++s) {
    auto& strip = strips_[s];
    strip.resize(stride + 1 + 2 * pad);
    const std::uint32_t *const a = &sums_[s][from], *const b = a + (to - from);
    std::uint32_t* const out = strip.data() + pad;
    std::fill_n(strip.data(), pad + 1, 0u);
    kernels::run_differences(a, b, blocks_x_, out + 1);
    std::fill_n(out + stride + 1, pad, out[stride]);
  }
}

// The elements of the rows `top` to `bottom` that are searched: all ground and one cell on each side, in
// whole vectors.
void OddSpots::find_extent(int top, int bottom) {
  constexpr int vector = 32;
  std::ptrdiff_t from = stride_, last = 0;
  for (int row = top; row <= bottom; ++row) {
    const std::uint8_t* const ground = ground_.row(row) - 1;
    if (const auto* const first = static_cast<const std::uint8_t*>(std::memchr(ground, 1, stride_))) {
      from = std::min(from, first - ground);
      const auto* const end = static_cast<const std::uint8_t*>(memrchr(ground, 1, stride_));
      last = std::max(last, end - ground);
    }
  }
  from_ = std::max(static_cast<int>(from) - 1, 0) / vector * vector;
  const int end = std::min((static_cast<int>(last) + 1 + vector) / vector * vector, stride_);
  count_ = last == 0 ? 0 : end - from_;
}

void OddSpots::compare_sides(int I) {
  const int away = distance(2 * I), reach = side_reach(away), rows = std::max(box_blocks(away), 1);
  const int top = std::max(I - rows, 0), bottom = std::min(I + rows + 1, blocks_y_);
  const int first = from_ / 2, count = count_ / 2, blocks = blocks_x_;
  sum_strips(top, bottom, reach);
  // A side with too little ground has no result.
  const auto full = 4u * static_cast<std::uint32_t>(reach) * static_cast<std::uint32_t>(bottom - top);
  for (auto* values : {&box_cells_, &box_inverse_[0], &box_inverse_[1], &box_inverse_[2]})
    values->resize(blocks);
  const kernels::BoxRow boxes{box_cells_.data(), box_inverse_[0].data(), box_inverse_[1].data(),
                              box_inverse_[2].data(), reach};
  kernels::count_boxes(strips_[0].data() + first, (full + least_side - 1) / least_side, count, boxes);
  for (auto* values : {&block_left_, &block_right_, &block_deviation_})
    values->resize(blocks);
  variance_.resize(blocks);
  for (std::size_t k = 0; k < 3; ++k) {
    const auto floor = static_cast<std::uint32_t>(deviation_floor[k] * deviation_floor[k] << 8);
    kernels::compare_boxes(strips_[1 + k].data() + first, strips_[4 + k].data() + first, boxes, floor, count,
                           {block_left_.data(), block_right_.data(), variance_.data()});
    kernels::look_up_octaves(variance_.data(), root_table.data(), count, block_deviation_.data());
    const auto spread = [&](const std::vector<std::int16_t>& from, std::vector<std::int16_t>& to) {
      to.resize(2 * blocks);
      kernels::double_each(from.data(), count, to.data());
    };
    spread(block_left_, sides_.left[k]);
    spread(block_right_, sides_.right[k]);
    spread(block_deviation_, sides_.inverse[k]);
  }
}

void OddSpots::measure_row(int row) {
  const int cell = row * stride_;
  std::uint8_t* const odd = &odd_[cell];
  std::fill_n(odd, count_ > 0 ? from_ : stride_, std::uint8_t{0});
  if (count_ == 0)
    return;
  std::fill(odd + from_ + count_, odd + stride_, std::uint8_t{0});
  dark_.resize(stride_);
  for (std::size_t c = 0; c < 3; ++c) {
    deviation_[c].resize(stride_);
    kernels::deviations(&color_[c][cell + from_], sides_.left[c].data(), sides_.right[c].data(),
                        sides_.inverse[c].data(), count_, deviation_[c].data(),
                        c == 0 ? dark_.data() : nullptr);
  }
  // One more column on each side.
  shade_.resize(stride_ + 2);
  const kernels::DeviationRow deviations{deviation_[0].data(), deviation_[1].data(), deviation_[2].data(),
                                         ground_.row(row) - 1 + from_, dark_.data()};
  std::int16_t* const nearest_dark = nearest_dark_.data() + from_;
  kernels::note_dark(deviations, dark_enough, static_cast<std::int16_t>(row), count_, shade_.data(),
                     nearest_dark);
  const auto reached = static_cast<std::int16_t>(row + std::max(shadow_reach * distance(row) / 64, 1));
  kernels::oddness(deviations, nearest_dark, reached, most_oddness, count_, odd + from_);
}

// Marks the cells around seeds, where the mean oddness of the ground is high enough.
bool OddSpots::mark_spots() {
  const int enough = is_far() ? far_seed_enough : seed_enough;
  const int from = first_ * stride_;
  return largest(&odd_[from], odd_.size() - from) >= enough &&
         candidates_.mark(
             {odd_.data() + 1, ground_, stride_, height_, first_}, odd_enough, enough,
             [&](int row) { return reach(seed_reach, row); },
             [&](int row) { return reach(growth_reach, row); }, spot_.data());
}

// Removes the pieces of spots for which keep() is false. Returns false when none remain.
template <typename Keep> bool OddSpots::keep_pieces(Keep keep) {
  bool any = false;
  for (std::uint32_t piece = 0; piece < pieces_.count(); ++piece) {
    if (!is_spot(pieces_.first_run(piece)))
      continue;
    const bool kept = keep(piece);
    any |= kept;
    if (!kept)
      pieces_.each_run(piece, [&](const Pieces::Run& run) {
        std::fill_n(&spot_[cell_of(run.row, run.from)], run.to - run.from, std::uint8_t{0});
      });
  }
  return any;
}

// Removes pieces below a cell that is not ground: these belong to the boundary.
bool OddSpots::keep_islands() {
  return keep_pieces([&](std::uint32_t piece) {
    bool island = true;
    pieces_.each_run(piece, [&](const Pieces::Run& run) {
      island = island && (run.row <= first_ || ground_.is_whole(run.row - 1, run.from, run.to));
    });
    return island;
  });
}

// The foot of an obstacle also moves as the ground does. Therefore all cells of a flat spot must move so, and
// most of them clearly.
bool OddSpots::drop_flat(const FinerCells<std::int16_t>& motion, std::vector<Hole>& holes) {
  if (motion.values.empty())
    return true;
  const bool any = keep_pieces([&](std::uint32_t piece) {
    int cells = 0, sum = 0, most = std::numeric_limits<std::int16_t>::min();
    pieces_.each_run(piece, [&](const Pieces::Run& run) {
      for (int column = run.from; column < run.to; ++column) {
        const int moves = motion.nearest(column << view_.level, run.row << view_.level);
        ++cells;
        sum += moves;
        most = std::max(most, moves);
      }
    });
    return most > flat_everywhere || sum > flat_on_average * cells;
  });
  list(holes);
  return any;
}

void OddSpots::list(std::vector<Hole>& holes) const {
  holes.clear();
  for (const Pieces::Run& run : pieces_.runs())
    if (is_spot(run))
      holes.push_back(hole_of_cells(view_.level, run.row, run.from, run.to));
}

} // namespace terrainseg
