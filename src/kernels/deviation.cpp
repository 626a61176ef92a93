// SPDX-License-Identifier: LGPL-2.1-or-later
#include "kernels/deviation.hpp"

namespace terrainseg::kernels {
namespace {

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

} // namespace

void add_moments(const std::uint8_t* luma, const std::uint8_t* ground, int count, const ColumnMoments& out) {
  moments_of_row(luma, ground, count, out.cells, out.sums, out.squares);
}

void add_near(const std::uint8_t* luma, const std::uint8_t* ground, const std::uint8_t* middle,
              const std::uint8_t* reach, int count, const ColumnDeviations& out) {
  near_of_row(luma, ground, middle, reach, count, out.cells, out.sums, out.distances);
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
