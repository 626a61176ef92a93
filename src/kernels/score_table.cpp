// SPDX-License-Identifier: LGPL-2.1-or-later
#include "kernels/score_table.hpp"

#include <algorithm>
#include <cstring>

#include "kernels/targets.hpp"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "kernels/score_table.cpp"
#include <hwy/foreach_target.h>
// Must follow foreach_target.h.
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace terrainseg::kernels {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

std::uint32_t plain_pixels(const PixelRow& row, const ComponentScores& scores, int first, int end,
                           std::uint8_t* out) {
  std::uint32_t count = 0;
  for (int x = first; x < end; ++x) {
    const std::ptrdiff_t c = std::ptrdiff_t{x >> row.chroma_shift} * row.chroma_step;
    const bool terrain = score_of(scores, row.component[0][std::ptrdiff_t{x} * row.first_step],
                                  row.component[1][c], row.component[2][c]) <= score_limit;
    out[x] = terrain ? 255 : 0;
    count += terrain ? 1 : 0;
  }
  return count;
}

bool faster(int bit_shift) {
  return HWY_TARGET != HWY_SCALAR && bit_shift >= 3;
}

#if HWY_TARGET == HWY_SCALAR

std::uint32_t classify(const PixelRow& row, const ComponentScores& scores, std::uint8_t* out, int width) {
  return plain_pixels(row, scores, 0, width, out);
}

#else

using Tag = hn::CappedTag<std::uint8_t, 64>;
using Bytes = hn::Vec<Tag>;

// Layouts of a pixel's components for vector loads.
enum class Lie { planar, planar_422, pairs_422, packed_422, three, four, other };

Lie lie_of(const PixelRow& row) {
  const std::ptrdiff_t apart = row.component[2] - row.component[1];
  const auto within = [&](int bytes) {
    const auto [low, high] = std::minmax({row.component[0], row.component[1], row.component[2]});
    return high - low < bytes;
  };
  if (row.first_step == 1 && row.chroma_step == 1)
    return row.chroma_shift == 0 ? Lie::planar : Lie::planar_422;
  if (row.first_step == 1 && row.chroma_step == 2 && row.chroma_shift == 1 && (apart == 1 || apart == -1))
    return Lie::pairs_422;
  if (row.first_step == 2 && row.chroma_step == 4 && row.chroma_shift == 1 && within(4))
    return Lie::packed_422;
  if (row.first_step == 3 && row.chroma_step == 3 && row.chroma_shift == 0 && within(3))
    return Lie::three;
  if (row.first_step == 4 && row.chroma_step == 4 && row.chroma_shift == 0 && within(4))
    return Lie::four;
  return Lie::other;
}

// Repeats each sample of interleaved chroma for its two pixels: the even bytes or the odd ones.
HWY_INLINE Bytes repeated_even(Tag d, Bytes pairs) {
  const hn::Repartition<std::uint16_t, Tag> d16;
  const auto low = hn::And(hn::BitCast(d16, pairs), hn::Set(d16, 255));
  return hn::BitCast(d, hn::Or(low, hn::ShiftLeft<8>(low)));
}
HWY_INLINE Bytes repeated_odd(Tag d, Bytes pairs) {
  const hn::Repartition<std::uint16_t, Tag> d16;
  const auto both = hn::BitCast(d16, pairs);
  return hn::BitCast(d, hn::Or(hn::ShiftRight<8>(both), hn::AndNot(hn::Set(d16, 255), both)));
}

// Reads the pixels of a row from x on, one vector per component. Reads exactly the bytes of these pixels.
template <Lie lie>
HWY_INLINE void load_pixels(const PixelRow& row, int x, Bytes& first, Bytes& second, Bytes& third) {
  const Tag d;
  const hn::Repartition<std::uint16_t, Tag> d16;
  const hn::Half<Tag> half;
  const auto [y, u, v] = row.component;
  const auto take_chroma = [&, u = u, v = v](Bytes pairs) HWY_ATTR {
    second = u < v ? repeated_even(d, pairs) : repeated_odd(d, pairs);
    third = u < v ? repeated_odd(d, pairs) : repeated_even(d, pairs);
  };
  if constexpr (lie == Lie::planar || lie == Lie::planar_422 || lie == Lie::pairs_422)
    first = hn::LoadU(d, y + x);
  if constexpr (lie == Lie::planar) {
    second = hn::LoadU(d, u + x);
    third = hn::LoadU(d, v + x);
  } else if constexpr (lie == Lie::planar_422) {
    const auto repeated = [&](const std::uint8_t* samples) HWY_ATTR {
      const auto wide = hn::PromoteTo(d16, hn::LoadU(half, samples + x / 2));
      return hn::BitCast(d, hn::Or(wide, hn::ShiftLeft<8>(wide)));
    };
    second = repeated(u);
    third = repeated(v);
  } else if constexpr (lie == Lie::pairs_422) {
    take_chroma(hn::LoadU(d, std::min(u, v) + x));
  } else {
    const std::uint8_t* const base = std::min({y, u, v});
    if constexpr (lie == Lie::packed_422) {
      const auto a = hn::LoadU(d, base + 2 * x), b = hn::LoadU(d, base + 2 * x + hn::Lanes(d));
      const auto even = hn::ConcatEven(d, b, a), odd = hn::ConcatOdd(d, b, a);
      first = base == y ? even : odd;
      take_chroma(base == y ? odd : even);
    } else {
      Bytes v0, v1, v2;
      [[maybe_unused]] Bytes v3; // no component
      if constexpr (lie == Lie::three)
        hn::LoadInterleaved3(d, base + 3 * x, v0, v1, v2);
      else
        hn::LoadInterleaved4(d, base + 4 * x, v0, v1, v2, v3);
      const auto pick = [&](std::ptrdiff_t at) HWY_ATTR { return at == 0 ? v0 : at == 1 ? v1 : v2; };
      first = pick(y - base);
      second = pick(u - base);
      third = pick(v - base);
    }
  }
}

// 16 entries need one shuffle, 32 need two: an index with its top bit set gives 0.
template <bool wide> HWY_INLINE Bytes look_up(Tag d, const std::uint8_t* entries, Bytes low, Bytes high) {
  const auto first = hn::LoadDup128(d, entries);
  if constexpr (!wide)
    return hn::TableLookupBytes(first, low);
  else
    return hn::Or(hn::TableLookupBytesOr0(first, low),
                  hn::TableLookupBytesOr0(hn::LoadDup128(d, entries + 16), high));
}

template <bool wide, Lie lie>
HWY_INLINE Bytes terrain_at(const PixelRow& row, const ComponentScores& scores, int x) {
  const Tag d;
  const hn::Repartition<std::uint16_t, Tag> d16;
  Bytes v0, v1, v2;
  load_pixels<lie>(row, x, v0, v1, v2);
  const auto bins = [&](Bytes v) HWY_ATTR {
    const auto shifted = hn::BitCast(d, hn::ShiftRightSame(hn::BitCast(d16, v), scores.bit_shift));
    return hn::And(shifted, hn::Set(d, static_cast<std::uint8_t>(255 >> scores.bit_shift)));
  };
  Bytes low0 = bins(v0), low1 = bins(v1), low2 = bins(v2);
  Bytes high0 = low0, high1 = low1, high2 = low2;
  if constexpr (wide) {
    const auto top = hn::Set(d, 0x80), upper = hn::Set(d, 16), within = hn::Set(d, 15);
    const auto half_of = [&](Bytes v) HWY_ATTR {
      const auto is_upper = hn::Eq(hn::And(v, upper), upper);
      return hn::Or(hn::And(v, within), hn::IfThenElseZero(is_upper, top));
    };
    low0 = half_of(low0);
    low1 = half_of(low1);
    low2 = half_of(low2);
    high0 = hn::Xor(low0, top);
    high1 = hn::Xor(low1, top);
    high2 = hn::Xor(low2, top);
  }
  Bytes least = hn::Set(d, 255);
  for (int n = 0; n < scores.models; ++n) {
    const auto& entries = scores.entries[n];
    const auto sum = hn::SaturatedAdd(hn::SaturatedAdd(look_up<wide>(d, entries[0], low0, high0),
                                                       look_up<wide>(d, entries[1], low1, high1)),
                                      look_up<wide>(d, entries[2], low2, high2));
    least = hn::Min(least, sum);
  }
  const auto limit = hn::Set(d, static_cast<std::uint8_t>(score_limit));
  return hn::VecFromMask(d, hn::Eq(hn::SaturatedSub(least, limit), hn::Zero(d)));
}

std::uint32_t count_full(const std::uint8_t* values, int count) {
  std::uint32_t sum = 0;
  for (int i = 0; i < count; ++i)
    sum += values[i] & 1u;
  return sum;
}

template <bool wide, Lie lie>
std::uint32_t classify_lie(const PixelRow& row, const ComponentScores& scores, std::uint8_t* out, int width) {
  const Tag d;
  const int n = static_cast<int>(hn::Lanes(d));
  // Subsampled chroma is read in whole pairs, so the vectors end at an even pixel. In four-byte pixels the
  // first byte may be an unused one before the first component: then the last read ends at a byte that
  // exists.
  const int pixels = row.chroma_shift ? width & ~1 : lie == Lie::four ? width - 1 : width;
  if (pixels < n)
    return plain_pixels(row, scores, 0, width, out);
  for (int x = 0;;) {
    hn::StoreU(terrain_at<wide, lie>(row, scores, x), d, out + x);
    if (x + n >= pixels)
      break;
    x = std::min(x + n, pixels - n);
  }
  plain_pixels(row, scores, pixels, width, out);
  return count_full(out, width);
}

std::uint32_t classify(const PixelRow& row, const ComponentScores& scores, std::uint8_t* out, int width) {
  const Lie lie = lie_of(row);
  if (lie == Lie::other)
    return plain_pixels(row, scores, 0, width, out);
  std::uint32_t count = 0;
  with_constant<false, true>(scores.bit_shift == 3, [&](auto wide) HWY_ATTR {
    with_constant<Lie::planar, Lie::planar_422, Lie::pairs_422, Lie::packed_422, Lie::three, Lie::four>(
        lie, [&](auto l) HWY_ATTR { count = classify_lie<wide, l>(row, scores, out, width); });
  });
  return count;
}

#endif

} // namespace HWY_NAMESPACE
} // namespace terrainseg::kernels
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace terrainseg::kernels {

TERRAINSEG_DISPATCH(parts_are_faster, faster);
TERRAINSEG_DISPATCH(classify_row_by_parts, classify);

namespace {

/// A template argument of 0 means that the step is read from the row; other steps are compile-time constants.
template <int FirstStep, int ChromaStep, int ChromaShift>
std::uint32_t classify(const PixelRow& row, const std::uint8_t* table, int bit_shift, std::uint8_t* out,
                       int width) {
  const int bits = 8 - bit_shift;
  const std::ptrdiff_t first_step = FirstStep ? FirstStep : row.first_step,
                       chroma_step = ChromaStep ? ChromaStep : row.chroma_step;
  const std::uint8_t *first = row.component[0], *second = row.component[1], *third = row.component[2];
  const auto chroma_index = [&](std::ptrdiff_t i) {
    return static_cast<unsigned>(second[i * chroma_step] >> bit_shift) << bits |
           static_cast<unsigned>(third[i * chroma_step] >> bit_shift);
  };
  const auto look_up = [&](std::ptrdiff_t x, unsigned chroma) {
    return table[static_cast<unsigned>(first[x * first_step] >> bit_shift) << (2 * bits) | chroma];
  };
  std::uint32_t count = 0;
  int x = 0;
  if constexpr (ChromaShift == 1) {
    for (; x + 1 < width; x += 2) {
      const unsigned chroma = chroma_index(x >> 1);
      const std::uint8_t left = look_up(x, chroma), right = look_up(x + 1, chroma);
      out[x] = left;
      out[x + 1] = right;
      count += (left & 1u) + (right & 1u);
    }
  }
  for (; x < width; ++x) {
    out[x] = look_up(x, chroma_index(x >> ChromaShift));
    count += out[x] & 1u;
  }
  return count;
}

} // namespace

std::uint8_t score_of(const ComponentScores& scores, std::uint8_t first, std::uint8_t second,
                      std::uint8_t third) {
  const int b = scores.bit_shift;
  int least = 255;
  for (int n = 0; n < scores.models; ++n) {
    const auto& entry = scores.entries[n];
    least = std::min(least, entry[0][first >> b] + entry[1][second >> b] + entry[2][third >> b]);
  }
  return static_cast<std::uint8_t>(least);
}

void fill_color_table(const ComponentScores& scores, std::uint8_t* table, std::uint8_t* used) {
  const int side = 256 >> scores.bit_shift;
  const std::size_t rows = color_table_rows(scores.bit_shift);
  for (std::size_t row = 0; row < rows; ++row)
    if (used[row]) {
      std::memset(table + row * side, 0, side);
      used[row] = 0;
    }
  for (int n = 0; n < scores.models; ++n) {
    const auto& entry = scores.entries[n];
    for (int i = 0; i < side; ++i) {
      if (entry[0][i] > score_limit)
        continue;
      for (int j = 0; j < side; ++j) {
        const int room = score_limit - entry[0][i] - entry[1][j];
        if (room < 0)
          continue;
        const std::size_t row = static_cast<std::size_t>(i) * side + j;
        std::uint8_t* colors = table + row * side;
        for (int k = 0; k < side; ++k)
          colors[k] |= entry[2][k] <= room ? 255 : 0;
        used[row] = 1;
      }
    }
  }
}

std::uint32_t classify_row(const PixelRow& row, const std::uint8_t* table, int bit_shift, std::uint8_t* out,
                           int width) {
  if (row.chroma_shift == 1) {
    if (row.first_step == 1 && row.chroma_step == 1)
      return classify<1, 1, 1>(row, table, bit_shift, out, width);
    if (row.first_step == 1 && row.chroma_step == 2)
      return classify<1, 2, 1>(row, table, bit_shift, out, width);
    return classify<0, 0, 1>(row, table, bit_shift, out, width);
  }
  if (row.first_step == 1 && row.chroma_step == 1)
    return classify<1, 1, 0>(row, table, bit_shift, out, width);
  return classify<0, 0, 0>(row, table, bit_shift, out, width);
}

} // namespace terrainseg::kernels
#endif
