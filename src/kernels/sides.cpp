// SPDX-License-Identifier: LGPL-2.1-or-later
#include "kernels/sides.hpp"

#include <algorithm>
#include <array>

#include "kernels/targets.hpp"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "kernels/sides.cpp"
#include <hwy/foreach_target.h>
// Must follow foreach_target.h.
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace terrainseg::kernels {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

void sum_of_blocks(const std::uint8_t* __restrict cells, const std::uint8_t* __restrict ground, int blocks,
                   std::uint32_t* __restrict sums, std::uint32_t* __restrict squares) {
  int b = 0;
#if HWY_TARGET != HWY_SCALAR
  const hn::CappedTag<std::uint32_t, 8> d32;
  const hn::Rebind<std::uint16_t, decltype(d32)> d16;
  const hn::Repartition<std::uint8_t, decltype(d16)> d8;
  const int n = static_cast<int>(hn::Lanes(d32));
  for (; b + n <= blocks; b += n) {
    const auto in = hn::Sub(hn::Zero(d8), hn::LoadU(d8, ground + 2 * b));
    const auto pairs = hn::BitCast(d16, hn::And(hn::LoadU(d8, cells + 2 * b), in));
    const auto left = hn::And(pairs, hn::Set(d16, 255)), right = hn::ShiftRight<8>(pairs);
    const auto sum = hn::PromoteTo(d32, hn::Add(left, right));
    hn::StoreU(hn::Add(hn::LoadU(d32, sums + b), sum), d32, sums + b);
    if (squares) {
      const auto square =
          hn::Add(hn::PromoteTo(d32, hn::Mul(left, left)), hn::PromoteTo(d32, hn::Mul(right, right)));
      hn::StoreU(hn::Add(hn::LoadU(d32, squares + b), square), d32, squares + b);
    }
  }
#endif
  for (; b < blocks; ++b) {
    const std::uint32_t left = ground[2 * b] ? cells[2 * b] : 0,
                        right = ground[2 * b + 1] ? cells[2 * b + 1] : 0;
    sums[b] += left + right;
    if (squares)
      squares[b] += left * left + right * right;
  }
}

void running_differences(const std::uint32_t* __restrict a, const std::uint32_t* __restrict b, int count,
                         std::uint32_t* __restrict out) {
  std::uint32_t run = 0;
  int i = 0;
#if HWY_TARGET != HWY_SCALAR
  const hn::FixedTag<std::uint32_t, 4> d;
  auto before = hn::Zero(d);
  for (; i + 4 <= count; i += 4) {
    const auto four = hn::Sub(hn::LoadU(d, b + i), hn::LoadU(d, a + i));
    const auto pairs = hn::Add(four, hn::ShiftLeftLanes<1>(d, four));
    const auto sums = hn::Add(hn::Add(pairs, hn::ShiftLeftLanes<2>(d, pairs)), before);
    hn::StoreU(sums, d, out + i);
    before = hn::Broadcast<3>(sums);
  }
  run = hn::GetLane(before);
#endif
  for (; i < count; ++i)
    out[i] = run += b[i] - a[i];
}

/// Table of 2^24 / n, which is faster than a division.
constexpr auto inverses = [] {
  std::array<std::uint32_t, 1 << 14> table{};
  for (std::uint32_t n = 1; n < table.size(); ++n)
    table[n] = (1u << 24) / n;
  return table;
}();

void counts_of_boxes(const std::uint32_t* __restrict counts, std::uint32_t least, int count,
                     const BoxRow& out) {
  const std::uint32_t *const counts_b = counts + out.reach, *const counts_c = counts_b + 1,
                             *const counts_d = counts_c + out.reach;
  int b = 0;
#if TERRAINSEG_GATHERS
  const hn::FixedTag<std::uint32_t, 8> d;
  const hn::RebindToSigned<decltype(d)> di;
  for (; b + 8 <= count; b += 8) {
    const auto at_a = hn::LoadU(d, counts + b), at_d = hn::LoadU(d, counts_d + b);
    const auto left = hn::Sub(hn::LoadU(d, counts_b + b), at_a),
               right = hn::Sub(at_d, hn::LoadU(d, counts_c + b)), all = hn::Sub(at_d, at_a);
    // The whole box has at least as many cells as its sides.
    if (!hn::AllTrue(d, hn::Lt(all, hn::Set(d, static_cast<std::uint32_t>(inverses.size())))))
      break;
    const auto too_few = hn::Set(di, static_cast<std::int32_t>(least) - 1);
    const auto has_enough = [&](auto n) HWY_ATTR {
      return hn::BitCast(d, hn::VecFromMask(di, hn::Gt(hn::BitCast(di, n), too_few)));
    };
    const auto known = hn::And(has_enough(left), has_enough(right));
    const auto inverse = [&](auto n) HWY_ATTR {
      return hn::And(known, hn::GatherIndex(d, inverses.data(), hn::BitCast(di, n)));
    };
    hn::StoreU(all, d, out.cells + b);
    hn::StoreU(inverse(all), d, out.inverse + b);
    hn::StoreU(inverse(left), d, out.inverse_left + b);
    hn::StoreU(inverse(right), d, out.inverse_right + b);
  }
#endif
  const auto inverse = [](std::uint32_t n)
                           HWY_ATTR { return n < inverses.size() ? inverses[n] : (1u << 24) / n; };
  for (; b < count; ++b) {
    const std::uint32_t left = counts_b[b] - counts[b], right = counts_d[b] - counts_c[b],
                        all = counts_d[b] - counts[b];
    const bool known = left >= least && right >= least;
    out.cells[b] = all;
    out.inverse[b] = known ? inverse(all) : 0;
    out.inverse_left[b] = known ? inverse(left) : 0;
    out.inverse_right[b] = known ? inverse(right) : 0;
  }
}

void sides_of_boxes(const std::uint32_t* __restrict sums, const std::uint32_t* __restrict squares,
                    const BoxRow& boxes, std::uint32_t floor, int count, const SideRow& out) {
  const std::uint32_t *const cells = boxes.cells, *const inverse = boxes.inverse,
                             *const inverse_left = boxes.inverse_left,
                             *const inverse_right = boxes.inverse_right;
  const std::uint32_t *const sums_b = sums + boxes.reach, *const sums_c = sums_b + 1,
                             *const sums_d = sums_c + boxes.reach,
                             *const squares_d = squares + 2 * boxes.reach + 1;
  std::int16_t* __restrict left = out.left;
  std::int16_t* __restrict right = out.right;
  std::uint32_t* __restrict variance = out.variance;
  for (int b = 0; b < count; ++b) {
    left[b] = static_cast<std::int16_t>(((sums_b[b] - sums[b]) * inverse_left[b]) >> 20);
    right[b] = static_cast<std::int16_t>(((sums_d[b] - sums_c[b]) * inverse_right[b]) >> 20);
  }
  for (int b = 0; b < count; ++b) {
    // Relative to the integer part of the mean, so that the difference of two large squares loses no
    // precision.
    const std::uint32_t n = cells[b], r = inverse[b], sum = sums_d[b] - sums[b], base = (sum * r) >> 24,
                        rest = sum - n * base;
    const std::uint32_t around = squares_d[b] - squares[b] + n * base * base - 2 * base * sum;
    const auto power = static_cast<std::uint32_t>((std::uint64_t{around} * r) >> 16);
    const std::uint32_t mean = (rest * r) >> 16, lost = (mean * mean) >> 8;
    const std::uint32_t both = (power > lost ? power - lost : 0) + floor;
    variance[b] = r ? both : 0;
  }
}

void twice_each(const std::int16_t* __restrict in, int count, std::int16_t* __restrict out) {
  for (int b = 0; b < count; ++b) {
    out[2 * b] = in[b];
    out[2 * b + 1] = in[b];
  }
}

void deviations_of_row(const std::uint8_t* __restrict cells, const std::int16_t* __restrict left,
                       const std::int16_t* __restrict right, const std::int16_t* __restrict inverse,
                       int count, std::uint8_t* __restrict out) {
  for (int i = 0; i < count; ++i) {
    const auto cell = static_cast<std::int16_t>(16 * cells[i]);
    const auto a = static_cast<std::int16_t>(cell - left[i]), b = static_cast<std::int16_t>(cell - right[i]);
    const std::int16_t low = a < b ? a : b, high = a < b ? b : a, below = static_cast<std::int16_t>(-high);
    // Both above, or both below: 4080 at most.
    const std::int16_t far = low > below ? low : below;
    const auto beyond = static_cast<std::uint16_t>(4 * (far > 0 ? far : std::int16_t{0}));
    const auto scale = static_cast<std::uint16_t>(4 * inverse[i]);
    const auto z = static_cast<std::uint16_t>((std::uint32_t{beyond} * scale) >> 16);
    out[i] = static_cast<std::uint8_t>(z < 127 ? z : std::uint16_t{127});
  }
}

void dark_of_row(const std::uint8_t* __restrict cells, const std::int16_t* __restrict left,
                 const std::int16_t* __restrict right, int count, std::uint8_t* __restrict dark) {
  for (int i = 0; i < count; ++i) {
    const auto cell = static_cast<std::int16_t>(16 * cells[i]);
    const std::int16_t low = left[i] < right[i] ? left[i] : right[i];
    dark[i] = cell < low ? 1 : 0;
  }
}

void deviations_of(const std::uint8_t* cells, const std::int16_t* left, const std::int16_t* right,
                   const std::int16_t* inverse, int count, std::uint8_t* out, std::uint8_t* dark) {
  deviations_of_row(cells, left, right, inverse, count, out);
  if (dark)
    dark_of_row(cells, left, right, count, dark);
}

void shade_of_row(const std::uint8_t* __restrict y, const std::uint8_t* __restrict ground,
                  const std::uint8_t* __restrict dark, int enough, int count,
                  std::uint8_t* __restrict shade) {
  const auto least = static_cast<std::uint8_t>(enough);
  for (int i = 0; i < count; ++i)
    shade[i] = static_cast<std::uint8_t>(ground[i] & dark[i] & (y[i] > least ? 1 : 0));
}

void nearest_of_row(const std::uint8_t* __restrict shade, std::int16_t row, int count,
                    std::int16_t* __restrict nearest) {
  for (int i = 0; i < count; ++i)
    nearest[i] = (shade[i] | shade[i + 1] | shade[i + 2]) ? row : nearest[i];
}

void shades_of_row(const DeviationRow& in, int enough, std::int16_t row, int count, std::uint8_t* work,
                   std::int16_t* nearest) {
  work[0] = work[count + 1] = 0;
  shade_of_row(in.y, in.ground, in.dark, enough, count, work + 1);
  nearest_of_row(work, row, count, nearest);
}

void oddness_of_row(const DeviationRow& in, const std::int16_t* __restrict nearest, std::int16_t reached,
                    int most, int count, std::uint8_t* __restrict out) {
  const std::uint8_t *const y = in.y, *const u = in.u, *const v = in.v, *const ground = in.ground,
                            *const dark = in.dark;
  const auto limit = static_cast<std::uint8_t>(most);
  for (int i = 0; i < count; ++i) {
    // In bytes from end to end: no sum of two leaves one.
    const std::uint8_t full = y[i], quarter = full >> 2, a = u[i], b = v[i];
    const std::uint8_t paler = nearest[i] > reached ? quarter : full, luma = dark[i] ? full : paler;
    const std::uint8_t chroma = a > b ? a : b, largest = luma > chroma ? luma : chroma;
    const auto first = static_cast<std::uint8_t>(largest + luma), second = static_cast<std::uint8_t>(a + b);
    const auto half =
        static_cast<std::uint8_t>((first & second) + static_cast<std::uint8_t>((first ^ second) >> 1));
    const std::uint8_t bounded = half < limit ? half : limit;
    out[i] = ground[i] ? bounded : std::uint8_t{0};
  }
}

void excess_of_row(const std::uint8_t* __restrict values, const std::uint8_t* __restrict ground, int enough,
                   int sign, int count, std::int16_t* __restrict sums) {
  // In bytes as far as possible: half the vectors.
  const auto flip = static_cast<std::int8_t>(sign < 0 ? -1 : 0), level = static_cast<std::int8_t>(enough);
  for (int i = 0; i < count; ++i) {
    const auto excess = static_cast<std::int8_t>(values[i] - (level & -ground[i]));
    const auto change = static_cast<std::int8_t>((excess ^ flip) - flip);
    sums[i] = static_cast<std::int16_t>(sums[i] + change);
  }
}

/// Marks the cells of one vector from cell i on, whose boxes are summed in the numbers of `d`. Returns the
/// marks.
template <class D>
HWY_INLINE auto marks_of_cells(D d, const ColumnBoxes& boxes, const std::uint8_t* values, int least, int i,
                               std::uint8_t* marks) {
  using Number = hn::TFromD<D>;
  const hn::Rebind<std::uint8_t, D> d8;
  auto sum = hn::Zero(d);
  for (int k = i - boxes.reach; k <= i + boxes.reach; ++k) {
    if constexpr (sizeof(Number) == sizeof(std::int16_t))
      sum = hn::Add(sum, hn::LoadU(d, boxes.columns + k));
    else
      sum = hn::Add(sum, hn::PromoteTo(d, hn::LoadU(hn::Rebind<std::int16_t, D>(), boxes.columns + k)));
  }
  const auto value = hn::PromoteTo(d, hn::LoadU(d8, values + i));
  const auto marked = hn::And(hn::Gt(sum, hn::Set(d, static_cast<Number>(boxes.least - 1))),
                              hn::Gt(value, hn::Set(d, static_cast<Number>(least - 1))));
  const auto mark = hn::DemoteTo(d8, hn::IfThenElseZero(marked, hn::Set(d, 1)));
  hn::StoreU(mark, d8, marks + i);
  return mark;
}

template <class D>
HWY_INLINE bool marks_of_cells_of_row(D d, const ColumnBoxes& boxes, const std::uint8_t* values, int least,
                                      int count, std::uint8_t* marks) {
  const hn::CappedTag<hn::TFromD<D>, 1> one;
  const hn::Rebind<std::uint8_t, D> d8;
  const int n = static_cast<int>(hn::Lanes(d));
  auto any = hn::Zero(d8);
  std::uint8_t any_of_rest = 0;
  int i = 0;
  for (; i + n <= count; i += n)
    any = hn::Or(any, marks_of_cells(d, boxes, values, least, i, marks));
  if (i < count && count >= n) // the last vector again takes some cells of the one before it
    any = hn::Or(any, marks_of_cells(d, boxes, values, least, count - n, marks));
  else
    for (; i < count; ++i)
      any_of_rest |= hn::GetLane(marks_of_cells(one, boxes, values, least, i, marks));
  return any_of_rest != 0 || !hn::AllTrue(d8, hn::Eq(any, hn::Zero(d8)));
}

bool marks_of_row(const ColumnBoxes& boxes, const std::uint8_t* values, int least, int count,
                  std::uint8_t* marks) {
  if (boxes.reach <= reach_of_16_bits)
    return marks_of_cells_of_row(hn::ScalableTag<std::int16_t>(), boxes, values, least, count, marks);
  return marks_of_cells_of_row(hn::ScalableTag<std::int32_t>(), boxes, values, least, count, marks);
}

} // namespace HWY_NAMESPACE
} // namespace terrainseg::kernels
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace terrainseg::kernels {

TERRAINSEG_DISPATCH(add_blocks, sum_of_blocks);
TERRAINSEG_DISPATCH(count_boxes, counts_of_boxes);
TERRAINSEG_DISPATCH(run_differences, running_differences);
TERRAINSEG_DISPATCH(compare_boxes, sides_of_boxes);
TERRAINSEG_DISPATCH(double_each, twice_each);
TERRAINSEG_DISPATCH(deviations, deviations_of);
TERRAINSEG_DISPATCH(note_dark, shades_of_row);
TERRAINSEG_DISPATCH(oddness, oddness_of_row);
TERRAINSEG_DISPATCH(add_excess, excess_of_row);
TERRAINSEG_DISPATCH(mark_boxes, marks_of_row);

// The loops of the stone field are plain: vectors of newer processors would save less than 5 % of a frame
// (lab/speed/plain.py).

void add_moments(const std::uint8_t* __restrict luma, const std::uint8_t* __restrict ground, int count,
                 const ColumnMoments& out) {
  std::uint16_t* __restrict cells = out.cells, * __restrict sums = out.sums;
  std::uint32_t* __restrict squares = out.squares;
  for (int i = 0; i < count; ++i) {
    cells[i] = static_cast<std::uint16_t>(cells[i] + ground[i]);
    sums[i] = static_cast<std::uint16_t>(sums[i] + (luma[i] & -ground[i]));
  }
  for (int i = 0; i < count; ++i) {
    const auto away = static_cast<std::int16_t>((luma[i] - 128) & -ground[i]);
    squares[i] += static_cast<std::uint32_t>(away * away);
  }
}

void add_near(const std::uint8_t* __restrict luma, const std::uint8_t* __restrict ground,
              const std::uint8_t* __restrict middle, const std::uint8_t* __restrict reach, int count,
              const ColumnDeviations& out) {
  std::uint16_t* __restrict cells = out.cells, * __restrict sums = out.sums, * __restrict distances = out.distances;
  for (int i = 0; i < count; ++i) {
    const std::uint8_t x = luma[i], m = middle[i], high = x > m ? x : m, low = x > m ? m : x;
    const auto away = static_cast<std::uint8_t>(high - low);
    const auto taken = static_cast<std::uint8_t>(ground[i] & static_cast<int>(away <= reach[i]));
    const auto all = static_cast<std::uint8_t>(-taken);
    cells[i] = static_cast<std::uint16_t>(cells[i] + taken);
    sums[i] = static_cast<std::uint16_t>(sums[i] + (x & all));
    distances[i] = static_cast<std::uint16_t>(distances[i] + (away & all));
  }
}

void deviations_from(const std::uint8_t* __restrict luma, const std::uint8_t* __restrict ground,
                     const std::uint8_t* __restrict middle, const std::uint16_t* __restrict scale, int count,
                     std::uint8_t* __restrict out) {
  for (int i = 0; i < count; ++i) {
    const auto x = static_cast<std::int16_t>(luma[i]), m = static_cast<std::int16_t>(middle[i]);
    // 64 * 255 and 4 * 1024 fit 16 bits, and the shift by 16 of their product equals a shift by 8.
    const auto away = static_cast<std::uint16_t>((x > m ? x - m : m - x) << 6);
    const auto factor = static_cast<std::uint16_t>(scale[i] << 2);
    const auto z = static_cast<std::uint16_t>((std::uint32_t{away} * factor) >> 16);
    out[i] = static_cast<std::uint8_t>((z < 127 ? z : std::uint16_t{127}) & -ground[i]);
  }
}

} // namespace terrainseg::kernels
#endif
