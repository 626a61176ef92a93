// SPDX-License-Identifier: LGPL-2.1-or-later
#include "kernels/reduce.hpp"

#include <algorithm>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "kernels/reduce.cpp"
#include <hwy/foreach_target.h>
// After foreach_target.h, as Highway demands.
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace terrainseg::kernels {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

constexpr int reflect_101(int i, int size) {
  if (size == 1)
    return 0;
  while (i < 0 || i >= size)
    i = i < 0 ? -i : 2 * size - 2 - i;
  return i;
}

// One finished sum and what waits after it; the vector code below is this, many at a time.
HWY_INLINE std::uint8_t advance(int odd, int even, std::uint16_t& partial, std::uint16_t& held) {
  const int sum = partial + 4 * odd + even;
  partial = static_cast<std::uint16_t>(held + 4 * odd + 6 * even);
  held = static_cast<std::uint16_t>(even);
  return static_cast<std::uint8_t>((sum + 128) >> 8);
}

// 11 and 16 times the largest horizontal sum: nothing leaves 16 bits.
static_assert(16 * 16 * 255 + 128 <= 65535);

template <int step> HWY_INLINE int horizontal(const std::uint8_t* row, int p) {
  return row[p - 2 * step] + row[p + 2 * step] + 4 * (row[p - step] + row[p + step]) + 6 * row[p];
}

template <int step> int horizontal_at_edge(const std::uint8_t* row, int x, int width, int channel) {
  const auto at = [&](int i) { return int{row[reflect_101(i, width) * step + channel]}; };
  return at(x - 2) + at(x + 2) + 4 * (at(x - 1) + at(x + 1)) + 6 * at(x);
}

template <int step, int written>
void plain_pixels(const std::uint8_t* odd, const std::uint8_t* even, int first, int last,
                  const Waiting& waiting, std::uint8_t* out) {
  for (int x = first; x < last; ++x)
    for (int c = 0; c < step; ++c) {
      const int i = x * written + c, p = 2 * x * step + c;
      out[i] =
          advance(horizontal<step>(odd, p), horizontal<step>(even, p), waiting.partial[i], waiting.held[i]);
    }
}

template <int step, int written>
void edge_pixel(const std::uint8_t* odd, const std::uint8_t* even, int x, int width, const Waiting& waiting,
                std::uint8_t* out) {
  for (int c = 0; c < step; ++c) {
    const int i = x * written + c;
    out[i] = advance(horizontal_at_edge<step>(odd, 2 * x, width, c),
                     horizontal_at_edge<step>(even, 2 * x, width, c), waiting.partial[i], waiting.held[i]);
  }
}

#if HWY_TARGET != HWY_SCALAR

// Products of neighbouring bytes with two weights, summed: 16-bit lanes. x86 has this as one instruction
// that Highway 1.0 does not offer.
#if HWY_ARCH_X86
template <std::size_t n> HWY_INLINE auto weighted_pairs(hn::Vec128<std::uint8_t, n> v, std::int16_t weights) {
  return hn::Vec128<std::uint16_t, n / 2>{_mm_maddubs_epi16(v.raw, _mm_set1_epi16(weights))};
}
#if HWY_TARGET <= HWY_AVX2
HWY_INLINE auto weighted_pairs(hn::Vec256<std::uint8_t> v, std::int16_t weights) {
  return hn::Vec256<std::uint16_t>{_mm256_maddubs_epi16(v.raw, _mm256_set1_epi16(weights))};
}
#endif
#if HWY_TARGET <= HWY_AVX3
HWY_INLINE auto weighted_pairs(hn::Vec512<std::uint8_t> v, std::int16_t weights) {
  return hn::Vec512<std::uint16_t>{_mm512_maddubs_epi16(v.raw, _mm512_set1_epi16(weights))};
}
#endif
template <class D16, class V8> HWY_INLINE auto pairs_6_4(D16, V8 v) {
  return weighted_pairs(v, 0x0406);
}
template <class D16, class V8> HWY_INLINE auto pairs_1_4(D16, V8 v) {
  return weighted_pairs(v, 0x0401);
}
#else
template <class D16, class V8> HWY_INLINE auto pairs_6_4(D16 d16, V8 v) {
  const auto w = hn::BitCast(d16, v);
  const auto first = hn::And(w, hn::Set(d16, 255)), second = hn::ShiftRight<8>(w);
  return hn::Add(hn::Add(first, first), hn::ShiftLeft<2>(hn::Add(first, second)));
}
template <class D16, class V8> HWY_INLINE auto pairs_1_4(D16 d16, V8 v) {
  const auto w = hn::BitCast(d16, v);
  return hn::Add(hn::And(w, hn::Set(d16, 255)), hn::ShiftLeft<2>(hn::ShiftRight<8>(w)));
}
#endif

// Bytes of two neighbouring pixels brought together, channel by channel; 0x80 gives 0.
alignas(16) constexpr std::uint8_t pairing_of_2[16] = {0, 2, 1, 3, 4, 6, 5, 7, 8, 10, 9, 11, 12, 14, 13, 15};
alignas(16) constexpr std::uint8_t pairing_of_4[16] = {0, 4, 1, 5, 2, 6, 3, 7, 8, 12, 9, 13, 10, 14, 11, 15};
alignas(16) constexpr std::uint8_t pairing_of_3[16] = {0, 3, 1, 4,  2, 5,  0x80, 0x80,
                                                       6, 9, 7, 10, 8, 11, 0x80, 0x80};

// Reads two pixels for each 16-bit sum, paired. For three-byte pixels a vector is 3/4 used; the upper half of
// a block is read a quarter early, so that no byte past the pixels is touched.
template <int step, class D8> struct Reader {
  using D32 = hn::Repartition<std::uint32_t, D8>;
  D8 d8;
  decltype(hn::LoadDup128(D8(), pairing_of_2)) order =
      hn::LoadDup128(D8(), step == 2 ? pairing_of_2 : (step == 3 ? pairing_of_3 : pairing_of_4));
  decltype(hn::IndicesFromVec(D32(), hn::Zero(D32()))) lower, upper;

  explicit Reader(D8 d) : d8(d), lower(spread(0)), upper(spread(hn::Lanes(D8()) / 16)) {}

  static auto spread(std::size_t from) {
    HWY_ALIGN std::uint32_t index[hn::MaxLanes(D32())];
    for (std::size_t i = 0; i < hn::Lanes(D32()); ++i)
      index[i] = static_cast<std::uint32_t>(from + i / 4 * 3 + std::min<std::size_t>(i % 4, 2));
    return hn::SetTableIndices(D32(), index);
  }

  HWY_INLINE hn::Vec<D8> read(const std::uint8_t* p, bool upper_half) const {
    if constexpr (step == 1) {
      return hn::LoadU(d8, p);
    } else if constexpr (step == 3) {
      const std::size_t early = upper_half ? hn::Lanes(d8) / 4 : 0;
      const auto dwords = hn::BitCast(D32(), hn::LoadU(d8, p - early));
      const auto spread_out = hn::BitCast(d8, hn::TableLookupLanes(dwords, upper_half ? upper : lower));
      return hn::TableLookupBytesOr0(spread_out, order);
    } else {
      return hn::TableLookupBytes(hn::LoadU(d8, p), order);
    }
  }

  // 1-4-6-4-1 around each even pixel from `p` on.
  template <class D16> HWY_INLINE hn::Vec<D16> sums(D16 d16, const std::uint8_t* p, bool upper_half) const {
    const auto before = read(p - 2 * step, upper_half);
    const auto here = read(p, upper_half);
    const auto after = hn::BitCast(d16, read(p + 2 * step, upper_half));
    return hn::Add(hn::Add(pairs_1_4(d16, before), pairs_6_4(d16, here)), hn::And(after, hn::Set(d16, 255)));
  }
};

template <class D16> struct Advanced { hn::Vec<D16> sum, partial, held; };

template <class D16>
HWY_INLINE Advanced<D16> advance(D16 d16, hn::Vec<D16> odd, hn::Vec<D16> even, const std::uint16_t* partial,
                                 const std::uint16_t* held) {
  const auto four_odd = hn::ShiftLeft<2>(odd);
  const auto sum = hn::Add(hn::Add(hn::LoadU(d16, partial), four_odd), even);
  const auto six_even = hn::Add(hn::ShiftLeft<2>(even), hn::Add(even, even));
  return {sum, hn::Add(hn::Add(hn::LoadU(d16, held), four_odd), six_even), even};
}

template <class D16> HWY_INLINE void keep(D16 d16, const Advanced<D16>& a, const Waiting& w, std::size_t i) {
  hn::StoreU(a.partial, d16, w.partial + i);
  hn::StoreU(a.held, d16, w.held + i);
}

// The pixels first..last-1, none of which touches an edge; false when they are fewer than a vector. The last
// block overlaps the one before it: it is computed first, from sums that are still old, and stored last.
template <int step, int written, class D8>
HWY_INLINE bool vector_pixels(D8 d8, const std::uint8_t* odd, const std::uint8_t* even, int first, int last,
                              const Waiting& waiting, std::uint8_t* out) {
  const hn::Repartition<std::uint16_t, D8> d16;
  const std::size_t block = hn::Lanes(d8), half = block / 2;
  const std::size_t count = static_cast<std::size_t>(std::max(0, last - first)) * written;
  if (count < block)
    return false;
  const Reader<step, D8> reader(d8);
  const Waiting w{waiting.partial + first * written, waiting.held + first * written};
  odd += 2 * first * step;
  even += 2 * first * step;
  out += first * written;
  const auto source = [](std::size_t i) { return i * 2 / written * step; };

  const auto lower = [&](std::size_t i) HWY_ATTR {
    return advance(d16, reader.sums(d16, odd + source(i), false), reader.sums(d16, even + source(i), false),
                   w.partial + i, w.held + i);
  };
  const auto upper = [&](std::size_t i) HWY_ATTR {
    const std::size_t j = i + half;
    return advance(d16, reader.sums(d16, odd + source(j), true), reader.sums(d16, even + source(j), true),
                   w.partial + j, w.held + j);
  };
  const auto finish = [&](const Advanced<hn::Repartition<std::uint16_t, D8>>& lo,
                          const Advanced<hn::Repartition<std::uint16_t, D8>>& hi, std::size_t i) HWY_ATTR {
    const auto rounding = hn::Set(d16, 128);
    const auto a = hn::BitCast(d8, hn::Add(lo.sum, rounding)), b = hn::BitCast(d8, hn::Add(hi.sum, rounding));
    hn::StoreU(hn::ConcatOdd(d8, b, a), d8, out + i);
    keep(d16, lo, w, i);
    keep(d16, hi, w, i + half);
  };

  const std::size_t tail = count - block;
  const auto tail_lower = lower(tail), tail_upper = upper(tail);
  for (std::size_t i = 0; i < tail; i += block) {
    const auto lo = lower(i), hi = upper(i);
    finish(lo, hi, i);
  }
  finish(tail_lower, tail_upper, tail);
  return true;
}

#endif

template <int step, int written>
void reduce_row(const std::uint8_t* odd, const std::uint8_t* even, int width, const Waiting& waiting,
                std::uint8_t* out) {
  const int half = (width + 1) / 2;
  // The last pixel whose pair and whose right neighbour's pair are whole.
  const int inner = std::max(1, width / 2 - 1);
  edge_pixel<step, written>(odd, even, 0, width, waiting, out);
  bool done = false;
#if HWY_TARGET != HWY_SCALAR
  const hn::CappedTag<std::uint8_t, 64> widest;
  const hn::CappedTag<std::uint8_t, 32> wide;
  const hn::CappedTag<std::uint8_t, 16> narrow;
  done = vector_pixels<step, written>(widest, odd, even, 1, inner, waiting, out);
  if constexpr (hn::MaxLanes(widest) > hn::MaxLanes(wide))
    done = done || vector_pixels<step, written>(wide, odd, even, 1, inner, waiting, out);
  if constexpr (hn::MaxLanes(wide) > hn::MaxLanes(narrow))
    done = done || vector_pixels<step, written>(narrow, odd, even, 1, inner, waiting, out);
#endif
  if (!done)
    plain_pixels<step, written>(odd, even, 1, inner, waiting, out);
  for (int x = inner; x < half; ++x)
    edge_pixel<step, written>(odd, even, x, width, waiting, out);
  if constexpr (written > step)
    if (!done)
      for (int x = 0; x < half; ++x)
        out[x * written + step] = 0;
}

void reduce(Interleave interleave, const std::uint8_t* odd, const std::uint8_t* even, int width,
            const Waiting& waiting, std::uint8_t* out) {
  switch (interleave) {
  case Interleave::one:
    return reduce_row<1, 1>(odd, even, width, waiting, out);
  case Interleave::two:
    return reduce_row<2, 2>(odd, even, width, waiting, out);
  case Interleave::three:
    return reduce_row<3, 4>(odd, even, width, waiting, out);
  case Interleave::four:
    return reduce_row<4, 4>(odd, even, width, waiting, out);
  }
}

void reduce_vertically(const std::uint8_t* odd, const std::uint8_t* even, int bytes, const Waiting& w,
                       std::uint8_t* out) {
  const std::size_t count = static_cast<std::size_t>(bytes);
  std::size_t i = 0;
#if HWY_TARGET != HWY_SCALAR
  const hn::CappedTag<std::uint8_t, 64> d8;
  const hn::Repartition<std::uint16_t, decltype(d8)> d16;
  const hn::Half<decltype(d8)> dh;
  const hn::Repartition<std::int16_t, decltype(d8)> di16;
  const std::size_t n = hn::Lanes(d16);
  for (; i + n <= count; i += n) {
    const auto a = advance(d16, hn::PromoteTo(d16, hn::LoadU(dh, odd + i)),
                           hn::PromoteTo(d16, hn::LoadU(dh, even + i)), w.partial + i, w.held + i);
    const auto rounded = hn::ShiftRight<4>(hn::Add(a.sum, hn::Set(d16, 8)));
    hn::StoreU(hn::DemoteTo(dh, hn::BitCast(di16, rounded)), dh, out + i);
    keep(d16, a, w, i);
  }
#endif
  for (; i < count; ++i) {
    const int sum = w.partial[i] + 4 * odd[i] + even[i];
    w.partial[i] = static_cast<std::uint16_t>(w.held[i] + 4 * odd[i] + 6 * even[i]);
    w.held[i] = even[i];
    out[i] = static_cast<std::uint8_t>((sum + 8) >> 4);
  }
}

void split(const std::uint8_t* row, int width, bool luma_first, std::uint8_t* luma, std::uint8_t* chroma) {
  const std::size_t bytes = static_cast<std::size_t>((width + 1) / 2) * 2;
  std::uint8_t* first = luma_first ? luma : chroma;
  std::uint8_t* second = luma_first ? chroma : luma;
  std::size_t i = 0;
#if HWY_TARGET != HWY_SCALAR
  const hn::CappedTag<std::uint8_t, 64> d8;
  const std::size_t n = hn::Lanes(d8);
  if (bytes >= n)
    for (;;) {
      const auto a = hn::LoadU(d8, row + 2 * i), b = hn::LoadU(d8, row + 2 * i + n);
      hn::StoreU(hn::ConcatEven(d8, b, a), d8, first + i);
      hn::StoreU(hn::ConcatOdd(d8, b, a), d8, second + i);
      if (i + n >= bytes)
        return;
      i = std::min(i + n, bytes - n);
    }
#endif
  for (; i < bytes; ++i) {
    first[i] = row[2 * i];
    second[i] = row[2 * i + 1];
  }
}

void pick_bytes(const std::uint8_t* row, int offset, int step, int count, std::uint8_t* out) {
  if (step == 2)
    for (int i = 0; i < count; ++i)
      out[i] = row[2 * i + offset];
  else
    for (int i = 0; i < count; ++i)
      out[i] = row[4 * i + offset];
}

} // namespace HWY_NAMESPACE
} // namespace terrainseg::kernels
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace terrainseg::kernels {

HWY_EXPORT(reduce);
HWY_EXPORT(reduce_vertically);
HWY_EXPORT(split);
HWY_EXPORT(pick_bytes);

void reduce_pair(Interleave interleave, const std::uint8_t* odd, const std::uint8_t* even, int width,
                 const Waiting& waiting, std::uint8_t* out) {
  HWY_DYNAMIC_DISPATCH(reduce)(interleave, odd, even, width, waiting, out);
}

void reduce_pair_vertically(const std::uint8_t* odd, const std::uint8_t* even, int bytes,
                            const Waiting& waiting, std::uint8_t* out) {
  HWY_DYNAMIC_DISPATCH(reduce_vertically)(odd, even, bytes, waiting, out);
}

void split_422(const std::uint8_t* row, int width, bool luma_first, std::uint8_t* luma,
               std::uint8_t* chroma) {
  HWY_DYNAMIC_DISPATCH(split)(row, width, luma_first, luma, chroma);
}

void pick(const std::uint8_t* row, int offset, int step, int count, std::uint8_t* out) {
  HWY_DYNAMIC_DISPATCH(pick_bytes)(row, offset, step, count, out);
}

} // namespace terrainseg::kernels
#endif
