// SPDX-License-Identifier: LGPL-2.1-or-later
#include "kernels/mask.hpp"

#include <algorithm>
#include <cstring>

#include "kernels/targets.hpp"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "kernels/mask.cpp"
#include <hwy/foreach_target.h>
// Must follow foreach_target.h.
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace terrainseg::kernels {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

// Number of rows that share one set of 8-bit thresholds; 255 means "in none of these rows".
constexpr int slab_rows = 255;

void relative(const std::uint16_t* curve, int width, int top, std::uint8_t* out) {
  for (int x = 0; x < width; ++x)
    out[x] = static_cast<std::uint8_t>(std::clamp(int{curve[x]} - top, 0, slab_rows));
}

// A buffer that comes back from a pipeline is not in the cache. Each store that misses waits for its line,
// and the processor's own prefetch stops at page borders. With this prefetch 1080p takes 0.15 ms, memset
// 0.21.
constexpr std::ptrdiff_t bytes_ahead = 2048;

// Distance in bytes to the row that is prefetched: whole rows, so that it is in the mask.
std::ptrdiff_t rows_ahead(std::ptrdiff_t stride) {
  const std::ptrdiff_t row = std::max<std::ptrdiff_t>(stride < 0 ? -stride : stride, 1);
  return (bytes_ahead + row - 1) / row * stride;
}

// Calls block(d, x) for vectors from column x on that cover 0..width-1, two at a time while they fit; the
// last one overlaps. Narrow masks are covered by single columns. Prefetches each cache line at `ahead` from
// `out` once.
template <class Block>
HWY_INLINE void cover(int width, const std::uint8_t* out, std::ptrdiff_t ahead, const Block& block) {
  constexpr int cache_line = 64;
  const hn::CappedTag<std::uint8_t, cache_line> d;
  const int n = static_cast<int>(hn::Lanes(d));
  if (width < n || n == 1) {
    for (int x = 0; x < width; ++x)
      block(hn::CappedTag<std::uint8_t, 1>(), x);
    return;
  }
  int x = 0;
  for (; x + 2 * n < width; x += 2 * n) {
    for (int line = 0; line < 2 * n; line += cache_line)
      __builtin_prefetch(out + x + line + ahead);
    block(d, x);
    block(d, x + n);
  }
  __builtin_prefetch(out + x + ahead);
  if (x + n < width)
    block(d, x);
  block(d, width - n);
}

void write_row(const std::uint8_t* boundary, const std::uint8_t* safe, int row, int width,
               std::ptrdiff_t ahead, std::uint8_t* out) {
  cover(width, out, ahead, [&](auto d, int x) HWY_ATTR {
    const auto here = hn::Set(d, static_cast<std::uint8_t>(row)), doubtful = hn::Set(d, 128);
    // x86 cannot compare unsigned bytes.
    const auto below = hn::Eq(hn::Max(hn::LoadU(d, boundary + x), here), here);
    const auto beyond = hn::Eq(hn::Max(hn::LoadU(d, safe + x), here), here);
    // Not computed as the mean of 0 and 255, because Highway's average overflows with SVE.
    hn::StoreU(hn::Or(hn::IfThenElseZero(below, doubtful), hn::VecFromMask(d, beyond)), d, out + x);
  });
}

void fill(std::uint8_t* mask, std::ptrdiff_t stride, int width, int first, int end, std::uint8_t value) {
  for (std::uint8_t* row = mask + first * stride; first < end; ++first, row += stride)
    cover(width, row, rows_ahead(stride),
          [&](auto d, int x) HWY_ATTR { hn::StoreU(hn::Set(d, value), d, row + x); });
}

void write_mask(const std::uint16_t* boundary, const std::uint16_t* safe, int width, int first, int end,
                std::uint8_t* mask, std::ptrdiff_t stride, std::uint8_t* work) {
  if (width <= 0 || first >= end)
    return;
  std::uint16_t least = boundary[0], most = safe[0];
  for (int x = 1; x < width; ++x) {
    least = std::min(least, boundary[x]);
    most = std::max(most, safe[x]);
  }
  const int top = std::clamp<int>(least, first, end), bottom = std::clamp<int>(most, top, end);
  fill(mask, stride, width, first, top, 0);
  std::uint8_t* near = work;
  std::uint8_t* far = work + width;
  for (int slab = top; slab < bottom; slab += slab_rows) {
    relative(boundary, width, slab, near);
    relative(safe, width, slab, far);
    for (int y = slab; y < std::min(slab + slab_rows, bottom); ++y)
      write_row(near, far, y - slab, width, rows_ahead(stride), mask + y * stride);
  }
  fill(mask, stride, width, bottom, end, 255);
}

void add_stretches(const std::uint16_t* __restrict first, const std::uint16_t* __restrict end, int width,
                   int first_row, int end_row, std::uint8_t* __restrict mask, std::ptrdiff_t stride) {
  for (int y = first_row; y < end_row; ++y) {
    const auto row = static_cast<std::uint16_t>(y);
    std::uint8_t* const out = mask + y * stride;
    for (int x = 0; x < width; ++x)
      out[x] |= static_cast<std::uint8_t>(-static_cast<int>((first[x] <= row) & (end[x] > row)));
  }
}

} // namespace HWY_NAMESPACE
} // namespace terrainseg::kernels
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace terrainseg::kernels {

TERRAINSEG_DISPATCH(write_mask_rows, write_mask);
TERRAINSEG_DISPATCH(add_mask_stretches, add_stretches);

} // namespace terrainseg::kernels
#endif
