// SPDX-License-Identifier: LGPL-2.1-or-later
#include "kernels/point_fit.hpp"

#include <algorithm>
#include <array>

#include "kernels/targets.hpp"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "kernels/point_fit.cpp"
#include <hwy/foreach_target.h>
// Must follow foreach_target.h.
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace terrainseg::kernels {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

// --- positions of points, and the picture there ---

std::int32_t difference_of(const Picture& picture, const PointMap& map, std::int64_t a, std::int64_t b,
                           std::int32_t value) {
  const auto [u, v] = map.at(a, b);
  if (u < 0 || v < 0 || u >> 8 >= picture.width - 1 || v >> 8 >= picture.height - 1)
    return no_difference;
  const std::uint8_t *at = picture.row(v >> 8) + (u >> 8), *under = at + picture.width;
  const int fu = u & 255, fv = v & 255;
  const int seen =
      ((at[0] * (256 - fu) + at[1] * fu) * (256 - fv) + (under[0] * (256 - fu) + under[1] * fu) * fv + 128) >>
      8;
  return seen - value;
}

int differences_plainly(const Picture& picture, const PointMap& map, const PointLists& points, int first,
                        int end, std::int32_t* differences) {
  int inside = 0;
  for (int i = first; i < end; ++i) {
    differences[i] = difference_of(picture, map, points.across[i], points.below[i], points.values[i]);
    inside += differences[i] != no_difference;
  }
  return inside;
}

#if TERRAINSEG_GATHERS
using Eight = hn::FixedTag<std::int32_t, 8>;
using Unsigned8 = hn::RebindToUnsigned<Eight>;
using Four = hn::FixedTag<std::int64_t, 4>;
using Unsigned4 = hn::FixedTag<std::uint64_t, 4>;

/// 2^48 / w to 8 bits for w from k 2^16 on.
constexpr auto first_reciprocals = [] {
  std::array<std::int32_t, 512> table{};
  for (std::int64_t k = 0; k < 512; ++k)
    table[k] = static_cast<std::int32_t>((std::int64_t{1} << 48) / ((k << 16) + (1 << 15)));
  return table;
}();

/// Moves the second number of each pair to the place of the first.
HWY_INLINE hn::Vec<Eight> odd_of(hn::Vec<Eight> numbers) {
  return hn::BitCast(Eight(), hn::ShiftRight<32>(hn::BitCast(Unsigned4(), numbers)));
}
/// Combines the lower 32 bits of each number of two vectors.
HWY_INLINE hn::Vec<Eight> lower_of(hn::Vec<Four> even, hn::Vec<Four> odd) {
  const Eight d;
  return hn::OddEven(hn::BitCast(d, hn::ShiftLeft<32>(odd)), hn::BitCast(d, even));
}
/// Combines the upper 32 bits.
HWY_INLINE hn::Vec<Eight> upper_of(hn::Vec<Four> even, hn::Vec<Four> odd) {
  const Eight d;
  return hn::OddEven(hn::BitCast(d, odd), odd_of(hn::BitCast(d, even)));
}

/// 2^48 / w, rounded down, for w in 2^23 .. 2^25 - 1: Newton's method from below. The last step's result is
/// right or too low by one.
HWY_INLINE hn::Vec<Eight> reciprocal_of(hn::Vec<Eight> w) {
  const Eight d;
  const Four d64;
  const auto one = hn::Set(d64, std::int64_t{1} << 48);
  const auto w_odd = odd_of(w);
  // Near 2^24, as for all small motions, 2^25 - w is close enough: less than 2^48 / w by (1 - w / 2^24)^2 of
  // it.
  auto r = hn::Sub(hn::Set(d, 1 << 25), w);
  if (!hn::AllTrue(d, hn::Lt(hn::Abs(hn::Sub(r, w)), hn::Set(d, (1 << 25) / 9))))
    r = hn::GatherIndex(d, first_reciprocals.data(), hn::ShiftRight<16>(w));
  for (int k = 0; k < 2; ++k) {
    const auto r_odd = odd_of(r);
    const auto step = [&](auto wide_w, auto wide_r) HWY_ATTR {
      const auto left = hn::Sub(one, hn::MulEven(wide_w, wide_r)); // below 2^42: 32 bits from the 17th on
      const auto part = hn::BitCast(d, hn::ShiftRight<16>(hn::BitCast(Unsigned4(), left)));
      return hn::MulEven(part, wide_r);
    };
    r = hn::Add(r, upper_of(step(w, r), step(w_odd, r_odd)));
  }
  // 2^48 - w r is below 2 w.
  const auto left = hn::Sub(hn::Zero(d), hn::Mul(w, r));
  return hn::Sub(r, hn::VecFromMask(d, hn::Gt(hn::Add(left, hn::Set(d, 1)), w)));
}

/// Maps eight points. Returns false and does nothing when one of them does not fit 32 bits.
HWY_INLINE bool map_eight(const PointMap& map, hn::Vec<Eight> a, hn::Vec<Eight> b, hn::Vec<Eight>& u,
                          hn::Vec<Eight>& v) {
  const Eight d;
  const Four d64;
  const Unsigned4 u64;
  const auto a_odd = odd_of(a), b_odd = odd_of(b);
  const auto number = [&](std::int64_t factor) HWY_ATTR { return hn::BitCast(d, hn::Set(d64, factor)); };
  const auto w0 = number(map.across_w), w1 = number(map.below_w);
  const auto w_offset = hn::Set(d64, map.w_offset);
  const auto w_even = hn::Add(hn::Add(hn::MulEven(w0, a), hn::MulEven(w1, b)), w_offset),
             w_uneven = hn::Add(hn::Add(hn::MulEven(w0, a_odd), hn::MulEven(w1, b_odd)), w_offset);
  // From 2^39 to 2^41.
  const auto beyond = [&](auto even, auto odd, std::int64_t least, auto shifted) HWY_ATTR {
    const auto from = hn::Set(d64, least);
    return hn::Or(shifted(hn::BitCast(u64, hn::Sub(even, from))),
                  shifted(hn::BitCast(u64, hn::Sub(odd, from))));
  };
  auto flaws = beyond(w_even, w_uneven, 0, [](auto v) HWY_ATTR { return hn::ShiftRight<41>(v); });
  const auto place = [&](std::int64_t by_across, std::int64_t by_below, std::int64_t offset) HWY_ATTR {
    const auto g0 = number(by_across), g1 = number(by_below);
    const auto from = hn::Set(d64, offset);
    const auto even = hn::Add(hn::Add(hn::ShiftLeft<7>(hn::MulEven(g0, a)), hn::MulEven(g1, b)), from),
               odd = hn::Add(hn::Add(hn::ShiftLeft<7>(hn::MulEven(g0, a_odd)), hn::MulEven(g1, b_odd)), from);
    flaws = hn::Or(flaws, beyond(even, odd, -(std::int64_t{1} << 43),
                                 [](auto v) HWY_ATTR { return hn::ShiftRight<44>(v); }));
    return lower_of(hn::BitCast(d64, hn::ShiftRight<12>(hn::BitCast(u64, even))),
                    hn::BitCast(d64, hn::ShiftRight<12>(hn::BitCast(u64, odd))));
  };
  const auto x = place(map.g0, map.g1, map.x_offset), y = place(map.g3, map.g4, map.y_offset);
  const auto w = lower_of(hn::BitCast(d64, hn::ShiftRight<16>(hn::BitCast(u64, w_even))),
                          hn::BitCast(d64, hn::ShiftRight<16>(hn::BitCast(u64, w_uneven))));
  if (!hn::AllTrue(u64, hn::Eq(flaws, hn::Zero(u64))) ||
      !hn::AllTrue(d, hn::Gt(w, hn::Set(d, (1 << 23) - 1))))
    return false;
  const auto r = reciprocal_of(w), r_odd = odd_of(r);
  const auto position = [&](auto at, std::int32_t middle) HWY_ATTR {
    const auto product = upper_of(hn::MulEven(at, r), hn::MulEven(odd_of(at), r_odd));
    return hn::Add(hn::ShiftRight<4>(product), hn::Set(d, middle));
  };
  u = position(x, map.middle);
  v = position(y, map.line);
  return true;
}

/// The differences of eight points at (u, v). Returns false and does nothing near the end of the picture.
HWY_INLINE bool differences_of_eight(const Picture& picture, const PointLists& points, int i,
                                     hn::Vec<Eight> u, hn::Vec<Eight> v, std::int32_t* differences,
                                     int& inside) {
  const Eight d;
  const auto column = hn::ShiftRight<8>(u), row = hn::ShiftRight<8>(v);
  const auto width = hn::Set(d, picture.width);
  const auto least = hn::Min(column, row);
  const auto room =
      hn::Min(hn::Sub(hn::Set(d, picture.width - 2), column), hn::Sub(hn::Set(d, picture.height - 2), row));
  const auto seen = hn::Gt(hn::Min(least, room), hn::Set(d, -1));
  const auto at = hn::IfThenElseZero(seen, hn::Add(hn::Mul(row, width), column));
  // Four bytes are read at each place.
  if (!hn::AllTrue(d, hn::Lt(at, hn::Set(d, picture.width * (picture.height - 1) - 3))))
    return false;
  const auto* base = reinterpret_cast<const std::int32_t*>(picture.pixels);
  const auto byte = hn::Set(d, 255);
  const auto fu = hn::And(u, byte), fv = hn::And(v, byte);
  const auto mix = [&](auto four) HWY_ATTR {
    const auto first = hn::And(four, byte), second = hn::And(hn::ShiftRight<8>(four), byte);
    return hn::Add(hn::ShiftLeft<8>(first), hn::Mul(hn::Sub(second, first), fu));
  };
  const auto upper = mix(hn::GatherOffset(d, base, at)),
             lower = mix(hn::GatherOffset(d, base, hn::Add(at, width)));
  const auto sum = hn::Add(hn::ShiftLeft<8>(upper), hn::Mul(hn::Sub(lower, upper), fv));
  const auto value = hn::ShiftRight<8>(hn::Add(sum, hn::Set(d, 128)));
  hn::StoreU(hn::IfThenElse(seen, hn::Sub(value, hn::LoadU(d, points.values + i)), hn::Set(d, no_difference)),
             d, differences + i);
  inside += static_cast<int>(hn::CountTrue(d, seen));
  return true;
}

bool fits(std::int64_t number) {
  return number >= INT32_MIN && number <= INT32_MAX;
}
#endif

int differences_of(const Picture& picture, const PointMap& map, const PointLists& points,
                   std::int32_t* differences) {
  int inside = 0, i = 0;
#if TERRAINSEG_GATHERS
  // Positions first, then pixels: the processor then works on several groups of points at once, while the
  // look-ups of one group wait. Positions beyond `outside` are not in the picture either.
  constexpr int at_once = 64;
  const Eight d;
  const int vectors = fits(map.across_w) && fits(map.below_w) ? points.count / 8 * 8 : 0;
  while (i < vectors) {
    const int first = i, end = std::min(first + at_once, vectors);
    alignas(32) std::int32_t us[at_once], vs[at_once];
    bool mapped[at_once / 8];
    for (int k = first; k < end; k += 8) {
      hn::Vec<Eight> u = hn::Zero(d), v = hn::Zero(d);
      mapped[(k - first) / 8] =
          map_eight(map, hn::LoadU(d, points.across + k), hn::LoadU(d, points.below + k), u, v);
      hn::Store(u, d, us + (k - first));
      hn::Store(v, d, vs + (k - first));
    }
    for (; i < end; i += 8)
      if (!mapped[(i - first) / 8] ||
          !differences_of_eight(picture, points, i, hn::Load(d, us + (i - first)),
                                hn::Load(d, vs + (i - first)), differences, inside))
        inside += differences_plainly(picture, map, points, i, i + 8, differences);
  }
#endif
  return inside + differences_plainly(picture, map, points, i, points.count, differences);
}

void map_plainly(const PointMap& map, const std::int32_t* across, std::int32_t below, int first, int end,
                 std::int32_t* positions) {
  for (int i = first; i < end; ++i) {
    const auto [u, v] = map.at(across[i], below);
    positions[2 * i] = u;
    positions[2 * i + 1] = v;
  }
}

void map_all(const PointMap& map, const std::int32_t* across, std::int32_t below, int count,
             std::int32_t* positions) {
  int i = 0;
#if TERRAINSEG_GATHERS
  const Eight d;
  const auto outside = hn::Set(d, map.outside), beyond = hn::Neg(outside);
  const auto limited = [&](auto at) HWY_ATTR { return hn::Min(hn::Max(at, beyond), outside); };
  if (fits(map.across_w) && fits(map.below_w))
    for (; i + 8 <= count; i += 8) {
      hn::Vec<Eight> u, v;
      if (map_eight(map, hn::LoadU(d, across + i), hn::Set(d, below), u, v))
        hn::StoreInterleaved2(limited(u), limited(v), d, positions + 2 * i);
      else
        map_plainly(map, across, below, i, i + 8, positions);
    }
#endif
  map_plainly(map, across, below, i, count, positions);
}

// --- weights and sums ---

// Auto-vectorised.
int count_of_small(const std::int32_t* differences, int count, std::int32_t limit) {
  std::int32_t small = 0;
  for (int i = 0; i < count; ++i)
    small += differences[i] < limit && differences[i] > -limit ? 1 : 0;
  return small;
}

void weights_of(const std::int32_t* __restrict differences, int count, std::int32_t per_index,
                const std::int32_t* __restrict table, std::int32_t* __restrict weights) {
  constexpr std::int32_t most = 1 << 16;
  int i = 0;
#if TERRAINSEG_GATHERS
  const Eight d;
  for (; i + 8 <= count; i += 8) {
    const auto size = hn::Abs(hn::LoadU(d, differences + i)), limit = hn::Set(d, most);
    const auto index = hn::ShiftRight<16>(hn::Mul(hn::Min(size, limit), hn::Set(d, per_index)));
    const auto last = hn::Set(d, 64);
    const auto bounded = hn::IfThenElse(hn::Gt(size, limit), last, hn::Min(index, last));
    hn::StoreU(hn::GatherIndex(d, table, bounded), d, weights + i);
  }
#endif
  for (; i < count; ++i) {
    const std::int32_t e = differences[i], size = e < 0 ? -e : e, near = size < most ? size : most;
    const std::int32_t index = (near * per_index) >> 16, nearer = index < 64 ? index : 64;
    weights[i] = table[size > most ? 64 : nearer];
  }
  for (; i % points_together != 0; ++i)
    weights[i] = 0;
}

#if (HWY_ARCH_X86 && HWY_TARGET != HWY_SCALAR) || HWY_TARGET == HWY_NEON
using Narrow = hn::CappedTag<std::int32_t, points_together>;
using Wide = hn::RepartitionToWide<Narrow>;

#if HWY_TARGET == HWY_NEON
/// NEON multiplies the lower and the upper halves of two vectors and adds the products.
using Halves = hn::Vec<Narrow>;
HWY_INLINE Halves halves_of(hn::Vec<Narrow> numbers) {
  return numbers;
}
HWY_INLINE void add_product(hn::Vec<Wide>& sum, Halves a, Halves b) {
  sum.raw = vmlal_high_s32(vmlal_s32(sum.raw, vget_low_s32(a.raw), vget_low_s32(b.raw)), a.raw, b.raw);
}
#else
/// Every second number: the first or the second of each pair.
struct Halves {
  hn::Vec<Narrow> even, odd;
};
HWY_INLINE Halves halves_of(hn::Vec<Narrow> numbers) {
  const Narrow narrow;
  const hn::RebindToUnsigned<Wide> pairs;
  return {numbers, hn::BitCast(narrow, hn::ShiftRight<32>(hn::BitCast(pairs, numbers)))};
}
HWY_INLINE void add_product(hn::Vec<Wide>& sum, const Halves& a, const Halves& b) {
  sum = hn::Add(sum, hn::Add(hn::MulEven(a.even, b.even), hn::MulEven(a.odd, b.odd)));
}
#endif

/// Computes rows first .. end - 1 of the sums, as many as fit the registers.
template <int first, int end>
void rows_of_sums(const FitLists& lists, std::int64_t* left, std::int64_t* right) {
  const Narrow narrow;
  const Wide wide;
  constexpr int rows = end - first;
  const auto zero = hn::Zero(wide);
  hn::Vec<Wide> sums[rows][end];
  hn::Vec<Wide> explained[rows];
#pragma GCC unroll 8
  for (int r = 0; r < rows; ++r) {
    explained[r] = zero;
#pragma GCC unroll 8
    for (int c = 0; c < end; ++c)
      sums[r][c] = zero;
  }
  const int together = static_cast<int>(hn::Lanes(narrow));
  for (int i = 0; i < lists.count; i += together) {
    const auto weight = hn::LoadU(narrow, lists.weights + i);
    const Halves difference = halves_of(hn::LoadU(narrow, lists.differences + i));
    Halves weighted[rows];
#pragma GCC unroll 8
    for (int r = 0; r < rows; ++r) {
      weighted[r] =
          halves_of(hn::Mul(weight, hn::LoadU(narrow, lists.derivatives + (first + r) * lists.stride + i)));
      add_product(explained[r], weighted[r], difference);
    }
#pragma GCC unroll 8
    for (int c = 0; c < end; ++c) {
      const Halves column = halves_of(hn::LoadU(narrow, lists.derivatives + c * lists.stride + i));
#pragma GCC unroll 8
      for (int r = 0; r < rows; ++r)
        if (c <= first + r)
          add_product(sums[r][c], weighted[r], column);
    }
  }
  for (int r = 0; r < rows; ++r) {
    right[first + r] = hn::GetLane(hn::SumOfLanes(wide, explained[r]));
    for (int c = 0; c <= first + r; ++c)
      left[(first + r) * (first + r + 1) / 2 + c] = hn::GetLane(hn::SumOfLanes(wide, sums[r][c]));
  }
}

void sums_of(const FitLists& lists, int unknowns, std::int64_t* left, std::int64_t* right) {
  rows_of_sums<0, 3>(lists, left, right);
  rows_of_sums<3, 5>(lists, left, right);
  rows_of_sums<5, 6>(lists, left, right);
  if (unknowns > 6)
    rows_of_sums<6, 7>(lists, left, right);
}
#else
void sums_of(const FitLists& lists, int unknowns, std::int64_t* left, std::int64_t* right) {
  const std::int32_t* __restrict weights = lists.weights, * __restrict differences = lists.differences;
  for (int row = 0; row < unknowns; ++row) {
    const std::int32_t* __restrict mine = lists.derivatives + row * lists.stride;
    std::int64_t explained = 0;
    for (int i = 0; i < lists.count; ++i)
      explained += std::int64_t{weights[i] * mine[i]} * differences[i];
    right[row] = explained;
    for (int column = 0; column <= row; ++column) {
      const std::int32_t* __restrict other = lists.derivatives + column * lists.stride;
      std::int64_t sum = 0;
      for (int i = 0; i < lists.count; ++i)
        sum += std::int64_t{weights[i] * mine[i]} * other[i];
      *left++ = sum;
    }
  }
}
#endif

} // namespace HWY_NAMESPACE
} // namespace terrainseg::kernels
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace terrainseg::kernels {

TERRAINSEG_DISPATCH(point_differences, differences_of);
TERRAINSEG_DISPATCH(map_row, map_all);
TERRAINSEG_DISPATCH(count_below, count_of_small);
TERRAINSEG_DISPATCH(fit_weights, weights_of);
TERRAINSEG_DISPATCH(fit_sums, sums_of);

} // namespace terrainseg::kernels
#endif
