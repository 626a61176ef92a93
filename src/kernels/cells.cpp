// SPDX-License-Identifier: LGPL-2.1-or-later
#include "kernels/cells.hpp"

#include <algorithm>
#include <bit>
#include <cstdlib>

#include "kernels/targets.hpp"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "kernels/cells.cpp"
#include <hwy/foreach_target.h>
// Must follow foreach_target.h.
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace terrainseg::kernels {
namespace HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

HWY_INLINE int within(int value, int least, int most) {
  return value < least ? least : (value > most ? most : value);
}

HWY_INLINE int color_distance(int dy, int du, int dv) {
  return std::abs(dy) + 2 * (std::abs(du) + std::abs(dv));
}

// Cells in 32-bit lanes, at most 16 per vector, because a row has few cells. Single cells are vectors of one
// lane.
using Vector = hn::CappedTag<std::int32_t, 16>;
using Single = hn::CappedTag<std::int32_t, 1>;

template <class D> HWY_INLINE hn::Vec<D> load_cells(D d, const std::uint8_t* cells) {
  return hn::PromoteTo(d, hn::LoadU(hn::Rebind<std::uint8_t, D>(), cells));
}

template <class V> HWY_INLINE V color_distance(V dy, V du, V dv) {
  return hn::Add(hn::Abs(dy), hn::ShiftLeft<1>(hn::Add(hn::Abs(du), hn::Abs(dv))));
}

template <class D, class V = hn::Vec<D>>
HWY_INLINE V weighted(D d, const std::array<std::int32_t, 3>& weights, V a, V b, V c) {
  return hn::Add(hn::Add(hn::Mul(hn::Set(d, weights[0]), a), hn::Mul(hn::Set(d, weights[1]), b)),
                 hn::Mul(hn::Set(d, weights[2]), c));
}

// Calls block(d, i) for vectors from cell i on that cover 0..count-1; the last one overlaps. Only for loops
// that do not read what they write.
template <class Block> HWY_INLINE void cover(int count, const Block& block) {
  const int n = static_cast<int>(hn::Lanes(Vector()));
  for (int i = 0; i < count && count < n; ++i)
    block(Single(), i);
  for (int i = 0; i + n < count; i += n)
    block(Vector(), i);
  if (count >= n)
    block(Vector(), count - n);
}

void weigh_cells(const ComponentRow& in, const std::array<std::int32_t, 3>& weights, std::int32_t offset,
                 int count, std::uint8_t* out) {
  const auto store = [&](auto d, int i, auto sum) HWY_ATTR {
    const hn::Rebind<std::uint8_t, decltype(d)> d8;
    hn::StoreU(hn::DemoteTo(d8, hn::ShiftRight<16>(hn::Add(sum, hn::Set(d, offset)))), d8, out + i);
  };
  // For conversions between ranges of the same colour matrix, each output depends on one component only.
  for (std::size_t k = 0; k < 3; ++k)
    if (weights[(k + 1) % 3] == 0 && weights[(k + 2) % 3] == 0)
      return cover(count, [&, weight = weights[k], cells = in[k]](auto d, int i) HWY_ATTR {
        store(d, i, hn::Mul(hn::Set(d, weight), load_cells(d, cells + i)));
      });
  cover(count, [&](auto d, int i) HWY_ATTR {
    store(d, i,
          weighted(d, weights, load_cells(d, in[0] + i), load_cells(d, in[1] + i), load_cells(d, in[2] + i)));
  });
}

// Auto-vectorised, as the next loops.
void add_pair_differences(const std::uint8_t* __restrict luma, int count, std::uint16_t* __restrict sums) {
  for (int i = 0; i < count; ++i)
    sums[i] = static_cast<std::uint16_t>(sums[i] + std::abs(luma[2 * i + 1] - luma[2 * i]));
}

template <int rows>
void sums_of(const std::array<const std::uint8_t*, 4>& row, int count, std::uint16_t* __restrict sums,
             std::uint16_t* __restrict steps) {
  const auto [a, b, c, d] = row;
  for (int x = 0; x < count; ++x)
    sums[x] = static_cast<std::uint16_t>(a[x] + (rows > 1 ? b[x] : 0) + (rows > 2 ? c[x] : 0) +
                                         (rows > 3 ? d[x] : 0));
  const auto step = [](const std::uint8_t* at) {
    return static_cast<std::uint16_t>(at[0] < at[1] ? at[1] - at[0] : at[0] - at[1]);
  };
  for (int x = 0; x + 1 < count; ++x)
    steps[x] = static_cast<std::uint16_t>(step(a + x) + (rows > 1 ? step(b + x) : 0) +
                                          (rows > 2 ? step(c + x) : 0) + (rows > 3 ? step(d + x) : 0));
}

void sums_of_rows(const std::array<const std::uint8_t*, 4>& row, int rows, int count, std::uint16_t* sums,
                  std::uint16_t* steps) {
  with_constant<1, 2, 3, 4>(rows, [&](auto n) HWY_ATTR { sums_of<n>(row, count, sums, steps); });
}

template <int per_cell>
void largest_steps_of(const std::uint16_t* __restrict columns, int count, std::uint16_t* __restrict out) {
  for (int i = 0; i < count; ++i) {
    int most = 0;
    for (int k = 0; k < per_cell; ++k)
      most = std::max(most, std::abs(columns[i * per_cell + k + 1] - columns[i * per_cell + k]));
    out[i] = static_cast<std::uint16_t>(most);
  }
}

void largest_steps_of_cells(const std::uint16_t* columns, int per_cell, int count, std::uint16_t* out) {
  with_constant<1, 2, 4>(per_cell, [&](auto n) HWY_ATTR { largest_steps_of<n>(columns, count, out); });
}

void upright_evidence(const std::int16_t* __restrict coherence, const std::uint16_t* __restrict contrast,
                      const std::uint8_t* __restrict ignored, const UprightRule& rule, int score_weight,
                      int count, std::int16_t* __restrict score) {
  const auto [neutral, weight, against, in_favour, most] = rule;
  for (int i = 0; i < count; ++i) {
    const int says = within(((neutral - coherence[i]) * weight) >> 8, against, in_favour) * contrast[i] / 32,
              added = says < most ? says : most;
    const int weighed = ((score[i] * score_weight) >> 5) + added;
    score[i] = static_cast<std::int16_t>(ignored[i] ? score[i] : weighed);
  }
}

template <int per_cell>
void add_boxes_of(const std::uint16_t* __restrict columns, int shift, int count,
                  std::uint16_t* __restrict out) {
  for (int i = 0; i < count; ++i) {
    unsigned sum = 0;
    for (int k = 0; k < per_cell; ++k)
      sum += columns[i * per_cell + k];
    out[i] = static_cast<std::uint16_t>(out[i] + (sum << shift));
  }
}

void add_column_boxes(const std::uint16_t* columns, int per_cell, int shift, int count, std::uint16_t* out) {
  with_constant<1, 2, 4>(per_cell, [&](auto n) HWY_ATTR { add_boxes_of<n>(columns, shift, count, out); });
}

void color_steps_between(const ComponentRow& a, const ComponentRow& b, int gain, int limit, int count,
                         std::uint16_t* __restrict out) {
  const auto [ay, au, av] = a;
  const auto [by, bu, bv] = b;
  for (int i = 0; i < count; ++i) {
    const int step = (color_distance(ay[i] - by[i], au[i] - bu[i], av[i] - bv[i]) * gain) >> 8;
    out[i] = static_cast<std::uint16_t>(step < limit ? step : limit);
  }
}

void follow_cells(const ComponentRow& cells, const std::uint8_t* ignored, const FollowRule& rule,
                  const std::array<std::int32_t*, 3>& reference, int count, std::int8_t* penalty) {
  const auto follow = [&](auto d, int i) HWY_ATTR {
    const auto zero = hn::Zero(d);
    const auto off = [&](std::size_t c) HWY_ATTR {
      return hn::Sub(hn::ShiftLeft<4>(load_cells(d, cells[c] + i)), hn::LoadU(d, reference[c] + i));
    };
    const auto dy = off(0), du = off(1), dv = off(2);
    const auto far = hn::ShiftRight<12>(hn::Mul(color_distance(dy, du, dv), hn::Set(d, rule.gain)));
    const auto beyond = hn::ShiftRight<1>(hn::Sub(far, hn::Set(d, rule.free_below)));
    const hn::Rebind<std::int8_t, decltype(d)> d8;
    hn::StoreU(hn::DemoteTo(d8, hn::Min(hn::Max(beyond, zero), hn::Set(d, rule.most))), d8, penalty + i);
    const auto follows =
        hn::And(hn::Lt(far, hn::Set(d, rule.follow_below)), hn::Eq(load_cells(d, ignored + i), zero));
    const auto move = [&](std::size_t c, auto distance) HWY_ATTR {
      const auto step = hn::IfThenElseZero(follows, hn::ShiftRight<2>(distance));
      hn::StoreU(hn::Add(hn::LoadU(d, reference[c] + i), step), d, reference[c] + i);
    };
    move(0, dy);
    move(1, du);
    move(2, dv);
  };
  int i = 0;
  for (const int n = static_cast<int>(hn::Lanes(Vector())); i + n <= count; i += n)
    follow(Vector(), i);
  for (; i < count; ++i)
    follow(Single(), i);
}

// Q16 of 1 / the number of rows or columns in reach.
HWY_INLINE std::uint32_t share_of_box(int at, int reach, int size) {
  const int count = std::min(at + reach, size - 1) - std::max(at - reach, 0) + 1;
  return (65536u + static_cast<std::uint32_t>(count) / 2) / static_cast<std::uint32_t>(count);
}
HWY_INLINE std::uint8_t mean_of_box(std::uint32_t sum, std::uint32_t share) {
  const std::uint32_t mean = (sum * share + 32768) >> 16;
  return static_cast<std::uint8_t>(mean < 255 ? mean : 255);
}

// Means over the rows in reach. The inner loops are auto-vectorised.
void means_over_rows(const std::uint8_t* in, std::ptrdiff_t stride, int width, int height, int reach,
                     std::uint32_t* __restrict sums, std::uint8_t* __restrict out) {
  std::fill_n(sums, width, 0u);
  const auto add = [&](int i) HWY_ATTR {
    const std::uint8_t* __restrict row = in + i * stride;
    for (int j = 0; j < width; ++j)
      sums[j] += row[j];
  };
  for (int i = 0; i < std::min(reach, height); ++i)
    add(i);
  for (int i = 0; i < height; ++i, out += width) {
    if (i + reach < height)
      add(i + reach);
    if (i > reach) {
      const std::uint8_t* __restrict row = in + (i - reach - 1) * stride;
      for (int j = 0; j < width; ++j)
        sums[j] -= row[j];
    }
    const std::uint32_t share = share_of_box(i, reach, height);
    for (int j = 0; j < width; ++j)
      out[j] = mean_of_box(sums[j], share);
  }
}

// Means over the columns in reach, in place. `sums` holds 2 * (width + reach) + 1 elements: the sum of the
// cells before each column, with a margin of `reach` on both sides, then the shares.
void means_over_columns(std::uint8_t* __restrict cells, int width, int height, int reach,
                        std::uint32_t* __restrict sums) {
  std::uint32_t* const shares = sums + width + 2 * reach + 1;
  std::fill_n(sums, reach + 1, 0u);
  for (int j = 0; j < width; ++j)
    shares[j] = share_of_box(j, reach, width);
  for (int i = 0; i < height; ++i, cells += width) {
    std::uint32_t sum = 0;
    for (int j = 0; j < width; ++j)
      sums[reach + 1 + j] = sum += cells[j];
    std::fill_n(sums + reach + 1 + width, reach, sum);
    for (int j = 0; j < width; ++j)
      cells[j] = mean_of_box(sums[j + 2 * reach + 1] - sums[j], shares[j]);
  }
}

// Auto-vectorised, as the next loops.
void distances_passed(const std::int32_t* __restrict from, const std::uint16_t* __restrict steps,
                      const std::uint8_t* __restrict ignored_from, const std::uint8_t* __restrict ignored_to,
                      int free, int count, std::int32_t* __restrict to) {
  for (int i = 0; i < count; ++i) {
    const int beyond = steps[i] - free,
              price = (beyond > 0 ? beyond : 0) & ((ignored_from[i] | ignored_to[i]) - 1),
              passed = from[i] + price;
    to[i] = passed < to[i] ? passed : to[i];
  }
}

void penalties_raised(std::int32_t* __restrict distances, int free, int most, int shift, int count,
                      std::int8_t* __restrict penalty) {
  for (int i = 0; i < count; ++i) {
    const int distance = distances[i], beyond = distance - free < most ? distance - free : most;
    penalty[i] = beyond > penalty[i] ? static_cast<std::int8_t>(beyond) : penalty[i];
    distances[i] = distance - (distance >> shift);
  }
}

// In 16 bits.
void looks_compared(const LookRow& a, const LookRow& b, const LookLimits& limits, int dark, int count,
                    std::uint8_t* __restrict alike) {
  using Short = std::int16_t;
  const auto [ya, ua, va, ra] = a.values;
  const auto [yb, ub, vb, rb] = b.values;
  const std::uint8_t *const ignored_a = a.ignored, *const ignored_b = b.ignored;
  const LookLimits most = limits;
  const auto added = static_cast<Short>(dark);
  const auto apart = [](Short x, Short y) { return static_cast<Short>(x < y ? y - x : x - y); };
  for (int i = 0; i < count; ++i) {
    const auto step = static_cast<Short>(most.luma * apart(ya[i], yb[i]));
    const auto sum = static_cast<Short>(ya[i] + yb[i] + added);
    const auto color = static_cast<Short>(apart(ua[i], ub[i]) + apart(va[i], vb[i]));
    const int same = (step <= sum) & (color <= most.chroma) & (apart(ra[i], rb[i]) <= most.rough);
    const int ignored = ignored_a[i] | ignored_b[i];
    alike[i] = static_cast<std::uint8_t>((same & (ignored ^ 1)) | (ignored & most.if_ignored));
  }
}

// Auto-vectorised.
void smooth_cells(const std::int32_t* __restrict in, int count, std::int32_t* __restrict out) {
  if (count == 1) {
    out[0] = in[0];
    return;
  }
  out[0] = (3 * in[0] + in[1]) >> 2;
  for (int i = 1; i < count - 1; ++i)
    out[i] = (in[i - 1] + 2 * in[i] + in[i + 1]) >> 2;
  out[count - 1] = (in[count - 2] + 3 * in[count - 1]) >> 2;
}

void strongest_of_strip(const Strip& strip, const std::array<std::array<std::int32_t, 3>, 3>& matrix,
                        int rows, const std::uint8_t* last, std::uint8_t* best) {
  cover(strip_columns, [&](auto d, int i) HWY_ATTR {
    const auto lowest = load_cells(d, last + i);
    auto strongest = hn::Set(d, -1), at = hn::Zero(d);
    auto y = load_cells(d, &strip[0][0][0] + i), u = load_cells(d, &strip[0][1][0] + i),
         v = load_cells(d, &strip[0][2][0] + i);
    for (int row = 1; row < rows; ++row) {
      const auto& here = strip[row];
      const auto y0 = y, u0 = u, v0 = v;
      y = load_cells(d, &here[0][0] + i);
      u = load_cells(d, &here[1][0] + i);
      v = load_cells(d, &here[2][0] + i);
      const auto a = hn::Sub(y, y0), b = hn::Sub(u, u0), c = hn::Sub(v, v0);
      const auto strength = color_distance(hn::ShiftRight<8>(weighted(d, matrix[0], a, b, c)),
                                           hn::ShiftRight<8>(weighted(d, matrix[1], a, b, c)),
                                           hn::ShiftRight<8>(weighted(d, matrix[2], a, b, c)));
      const auto this_row = hn::Set(d, row);
      // The condition is "row <= last".
      const auto stronger = hn::AndNot(hn::Gt(this_row, lowest), hn::Gt(strength, strongest));
      strongest = hn::IfThenElse(stronger, strength, strongest);
      at = hn::IfThenElse(stronger, this_row, at);
    }
    const hn::Rebind<std::uint8_t, decltype(d)> d8;
    hn::StoreU(hn::DemoteTo(d8, at), d8, best + i);
  });
}

void octaves_looked_up(const std::uint32_t* __restrict values, const std::int16_t* __restrict table,
                       int count, std::int16_t* __restrict out) {
  int i = 0;
#if TERRAINSEG_GATHERS
  const hn::FixedTag<std::int32_t, 8> d;
  const hn::Rebind<std::int16_t, decltype(d)> d16;
  for (; i + 8 <= count; i += 8) {
    const auto value = hn::LoadU(d, reinterpret_cast<const std::int32_t*>(values) + i);
    auto shifted = hn::ShiftRight<2>(value), octave = hn::Zero(d);
    // To nine bits.
    const auto take = [&](std::int32_t octaves) HWY_ATTR {
      const auto more =
          hn::And(hn::VecFromMask(d, hn::Gt(shifted, hn::Set(d, (256 << octaves) - 1))), hn::Set(d, octaves));
      shifted = hn::Shr(shifted, more);
      octave = hn::Add(octave, more);
    };
    take(8);
    take(4);
    take(2);
    take(1);
    const auto entry = hn::Add(hn::ShiftLeft<8>(octave), hn::Sub(shifted, hn::Set(d, 256)));
    const auto known = hn::VecFromMask(d, hn::Gt(value, hn::Zero(d)));
    // The gather reads four bytes at each index.
    const auto* base = reinterpret_cast<const std::int32_t*>(table);
    const auto pair = hn::GatherOffset(d, base, hn::And(known, hn::Add(entry, entry)));
    const auto first = hn::ShiftRight<16>(hn::ShiftLeft<16>(hn::And(known, pair)));
    hn::StoreU(hn::DemoteTo(d16, first), d16, out + i);
  }
#endif
  for (; i < count; ++i) {
    const int octave = static_cast<int>(std::bit_width(values[i] | 1024)) - 11;
    out[i] =
        values[i] ? table[octave * 256 + static_cast<int>(values[i] >> (octave + 2) & 255)] : std::int16_t{0};
  }
}

void spread(std::int32_t* __restrict values, const std::int32_t* __restrict places, int count) {
  // From both ends: the least value so far, as seen from place 0. The offset makes all numbers negative, so
  // that the 0 that a shift brings in is no minimum.
  constexpr std::int32_t offset = 1 << 30;
  std::int32_t least = 0;
  int i = 0;
#if HWY_TARGET != HWY_SCALAR
  const hn::CappedTag<std::int32_t, 4> d; // every target has four lanes
  const auto down = hn::Set(d, offset);
  auto carried = hn::Zero(d);
  for (; i + 4 <= count; i += 4) {
    const auto place = hn::Add(hn::LoadU(d, places + i), down);
    auto seen = hn::Sub(hn::LoadU(d, values + i), place);
    seen = hn::Min(seen, hn::ShiftLeftLanes<1>(d, seen));
    seen = hn::Min(hn::Min(seen, hn::ShiftLeftLanes<2>(d, seen)), carried);
    carried = hn::Broadcast<3>(seen);
    hn::StoreU(hn::Add(seen, place), d, values + i);
  }
  least = hn::GetLane(carried);
#endif
  for (; i < count; ++i) {
    least = std::min(least, values[i] - places[i] - offset);
    values[i] = least + places[i] + offset;
  }
#if HWY_TARGET != HWY_SCALAR
  carried = hn::Zero(d);
  for (; i >= 4; i -= 4) {
    const auto place = hn::Sub(hn::LoadU(d, places + i - 4), down);
    auto seen = hn::Add(hn::LoadU(d, values + i - 4), place);
    seen = hn::Min(seen, hn::ShiftRightLanes<1>(d, seen));
    seen = hn::Min(hn::Min(seen, hn::ShiftRightLanes<2>(d, seen)), carried);
    carried = hn::Broadcast<0>(seen);
    hn::StoreU(hn::Sub(seen, place), d, values + i - 4);
  }
  least = hn::GetLane(carried);
#else
  least = 0;
#endif
  for (; i > 0; --i) {
    least = std::min(least, values[i - 1] + places[i - 1] - offset);
    values[i - 1] = least - places[i - 1] + offset;
  }
}

} // namespace HWY_NAMESPACE
} // namespace terrainseg::kernels
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace terrainseg::kernels {

TERRAINSEG_DISPATCH(weigh_components, weigh_cells);
TERRAINSEG_DISPATCH(add_differences, add_pair_differences);
TERRAINSEG_DISPATCH(add_boxes, add_column_boxes);
TERRAINSEG_DISPATCH(sum_rows, sums_of_rows);
TERRAINSEG_DISPATCH(largest_steps, largest_steps_of_cells);
TERRAINSEG_DISPATCH(weigh_upright, upright_evidence);
TERRAINSEG_DISPATCH(color_steps, color_steps_between);
TERRAINSEG_DISPATCH(follow_row, follow_cells);
TERRAINSEG_DISPATCH(compare_looks, looks_compared);
TERRAINSEG_DISPATCH(pass_distances, distances_passed);
TERRAINSEG_DISPATCH(average_rows, means_over_rows);
TERRAINSEG_DISPATCH(average_columns, means_over_columns);
TERRAINSEG_DISPATCH(raise_penalties, penalties_raised);
TERRAINSEG_DISPATCH(smooth_row, smooth_cells);
TERRAINSEG_DISPATCH(strongest_edges, strongest_of_strip);
TERRAINSEG_DISPATCH(look_up_octaves, octaves_looked_up);
TERRAINSEG_DISPATCH(spread_least, spread);

} // namespace terrainseg::kernels
#endif
