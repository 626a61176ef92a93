// SPDX-License-Identifier: LGPL-2.1-or-later
#include "kernels/deviation.hpp"

#include "kernels/targets.hpp"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "kernels/deviation.cpp"
#include <hwy/foreach_target.h>
// Must follow foreach_target.h.
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace terrainseg::kernels {
namespace HWY_NAMESPACE {

void moments_of_row(const std::uint8_t* __restrict luma, const std::uint8_t* __restrict ground, int count,
                    std::uint16_t* __restrict cells, std::uint16_t* __restrict sums,
                    std::uint32_t* __restrict squares) {
  for (int i = 0; i < count; ++i) {
    cells[i] = static_cast<std::uint16_t>(cells[i] + ground[i]);
    sums[i] = static_cast<std::uint16_t>(sums[i] + (luma[i] & -ground[i]));
  }
  for (int i = 0; i < count; ++i) {
    const auto away = static_cast<std::int16_t>((luma[i] - 128) & -ground[i]);
    squares[i] += static_cast<std::uint32_t>(away * away);
  }
}

void add_moments_of(const std::uint8_t* luma, const std::uint8_t* ground, int count,
                    const ColumnMoments& out) {
  moments_of_row(luma, ground, count, out.cells, out.sums, out.squares);
}

void near_of_row(const std::uint8_t* __restrict luma, const std::uint8_t* __restrict ground,
                 const std::uint8_t* __restrict middle, const std::uint8_t* __restrict reach, int count,
                 std::uint16_t* __restrict cells, std::uint16_t* __restrict sums,
                 std::uint16_t* __restrict distances) {
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

void add_near_of(const std::uint8_t* luma, const std::uint8_t* ground, const std::uint8_t* middle,
                 const std::uint8_t* reach, int count, const ColumnDeviations& out) {
  near_of_row(luma, ground, middle, reach, count, out.cells, out.sums, out.distances);
}

void deviations_of_row(const std::uint8_t* __restrict luma, const std::uint8_t* __restrict ground,
                       const std::uint8_t* __restrict middle, const std::uint16_t* __restrict scale,
                       int count, std::uint8_t* __restrict out) {
  for (int i = 0; i < count; ++i) {
    const auto x = static_cast<std::int16_t>(luma[i]), m = static_cast<std::int16_t>(middle[i]);
    // 64 * 255 and 4 * 1024 fit 16 bits, and the shift by 16 of their product equals a shift by 8.
    const auto away = static_cast<std::uint16_t>((x > m ? x - m : m - x) << 6);
    const auto factor = static_cast<std::uint16_t>(scale[i] << 2);
    const auto z = static_cast<std::uint16_t>((std::uint32_t{away} * factor) >> 16);
    out[i] = static_cast<std::uint8_t>((z < 127 ? z : std::uint16_t{127}) & -ground[i]);
  }
}

} // namespace HWY_NAMESPACE
} // namespace terrainseg::kernels
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace terrainseg::kernels {

HWY_EXPORT(add_moments_of);
HWY_EXPORT(add_near_of);
HWY_EXPORT(deviations_of_row);

void add_moments(const std::uint8_t* luma, const std::uint8_t* ground, int count, const ColumnMoments& out) {
  HWY_DYNAMIC_DISPATCH(add_moments_of)(luma, ground, count, out);
}

void add_near(const std::uint8_t* luma, const std::uint8_t* ground, const std::uint8_t* middle,
              const std::uint8_t* reach, int count, const ColumnDeviations& out) {
  HWY_DYNAMIC_DISPATCH(add_near_of)(luma, ground, middle, reach, count, out);
}

void deviations_from(const std::uint8_t* luma, const std::uint8_t* ground, const std::uint8_t* middle,
                     const std::uint16_t* scale, int count, std::uint8_t* out) {
  HWY_DYNAMIC_DISPATCH(deviations_of_row)(luma, ground, middle, scale, count, out);
}

} // namespace terrainseg::kernels
#endif
