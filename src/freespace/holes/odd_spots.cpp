// SPDX-License-Identifier: LGPL-2.1-or-later
#include "freespace/holes/odd_spots.hpp"

#include <algorithm>
#include <limits>

#include "base/fixed_log.hpp"
#include "base/tuning.hpp"
#include "kernels/cells.hpp"
#include "kernels/sides.hpp"

namespace terrainseg {
namespace {

/// No distance from the horizon is less, nor where only what is far away is searched: a box of its own
/// distance holds few cells there, and those of the thing itself.
TERRAINSEG_TUNED(int, odd_spots, nearest_rows, 2);
TERRAINSEG_TUNED(int, odd_spots, far_nearest_rows, 24);
/// Boxes beside a block: width and height in sixteenths of the distance. 9..16 and 12..16 are as good.
TERRAINSEG_TUNED(int, odd_spots, box_width, 12);
TERRAINSEG_TUNED(int, odd_spots, box_height, 16);
/// Share of a side that must be ground for it to say anything, as its inverse.
TERRAINSEG_TUNED(int, odd_spots, least_side, 8);
/// Added to the deviation of luma and of both chromas, grey levels.
constexpr std::array<int, 3> deviation_floor{5, 2, 2};
/// Rows below light in which something dark makes it a stone, sixty-fourths of the distance.
TERRAINSEG_TUNED(int, odd_spots, shadow_reach, 10);
TERRAINSEG_TUNED(int, odd_spots, dark_enough, 16); ///< Q4: one deviation
TERRAINSEG_TUNED(int, odd_spots, most_oddness, 96);
/// Q4 of a deviation: of a cell, and of the mean of a box around a seed. 40 finds a tenth more of the things
/// that stand on rendered trails and plains, for half a point of error on trails and 0.05 in town.
TERRAINSEG_TUNED(int, odd_spots, odd_enough, 31);
TERRAINSEG_TUNED(int, odd_spots, seed_enough, 48);
/// Of a seed far away. With this and far_nearest_rows 32 % of the things on rendered plains are called ground
/// in place of 39 by day, 53 in place of 62 at dusk, for 0.01 of error on the drives. 12 rows find half of
/// that, 42 flickers more.
TERRAINSEG_TUNED(int, odd_spots, far_seed_enough, 44);
/// Half the size of the boxes around seeds, and around cells that a seed must be near to, sixty-fourths of
/// the distance. Of the former 2 or 4 find as many things; at 4 twice as much of each stays unseen. Of the
/// latter 8 takes in the ground around things; 3 is as good in error, but a tenth more of the things on
/// rendered plains is called ground.
TERRAINSEG_TUNED(int, odd_spots, seed_reach, 3);
TERRAINSEG_TUNED(int, odd_spots, growth_reach, 4);
/// Most evidence of something that stands (Q8) that any cell of a flat spot has, and most of their mean; what
/// moves as ground has down to -192. On 24 rendered trails 5.02 -> 4.82 % error, with one of 261 things more
/// called ground. With -5 and -20 4.68 %, but five more, and six of 381 on plains.
TERRAINSEG_TUNED(int, odd_spots, flat_everywhere, -20);
TERRAINSEG_TUNED(int, odd_spots, flat_on_average, -40);

std::uint8_t largest(const std::uint8_t* values, std::size_t count) {
  std::uint8_t most = 0;
  for (std::size_t i = 0; i < count; ++i)
    most = std::max(most, values[i]);
  return most;
}

/// 4096 / sqrt(variance), Q12, to 1 %; variance Q8, at least 2^10.
constexpr std::int16_t inverse_root(std::uint32_t variance_q8) {
  const int octaves = 16 * 256 - log2_q8(variance_q8) / 2, whole = octaves >> 8, part = octaves & 255;
  const int mantissa = 65536 + 256 * part - ((part * (256 - part) * 88) >> 8);
  return static_cast<std::int16_t>((mantissa << whole) >> 16);
}

/// It has as many values as the logarithm: of the highest nine bits of the variance, which is below 2^25.
constexpr int least_exponent = 10;
constexpr auto root_table = [] {
  std::array<std::int16_t, kernels::octaves_of_table * 256 + 1> table{};
  for (std::uint32_t i = 0; i + 1 < table.size(); ++i)
    table[i] = inverse_root((256 + i % 256) << (least_exponent - 8 + i / 256));
  return table;
}();

/// Cells of a row in memory: whole vectors of cells, and of blocks behind the first, which has one column.
/// Those beyond the picture are not ground.
constexpr int stride_of(int width) {
  constexpr int vector = 16;
  return (width + vector - 2) / vector * vector + 1;
}

/// Blocks of a side at that distance.
constexpr int side_reach(int distance) {
  return std::max((box_width * distance / 16 + 1) >> 1, 2);
}

} // namespace

// Rows below the horizon.
int OddSpots::distance(int row) const {
  return std::max(row - horizon_row_, is_far() ? far_nearest_rows : nearest_rows);
}

// Half of a box around a cell of that row, at least a cell.
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
  blocks_x_ = (stride_ >> 1) + 1;
  blocks_y_ = (height_ >> 1) + 1;
  const std::size_t size = static_cast<std::size_t>(stride_) * static_cast<std::size_t>(height_);
  odd_.resize(size);
  for (const std::uint32_t cell : candidates_.cells()) // no others belong to spots
    spot_[cell] = 0;
  spot_.resize(size);
  holes.clear();
  holes.reserve(size / 2);
  queue_.reserve(size); // now: not in the frame in which something is first found
  seed_.resize(size);
  const bool any_ground = ground_.draw(
      curves, {view.level, width_, height_, view.column_level, view.level, view.ignored, stride_});
  first_ = ground_.first();
  candidates_.start(stride_, height_, first_);
  std::fill_n(odd_.begin(), std::min(first_, height_) * stride_, std::uint8_t{0});
  if (!any_ground)
    return false;
  read_cells(pyramid, transform);
  sum_blocks();
  const int most_reach = side_reach(is_far() ? std::max(view.rows, far_nearest_rows) : height_);
  for (auto& strip : strips_) // however high the horizon comes to lie
    strip.reserve(static_cast<std::size_t>(blocks_x_ + 1 + 2 * most_reach));
  nearest_dark_.assign(static_cast<std::size_t>(stride_), 30000);
  for (int block_row = blocks_y_ - 1; 2 * block_row >= first_; --block_row) {
    compare_sides(block_row);
    for (int row = std::min(2 * block_row, height_ - 1); row >= std::max(2 * block_row - 1, first_); --row)
      measure_row(row);
  }
  if (!seed())
    return false;
  candidates_.grow(
      seed_.data(), [&](int row) { return reach(growth_reach, row); }, spot_.data());
  const bool any = keep_islands();
  list(holes);
  return any;
}

void OddSpots::read_cells(const Pyramid& pyramid, const ColorTransform& transform) {
  for (auto& plane : color_)
    plane.resize(odd_.size());
  for (int i = first_; i < height_; ++i) {
    const std::size_t row = static_cast<std::size_t>(i) * static_cast<std::size_t>(stride_);
    transform_row(transform,
                  {pyramid.plane(view_.level, 0).row(i), pyramid.plane(view_.level, 1).row(i),
                   pyramid.plane(view_.level, 2).row(i)},
                  {&color_[0][row], &color_[1][row], &color_[2][row]}, width_);
  }
}

// Block (I, J) holds the cells 2 I - 1, 2 I of the columns 2 J - 1, 2 J: its middle is a cell of the grid.
void OddSpots::sum_blocks() {
  const auto w = static_cast<std::size_t>(stride_), stride = static_cast<std::size_t>(blocks_x_);
  const int first_block = (first_ + 1) >> 1;
  for (auto& sums : sums_) {
    sums.resize(stride * (static_cast<std::size_t>(blocks_y_) + 1));
    std::fill_n(&sums[static_cast<std::size_t>(first_block) * stride], stride, 0u);
  }
  for (int I = first_block; I < blocks_y_; ++I) {
    const std::size_t above = static_cast<std::size_t>(I) * stride, here = above + stride;
    for (auto& sums : sums_)
      std::copy_n(&sums[above], stride, &sums[here]);
    for (int i = std::max(2 * I - 1, first_); i <= std::min(2 * I, height_ - 1); ++i) {
      const std::size_t row = static_cast<std::size_t>(i) * w;
      const std::uint8_t* const ground = ground_.row(i);
      const auto add = [&](const std::uint8_t* values, std::uint32_t* sums, std::uint32_t* squares) {
        // Of the first block one column is in the picture.
        const std::uint32_t value = ground[0] ? values[0] : 0;
        sums[0] += value;
        if (squares)
          squares[0] += value * value;
        kernels::add_blocks(values + 1, ground + 1, stride_ / 2, sums + 1, squares ? squares + 1 : nullptr);
      };
      add(ground, &sums_[0][here], nullptr);
      for (std::size_t c = 0; c < 3; ++c)
        add(&color_[c][row], &sums_[1 + c][here], &sums_[4 + c][here]);
    }
  }
}

// Running sums over the blocks of the rows `top` to `bottom`, from `pad` blocks left of the picture to `pad`
// blocks right of it.
void OddSpots::sum_strips(int top, int bottom, std::size_t pad) {
  const auto stride = static_cast<std::size_t>(blocks_x_);
  const auto from = static_cast<std::size_t>(std::max(top, (first_ + 1) >> 1)) * stride,
             to = static_cast<std::size_t>(bottom) * stride;
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

void OddSpots::compare_sides(int I) {
  const int away = distance(2 * I), reach = side_reach(away),
            rows = std::max((box_height * away / 16 + 1) >> 1, 1);
  const int top = std::max(I - rows, 0), bottom = std::min(I + rows + 1, blocks_y_);
  const auto blocks = static_cast<std::size_t>(blocks_x_);
  sum_strips(top, bottom, static_cast<std::size_t>(reach));
  // Nothing is known where a side has too little ground.
  const auto full = 4u * static_cast<std::uint32_t>(reach) * static_cast<std::uint32_t>(bottom - top);
  for (auto* values : {&box_cells_, &box_inverse_[0], &box_inverse_[1], &box_inverse_[2]})
    values->resize(blocks);
  kernels::count_boxes(
      strips_[0].data(), reach, (full + least_side - 1) / least_side, blocks_x_,
      {box_cells_.data(), box_inverse_[0].data(), box_inverse_[1].data(), box_inverse_[2].data()});
  const kernels::BoxRow boxes{box_cells_.data(), box_inverse_[0].data(), box_inverse_[1].data(),
                              box_inverse_[2].data(), reach};
  for (auto* values : {&block_left_, &block_right_, &block_deviation_})
    values->resize(blocks);
  variance_.resize(blocks);
  for (std::size_t k = 0; k < 3; ++k) {
    const auto floor = static_cast<std::uint32_t>(deviation_floor[k] * deviation_floor[k] << 8);
    kernels::compare_boxes(strips_[1 + k].data(), strips_[4 + k].data(), boxes, floor, blocks_x_,
                           {block_left_.data(), block_right_.data(), variance_.data()});
    kernels::look_up_octaves(variance_.data(), root_table.data(), blocks_x_, block_deviation_.data());
    const auto spread = [&](const std::vector<std::int16_t>& from, std::vector<std::int16_t>& to) {
      to.resize(2 * blocks);
      kernels::double_each(from.data(), blocks_x_, to.data());
    };
    spread(block_left_, sides_.left[k]);
    spread(block_right_, sides_.right[k]);
    spread(block_deviation_, sides_.inverse[k]);
  }
}

void OddSpots::measure_row(int row) {
  const auto w = static_cast<std::size_t>(stride_);
  const std::size_t at = static_cast<std::size_t>(row) * w;
  dark_.resize(w);
  for (std::size_t c = 0; c < 3; ++c) {
    deviation_[c].resize(w);
    kernels::deviations(&color_[c][at], sides_.left[c].data() + 1, sides_.right[c].data() + 1,
                        sides_.inverse[c].data() + 1, stride_, deviation_[c].data(),
                        c == 0 ? dark_.data() : nullptr);
  }
  const std::uint8_t *const ground = ground_.row(row), *const y = deviation_[0].data(),
                            *const dark = dark_.data();
  // A column wider on both sides.
  shade_.resize(w + 2);
  const kernels::DeviationRow deviations{y, deviation_[1].data(), deviation_[2].data(), ground, dark};
  kernels::note_dark(deviations, dark_enough, static_cast<std::int16_t>(row), stride_, shade_.data(),
                     nearest_dark_.data());
  const auto reached = static_cast<std::int16_t>(row + std::max(shadow_reach * distance(row) / 64, 1));
  kernels::oddness(deviations, nearest_dark_.data(), reached, most_oddness, stride_, &odd_[at]);
}

// Where the mean oddness of the ground around a candidate is enough. The rest of seed_ is 0: keep_islands()
// leaves nothing of it.
bool OddSpots::seed() {
  const int enough = is_far() ? far_seed_enough : seed_enough;
  const std::size_t from = static_cast<std::size_t>(first_) * static_cast<std::size_t>(stride_);
  if (largest(&odd_[from], odd_.size() - from) < enough)
    return false;
  candidates_.list(odd_.data(), odd_enough);
  return candidates_.seed(
      odd_.data(), ground_, enough, [&](int row) { return reach(seed_reach, row); }, seed_.data());
}

// Drops the pieces of spots whose cells are not to be kept. False when none are left.
template <typename Keep> bool OddSpots::keep_pieces(Keep keep) {
  bool any = false;
  for (const std::uint32_t cell : candidates_.cells())
    seed_[cell] = spot_[cell]; // cells that wait to be looked at
  for (const std::uint32_t start : candidates_.cells()) {
    if (!seed_[start])
      continue;
    candidates_.take_piece(start, seed_.data(), queue_);
    const bool kept = keep(queue_);
    any |= kept;
    if (!kept)
      for (const std::uint32_t cell : queue_)
        spot_[cell] = 0;
  }
  return any;
}

// Drops what touches something above it that is not ground: a matter of the boundary.
bool OddSpots::keep_islands() {
  const auto w = static_cast<std::uint32_t>(stride_);
  return keep_pieces([&](const std::vector<std::uint32_t>& piece) {
    return std::all_of(piece.begin(), piece.end(), [&](std::uint32_t cell) {
      return static_cast<int>(cell / w) <= first_ || ground_.at(cell - w);
    });
  });
}

// The foot of a thing moves as the ground does, too: all of a spot has to, and most of it clearly.
bool OddSpots::drop_flat(const FinerCells<std::int16_t>& motion, std::vector<Hole>& holes) {
  if (motion.values.empty())
    return true;
  const auto w = static_cast<std::uint32_t>(stride_);
  const bool any = keep_pieces([&](const std::vector<std::uint32_t>& piece) {
    int sum = 0, most = std::numeric_limits<std::int16_t>::min();
    for (const std::uint32_t cell : piece) {
      const int row = static_cast<int>(cell / w), column = static_cast<int>(cell % w);
      const int moves = motion.nearest(column << view_.level, row << view_.level);
      sum += moves;
      most = std::max(most, moves);
    }
    return most > flat_everywhere || sum > flat_on_average * static_cast<int>(piece.size());
  });
  list(holes);
  return any;
}

void OddSpots::list(std::vector<Hole>& holes) const {
  holes.clear();
  candidates_.each_stretch(spot_.data(), [&](int row, int from, int to) {
    holes.push_back(hole_of_cells(view_.level, row, from, to));
  });
}

} // namespace terrainseg
