// SPDX-License-Identifier: LGPL-2.1-or-later
#include "kernels/reduce.hpp"

#include <algorithm>
#include <cstdlib>
#include <cstring>

#include "kernels/targets.hpp"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "kernels/reduce.cpp"
#include <hwy/foreach_target.h>
// Must follow foreach_target.h.
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace terrainseg::kernels {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

// Finishes one sum and updates the waiting ones. The vector code below does the same for many sums. All
// values are 16 bits wide, because Clang 14 would use wider vectors for wider ones.
HWY_INLINE std::uint8_t advance(std::uint16_t odd, std::uint16_t even, std::uint16_t& partial,
                                std::uint16_t& held) {
  const std::uint16_t four_odd = 4 * odd, sum = partial + four_odd + even + 128;
  partial = held + four_odd + 6 * even;
  held = even;
  return static_cast<std::uint8_t>(sum >> 8);
}

// At most 11 and 16 times the largest horizontal sum, which fits 16 bits.
static_assert(16 * 16 * 255 + 128 <= 65535);

// 1-4-6-4-1 around the even pixel at `p`, inside a row and at its ends.
template <int step> HWY_INLINE std::uint16_t horizontal(const std::uint8_t* p) {
  return p[-2 * step] + p[2 * step] + 4 * (p[-step] + p[step]) + 6 * p[0];
}

template <int step> HWY_INLINE std::uint16_t horizontal_at_left(const std::uint8_t* p) {
  return 2 * p[2 * step] + 8 * p[step] + 6 * p[0];
}

// The last even pixel has a right neighbour when the width of the row is even.
template <int step> HWY_INLINE std::uint16_t horizontal_at_right(const std::uint8_t* p, bool has_right) {
  return has_right ? p[-2 * step] + 4 * (p[-step] + p[step]) + 7 * p[0]
                   : 2 * p[-2 * step] + 8 * p[-step] + 6 * p[0];
}

template <int step> HWY_INLINE std::uint16_t horizontal_in_narrow(const std::uint8_t* row, int x, int width) {
  const auto at = [&](int i) HWY_ATTR { return int{row[reflect_101(i, width) * step]}; };
  return at(x - 2) + at(x + 2) + 4 * (at(x - 1) + at(x + 1)) + 6 * at(x);
}

HWY_INLINE std::uint16_t pair_at(const std::uint8_t* p) {
  std::uint16_t pair;
  std::memcpy(&pair, p, sizeof pair);
  return little_endian(pair);
}

// The same sum for rows of one byte per pixel, read in pairs up to the right neighbour of the last pixel.
// Compilers vectorise this better than single bytes: two rows of 1920 take 0.4 us, and otherwise 0.55 us with
// GCC 12 and 1.6 us with Clang 14.
HWY_INLINE std::uint16_t horizontal_by_pairs(const std::uint8_t* p) {
  const std::uint16_t before = pair_at(p - 2), here = pair_at(p), after = pair_at(p + 2), centre = here & 255;
  const std::uint16_t outer = (before & 255) + (after & 255);
  const std::uint16_t inner = (before >> 8) + (here >> 8) + centre;
  return outer + 2 * centre + 4 * inner;
}

// The processor's own prefetch stops at page borders, which is every second row of a 1080p frame. Lines are
// prefetched while the sums are computed; a whole row at once would have to wait. The target is the
// second-level cache: 4K NV12 takes 1.7 ms, 2.0 ms with the first-level cache, and 2.35 ms without prefetch.
HWY_INLINE void ask_ahead(const std::uint8_t* at, std::size_t bytes) {
  constexpr std::size_t cache_line = 64;
  for (std::size_t i = 0; i < bytes; i += cache_line)
    __builtin_prefetch(at + i, 0, 2);
}

// Prefetches `bytes` bytes at `ahead` from two rows of `total` bytes, from byte `at` on. The processor's own
// prefetch helps where it sees one sequence of lines per page. Rows that share a page are therefore
// prefetched one after the other, the second from the middle on (1080p NV12 takes 0.36 ms instead of 0.41);
// longer rows are prefetched alternately (RGB 0.83 ms instead of 0.88).
class RowsAhead {
 public:
  HWY_INLINE RowsAhead(const std::uint8_t* odd, const std::uint8_t* even, std::ptrdiff_t ahead,
                       std::size_t at, std::size_t bytes, std::size_t total)
      : one_by_one_(2 * std::abs(even - odd) <= page), step_(one_by_one_ ? 2 * bytes : bytes) {
    if (one_by_one_) {
      first_ = ahead + (2 * at < total ? odd + 2 * at : even + (2 * at - total));
      second_ = first_ + bytes;
    } else {
      first_ = ahead + odd + at;
      second_ = ahead + even + at;
    }
  }
  HWY_INLINE bool one_by_one() const { return one_by_one_; } ///< for one row, up to its middle or from it
  HWY_INLINE void next(std::size_t bytes) {
    ask_ahead(first_, bytes);
    ask_ahead(second_, bytes);
    first_ += step_;
    second_ += step_;
  }

 private:
  static constexpr std::ptrdiff_t page = 4096;
  bool one_by_one_;
  std::size_t step_;
  const std::uint8_t *first_, *second_;
};

// Reduces the pixels first..last-1, which are not at an edge and whose right neighbours have complete pairs.
// The inner loop is auto-vectorised.
template <int step, int written>
void plain_pixels(const std::uint8_t* odd, const std::uint8_t* even, int first, int last,
                  std::ptrdiff_t ahead, const Waiting& waiting, std::uint8_t* __restrict out) {
  constexpr int at_once = 128;
  const auto sum = [](const std::uint8_t* p) HWY_ATTR {
    if constexpr (step == 1)
      return horizontal_by_pairs(p);
    else
      return horizontal<step>(p);
  };
  std::uint16_t* __restrict partial = waiting.partial;
  std::uint16_t* __restrict held = waiting.held;
  for (int from = first; from < last; from += at_once) {
    if (ahead != 0)
      RowsAhead(odd + 2 * first * step, even + 2 * first * step, ahead,
                static_cast<std::size_t>(2 * step * (from - first)), 2 * step * at_once,
                static_cast<std::size_t>(2 * step * (last - first)))
          .next(2 * step * at_once);
    const int end = std::min(from + at_once, last);
    for (int x = from; x < end; ++x)
      for (int c = 0; c < step; ++c) {
        const int i = x * written + c, p = 2 * x * step + c;
        out[i] = advance(sum(odd + p), sum(even + p), partial[i], held[i]);
      }
  }
}

// Separate from reduce_row(), in which GCC 12 for SVE fails with an internal error.
#undef TERRAINSEG_EDGE_INLINE
#if HWY_HAVE_SCALABLE
#define TERRAINSEG_EDGE_INLINE HWY_NOINLINE
#else
#define TERRAINSEG_EDGE_INLINE HWY_INLINE
#endif

// Reduces the pixel `x`. `sum` gives its horizontal sum in a row and channel, at the given byte.
template <int step, int written, class Sum>
TERRAINSEG_EDGE_INLINE void edge_pixel(const std::uint8_t* odd, const std::uint8_t* even, int x,
                                       const Waiting& waiting, std::uint8_t* out, const Sum& sum) {
  for (int c = 0; c < step; ++c) {
    const int i = x * written + c;
    out[i] = advance(sum(odd + c), sum(even + c), waiting.partial[i], waiting.held[i]);
  }
}

#if HWY_TARGET != HWY_SCALAR

// With AVX-512 too: two of three loads are not aligned, and of 64 bytes each of them spans two cache lines.
// On Zen 4 the pyramid of 480p takes 56 us, with vectors of 64 bytes 64.
using Widest = hn::CappedTag<std::uint8_t, 32>;

// Sums of the products of neighbouring bytes with two weights, in 16-bit lanes. x86 has an instruction for it
// that Highway 1.0 does not provide.
#if HWY_ARCH_X86 && HWY_TARGET <= HWY_SSSE3
template <std::size_t n> HWY_INLINE auto weighted_pairs(hn::Vec128<std::uint8_t, n> v, std::int16_t weights) {
  return hn::Vec128<std::uint16_t, n / 2>{_mm_maddubs_epi16(v.raw, _mm_set1_epi16(weights))};
}
#if HWY_TARGET <= HWY_AVX2
HWY_INLINE auto weighted_pairs(hn::Vec256<std::uint8_t> v, std::int16_t weights) {
  return hn::Vec256<std::uint16_t>{_mm256_maddubs_epi16(v.raw, _mm256_set1_epi16(weights))};
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

// Shuffles that pair the bytes of two neighbouring pixels by channel; 0x80 gives 0.
alignas(16) constexpr std::uint8_t pairing_of_2[16] = {0, 2, 1, 3, 4, 6, 5, 7, 8, 10, 9, 11, 12, 14, 13, 15};
alignas(16) constexpr std::uint8_t pairing_of_4[16] = {0, 4, 1, 5, 2, 6, 3, 7, 8, 12, 9, 13, 10, 14, 11, 15};
alignas(16) constexpr std::uint8_t pairing_of_3[16] = {0, 3, 1, 4,  2, 5,  0x80, 0x80,
                                                       6, 9, 7, 10, 8, 11, 0x80, 0x80};

template <int step, class D8> HWY_INLINE hn::Vec<D8> pairing_of(D8 d8) {
  return hn::LoadDup128(d8, step == 2 ? pairing_of_2 : (step == 3 ? pairing_of_3 : pairing_of_4));
}

// Indices of the 32-bit lanes that move four three-byte pixels into each 16-byte block, from lane `from` on.
// Computed in lanes, because GCC 12 compiles a loop that fills a table wrongly for SVE vectors of 32 bytes.
template <class D8> HWY_INLINE auto spreading(D8, std::size_t from) {
  const hn::Repartition<std::uint32_t, D8> d32;
  const auto lane = hn::Iota(d32, 0), block = hn::ShiftRight<2>(lane);
  const auto in_block = hn::Min(hn::And(lane, hn::Set(d32, 3)), hn::Set(d32, 2));
  const auto first =
      hn::Add(hn::Add(block, hn::ShiftLeft<1>(block)), hn::Set(d32, static_cast<std::uint32_t>(from)));
  return hn::IndicesFromVec(d32, hn::Add(first, in_block));
}

// Reads two pixels for each 16-bit sum, in pairs. With three-byte pixels a vector has more bytes than needed:
// the upper half of a block is read a quarter early, so that no byte after the pixels is read. (Vectors of
// unknown length are arguments, because they cannot be members of a struct.)
template <int step, class D8, class Spread>
HWY_INLINE hn::Vec<D8> read_pairs(D8 d8, const std::uint8_t* p, bool upper_half, hn::Vec<D8> pairing,
                                  const Spread& spread) {
  if constexpr (step == 1) {
    return hn::LoadU(d8, p);
  } else if constexpr (step == 3) {
    const hn::Repartition<std::uint32_t, D8> d32;
    const auto dwords = hn::BitCast(d32, hn::LoadU(d8, p - (upper_half ? hn::Lanes(d8) / 4 : 0)));
    return hn::TableLookupBytesOr0(hn::BitCast(d8, hn::TableLookupLanes(dwords, spread)), pairing);
  } else {
    return hn::TableLookupBytes(hn::LoadU(d8, p), pairing);
  }
}

#if HWY_TARGET == HWY_NEON
// The sums of sums() for one byte per pixel, by loads that part even and odd bytes: NEON has no weighted sum
// of pairs.
HWY_INLINE hn::Vec128<std::uint16_t> sums_of_bytes(const std::uint8_t* p) {
  const uint8x8x2_t before = vld2_u8(p - 2), here = vld2_u8(p), after = vld2_u8(p + 2);
  const uint8x8_t centre = here.val[0];
  const uint16x8_t outer = vmlal_u8(vaddl_u8(before.val[0], after.val[0]), centre, vdup_n_u8(2));
  const uint16x8_t inner = vaddw_u8(vaddl_u8(before.val[1], here.val[1]), centre);
  return hn::Vec128<std::uint16_t>{vmlaq_n_u16(outer, inner, 4)};
}
#endif

// 1-4-6-4-1 around each even pixel from `p` on.
template <int step, class D8, class Spread>
HWY_INLINE auto sums(D8 d8, const std::uint8_t* p, bool upper_half, hn::Vec<D8> pairing,
                     const Spread& spread) {
#if HWY_TARGET == HWY_NEON
  if constexpr (step == 1)
    return sums_of_bytes(p);
#endif
  const hn::Repartition<std::uint16_t, D8> d16;
  const auto before = read_pairs<step>(d8, p - 2 * step, upper_half, pairing, spread);
  const auto here = read_pairs<step>(d8, p, upper_half, pairing, spread);
  const auto after = hn::BitCast(d16, read_pairs<step>(d8, p + 2 * step, upper_half, pairing, spread));
  return hn::Add(hn::Add(pairs_1_4(d16, before), pairs_6_4(d16, here)), hn::And(after, hn::Set(d16, 255)));
}

// Updates `partial` and `held`. Returns the finished sums.
template <class D16>
HWY_INLINE hn::Vec<D16> advance(D16, hn::Vec<D16> odd, hn::Vec<D16> even, hn::Vec<D16>& partial,
                                hn::Vec<D16>& held) {
  const auto both = hn::Add(hn::ShiftLeft<2>(odd), even);
  const auto sum = hn::Add(partial, both);
  partial = hn::Add(hn::Add(held, both), hn::Add(hn::ShiftLeft<2>(even), even));
  held = even;
  return sum;
}

// Reduces the pixels first..last-1, which are not at an edge. Returns false when they are fewer than a
// vector. The last block overlaps the one before it: its waiting sums are read first, while they are
// unchanged. Its pixels are read last, because the processor's own prefetch follows the row from its
// beginning.
template <int step, int written, class D8>
HWY_INLINE bool vector_pixels(D8 d8, const std::uint8_t* odd, const std::uint8_t* even, int first, int last,
                              std::ptrdiff_t ahead, const Waiting& waiting, std::uint8_t* out) {
  const hn::Repartition<std::uint16_t, D8> d16;
  const std::size_t block = hn::Lanes(d8), half = block / 2;
  const std::size_t count = static_cast<std::size_t>(std::max(0, last - first)) * written;
  if (count < block)
    return false;
  const auto pairing = pairing_of<step>(d8);
  const auto lower_spread = spreading(d8, 0), upper_spread = spreading(d8, block / 16);
  const auto rounding = hn::Set(d16, 128);
  std::uint16_t* partial = waiting.partial + first * written;
  std::uint16_t* held = waiting.held + first * written;
  odd += 2 * first * step;
  even += 2 * first * step;
  out += first * written;
  const auto source = [](std::size_t i) { return i * 2 / written * step; };

  using Sums = hn::Vec<decltype(d16)>;
  // Always inlined: a call would pass the vectors in memory.
  const auto half_block = [&](std::size_t i, bool upper, const auto& spread, Sums& p, Sums& h) HWY_ATTR
      __attribute__((always_inline)) {
    const std::size_t at = source(i);
    return advance(d16, sums<step>(d8, odd + at, upper, pairing, spread),
                   sums<step>(d8, even + at, upper, pairing, spread), p, h);
  };
  const auto rounded = [&](Sums low, Sums high) HWY_ATTR {
    return hn::ConcatOdd(d8, hn::BitCast(d8, hn::Add(high, rounding)),
                         hn::BitCast(d8, hn::Add(low, rounding)));
  };
  const auto keep = [&](std::size_t i, Sums p, Sums h) HWY_ATTR {
    hn::StoreU(p, d16, partial + i);
    hn::StoreU(h, d16, held + i);
  };

  const auto waiting_at = [&](std::size_t i, Sums& p, Sums& h) HWY_ATTR {
    p = hn::LoadU(d16, partial + i);
    h = hn::LoadU(d16, held + i);
  };
  const auto make_from = [&](std::size_t i, Sums p0, Sums h0, Sums p1, Sums h1) HWY_ATTR
      __attribute__((always_inline)) {
    const auto low = half_block(i, false, lower_spread, p0, h0);
    hn::StoreU(rounded(low, half_block(i + half, true, upper_spread, p1, h1)), d8, out + i);
    keep(i, p0, h0);
    keep(i + half, p1, h1);
  };
  const auto make = [&](std::size_t i) HWY_ATTR __attribute__((always_inline)) {
    Sums p0, h0, p1, h1;
    waiting_at(i, p0, h0);
    waiting_at(i + half, p1, h1);
    make_from(i, p0, h0, p1, h1);
  };
  const std::size_t tail = count - block;
  Sums tail_p0, tail_h0, tail_p1, tail_h1;
  waiting_at(tail, tail_p0, tail_h0);
  waiting_at(tail + half, tail_p1, tail_h1);
  if (ahead == 0) {
    for (std::size_t i = 0; i < tail; i += block)
      make(i);
  } else {
    for (std::size_t i = 0; i < tail;) {
      RowsAhead asked(odd, even, ahead, source(i), source(block), source(tail));
      for (const std::size_t end = asked.one_by_one() && 2 * i < tail ? (tail + 1) / 2 : tail; i < end;
           i += block) {
        asked.next(source(block));
        make(i);
      }
    }
  }
  make_from(tail, tail_p0, tail_h0, tail_p1, tail_h1);
  return true;
}

// The same for pixels first..last-1 of one row. Returns false when they are fewer than a vector.
template <int step, int written>
bool single_pixels(const std::uint8_t* row, int first, int last, std::ptrdiff_t ahead, std::uint8_t* out) {
  const Widest d8;
  const hn::Repartition<std::uint16_t, decltype(d8)> d16;
  const std::size_t block = hn::Lanes(d8), half = block / 2;
  const std::size_t count = static_cast<std::size_t>(std::max(0, last - first)) * written;
  if (count < block)
    return false;
  const auto pairing = pairing_of<step>(d8);
  const auto lower_spread = spreading(d8, 0), upper_spread = spreading(d8, block / 16);
  const auto rounding = hn::Set(d16, 8);
  row += 2 * first * step;
  out += first * written;
  const auto source = [](std::size_t i) { return i * 2 / written * step; };
  const std::size_t tail = count - block;
  for (std::size_t i = 0;; i = std::min(i + block, tail)) {
    const std::uint8_t* const at = row + source(i);
    if (ahead != 0)
      ask_ahead(at + ahead, source(block));
    const auto low = sums<step>(d8, at, false, pairing, lower_spread),
               high = sums<step>(d8, row + source(i + half), true, pairing, upper_spread);
    const auto rounded = [&](auto sum)
                             HWY_ATTR { return hn::BitCast(d8, hn::ShiftRight<4>(hn::Add(sum, rounding))); };
    hn::StoreU(hn::ConcatEven(d8, rounded(high), rounded(low)), d8, out + i);
    if (i == tail)
      return true;
  }
}

#endif

template <int step, int written>
void reduce_row(const std::uint8_t* odd, const std::uint8_t* even, int width, std::ptrdiff_t ahead,
                const Waiting& waiting, std::uint8_t* out) {
  const int half = (width + 1) / 2, right = half - 1;
  bool done = false;
  if (width < 3) {
    edge_pixel<step, written>(odd, even, 0, waiting, out, [&](const std::uint8_t* row) HWY_ATTR {
      return horizontal_in_narrow<step>(row, 0, width);
    });
  } else {
    edge_pixel<step, written>(odd, even, 0, waiting, out,
                              [](const std::uint8_t* row) HWY_ATTR { return horizontal_at_left<step>(row); });
    // Ends with the last pixel whose right neighbour has a complete pair.
    const int inner = std::max(1, width / 2 - 1);
#if HWY_TARGET != HWY_SCALAR
    const Widest widest;
    done = vector_pixels<step, written>(widest, odd, even, 1, inner, ahead, waiting, out);
#if !HWY_HAVE_SCALABLE
    const hn::CappedTag<std::uint8_t, 16> narrow;
    if constexpr (hn::MaxLanes(widest) > hn::MaxLanes(narrow))
      done = done || vector_pixels<step, written>(narrow, odd, even, 1, inner, ahead, waiting, out);
#endif
#endif
    if (!done)
      plain_pixels<step, written>(odd, even, 1, inner, ahead, waiting, out);
    // With an odd width one more pixel has both neighbours.
    if (inner < right)
      edge_pixel<step, written>(odd, even, inner, waiting, out, [&](const std::uint8_t* row) HWY_ATTR {
        return horizontal<step>(row + 2 * inner * step);
      });
    edge_pixel<step, written>(odd, even, right, waiting, out, [&](const std::uint8_t* row) HWY_ATTR {
      return horizontal_at_right<step>(row + 2 * right * step, width % 2 == 0);
    });
  }
  if constexpr (written > step)
    if (!done)
      for (int x = 0; x < half; ++x)
        out[x * written + step] = 0;
}

void reduce(Interleave interleave, const std::uint8_t* odd, const std::uint8_t* even, int width,
            std::ptrdiff_t ahead, const Waiting& waiting, std::uint8_t* out) {
  with_constant<1, 2, 3, 4>(static_cast<int>(interleave), [&](auto n) HWY_ATTR {
    reduce_row<n, written_step(Interleave{n()})>(odd, even, width, ahead, waiting, out);
  });
}

template <int step, int written>
void reduce_single(const std::uint8_t* row, int width, [[maybe_unused]] std::ptrdiff_t ahead,
                   std::uint8_t* out) {
  const auto put = [&](int x, const auto& sum) HWY_ATTR {
    for (int c = 0; c < step; ++c)
      out[x * written + c] = static_cast<std::uint8_t>((sum(row + 2 * x * step + c) + 8) >> 4);
    if constexpr (written > step)
      out[x * written + step] = 0;
  };
  if (width < 3)
    return put(0, [=](const std::uint8_t* p) HWY_ATTR { return horizontal_in_narrow<step>(p, 0, width); });
  const int right = (width + 1) / 2 - 1, inner = std::max(1, width / 2 - 1);
  put(0, [](const std::uint8_t* p) HWY_ATTR { return horizontal_at_left<step>(p); });
  bool done = false;
#if HWY_TARGET != HWY_SCALAR
  done = single_pixels<step, written>(row, 1, inner, ahead, out);
#endif
  for (int x = done ? inner : 1; x < right; ++x)
    put(x, [](const std::uint8_t* p) HWY_ATTR { return horizontal<step>(p); });
  put(right, [=](const std::uint8_t* p) HWY_ATTR { return horizontal_at_right<step>(p, width % 2 == 0); });
}

void reduce_one(Interleave interleave, const std::uint8_t* row, int width, std::ptrdiff_t ahead,
                std::uint8_t* out) {
  with_constant<1, 2, 3, 4>(static_cast<int>(interleave), [&](auto n) HWY_ATTR {
    reduce_single<n, written_step(Interleave{n()})>(row, width, ahead, out);
  });
}

// Auto-vectorised.
void reduce_vertically(const std::uint8_t* odd, const std::uint8_t* even, int bytes, const Waiting& w,
                       std::uint8_t* __restrict out) {
  std::uint16_t* __restrict partial = w.partial;
  std::uint16_t* __restrict held = w.held;
  for (std::size_t i = 0, count = static_cast<std::size_t>(bytes); i < count; ++i) {
    const std::uint16_t four_odd = 4 * odd[i], sum = partial[i] + four_odd + even[i] + 8;
    partial[i] = held[i] + four_odd + 6 * even[i];
    held[i] = even[i];
    out[i] = static_cast<std::uint8_t>(sum >> 4);
  }
}

// The next loops are auto-vectorised, a part of the row after each prefetch.
constexpr std::size_t samples_at_once = 512;

void split(const std::uint8_t* __restrict row, int width, bool luma_first, std::ptrdiff_t ahead,
           std::uint8_t* __restrict luma, std::uint8_t* __restrict chroma) {
  const std::size_t bytes = static_cast<std::size_t>((width + 1) / 2) * 2;
  std::uint8_t* __restrict first = luma_first ? luma : chroma;
  std::uint8_t* __restrict second = luma_first ? chroma : luma;
  for (std::size_t from = 0; from < bytes; from += samples_at_once) {
    ask_ahead(row + 2 * from + ahead, 2 * samples_at_once);
    for (std::size_t i = from, end = std::min(from + samples_at_once, bytes); i < end; ++i) {
      first[i] = row[2 * i];
      second[i] = row[2 * i + 1];
    }
  }
}

template <int shift>
void narrow_by(const std::uint8_t* __restrict row, std::size_t count, std::ptrdiff_t ahead,
               std::uint8_t* __restrict out) {
  for (std::size_t from = 0; from < count; from += samples_at_once) {
    if (ahead != 0)
      ask_ahead(row + 2 * from + ahead, 2 * samples_at_once);
    for (std::size_t i = from, end = std::min(from + samples_at_once, count); i < end; ++i)
      out[i] = static_cast<std::uint8_t>(pair_at(row + 2 * i) >> shift);
  }
}

void narrow_row(const std::uint8_t* row, int shift, int count, std::ptrdiff_t ahead, std::uint8_t* out) {
  with_constant<0, 1, 2, 3, 4, 5, 6, 7, 8>(
      shift, [&](auto s) HWY_ATTR { narrow_by<s>(row, static_cast<std::size_t>(count), ahead, out); });
}

template <int step, int shift> void spread_bytes(const std::uint8_t* in, int width, std::uint8_t* out) {
  if constexpr (shift == 0) {
    for (int x = 0; x < width; ++x)
      out[x] = in[x * step];
  } else {
    for (int i = 0; i < width / 2; ++i)
      out[2 * i] = out[2 * i + 1] = in[i * step];
    if (width % 2)
      out[width - 1] = in[width / 2 * step];
  }
}

void spread_row(const std::uint8_t* row, int offset, int step, int shift, int width, std::uint8_t* out) {
  with_constant<1, 2, 3, 4>(step, [&](auto n) HWY_ATTR {
    with_constant<0, 1>(shift, [&](auto s) HWY_ATTR { spread_bytes<n, s>(row + offset, width, out); });
  });
}

} // namespace HWY_NAMESPACE
} // namespace terrainseg::kernels
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace terrainseg::kernels {

TERRAINSEG_DISPATCH(reduce_pair, reduce);
TERRAINSEG_DISPATCH(reduce_horizontally, reduce_one);
TERRAINSEG_DISPATCH(reduce_pair_vertically, reduce_vertically);
TERRAINSEG_DISPATCH(split_422, split);
TERRAINSEG_DISPATCH(narrow, narrow_row);
TERRAINSEG_DISPATCH(spread, spread_row);

} // namespace terrainseg::kernels
#endif
