// SPDX-License-Identifier: LGPL-2.1-or-later
#include "kernels/sides.hpp"

#include "kernels/targets.hpp"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "kernels/sides.cpp"
#include <hwy/foreach_target.h>
// After foreach_target.h, as Highway demands.
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace terrainseg::kernels {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

void sum_of_blocks(const std::uint8_t* __restrict cells, int blocks, std::uint32_t* __restrict sums,
                   std::uint32_t* __restrict squares) {
  for (int b = 0; b < blocks; ++b) {
    const std::uint32_t left = cells[2 * b], right = cells[2 * b + 1];
    sums[b] += left + right;
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
    const auto each = hn::Sub(hn::LoadU(d, b + i), hn::LoadU(d, a + i));
    const auto pairs = hn::Add(each, hn::ShiftLeftLanes<1>(d, each));
    const auto sums = hn::Add(hn::Add(pairs, hn::ShiftLeftLanes<2>(d, pairs)), before);
    hn::StoreU(sums, d, out + i);
    before = hn::Broadcast<3>(sums);
  }
  run = hn::GetLane(before);
#endif
  for (; i < count; ++i) {
    run += b[i] - a[i];
    out[i] = run;
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
    // Around the mean's whole part: so that no precision is lost in the difference of two large squares.
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

void oddness_of_row(const DeviationRow& in, const std::int16_t* __restrict nearest, std::int16_t reached,
                    int most, int count, std::uint8_t* __restrict out) {
  const std::uint8_t *const y = in.y, *const u = in.u, *const v = in.v, *const ground = in.ground,
                            *const dark = in.dark;
  const auto limit = static_cast<std::int16_t>(most);
  for (int i = 0; i < count; ++i) {
    const std::int16_t full = y[i], quarter = static_cast<std::int16_t>(full >> 2), a = u[i], b = v[i];
    const std::int16_t paler = nearest[i] > reached ? quarter : full, luma = dark[i] ? full : paler;
    const std::int16_t chroma = a > b ? a : b, largest = luma > chroma ? luma : chroma;
    const auto half = static_cast<std::int16_t>((largest + luma + a + b) >> 1);
    const std::int16_t bounded = half < limit ? half : limit;
    out[i] = static_cast<std::uint8_t>(ground[i] ? bounded : std::int16_t{0});
  }
}

void excess_of_row(const std::uint8_t* __restrict values, const std::uint8_t* __restrict ground, int enough,
                   int sign, int count, std::int32_t* __restrict sums) {
  const auto flip = static_cast<std::int16_t>(sign < 0 ? -1 : 0), level = static_cast<std::int16_t>(enough);
  for (int i = 0; i < count; ++i) {
    const auto excess = static_cast<std::int16_t>(values[i] - (level & -ground[i]));
    sums[i] += static_cast<std::int16_t>((excess ^ flip) - flip);
  }
}

} // namespace HWY_NAMESPACE
} // namespace terrainseg::kernels
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace terrainseg::kernels {

HWY_EXPORT(sum_of_blocks);
HWY_EXPORT(running_differences);
HWY_EXPORT(sides_of_boxes);
HWY_EXPORT(twice_each);
HWY_EXPORT(deviations_of);
HWY_EXPORT(oddness_of_row);
HWY_EXPORT(excess_of_row);

void add_blocks(const std::uint8_t* cells, int blocks, std::uint32_t* sums, std::uint32_t* squares) {
  HWY_DYNAMIC_DISPATCH(sum_of_blocks)(cells, blocks, sums, squares);
}

void run_differences(const std::uint32_t* a, const std::uint32_t* b, int count, std::uint32_t* out) {
  HWY_DYNAMIC_DISPATCH(running_differences)(a, b, count, out);
}

void compare_boxes(const std::uint32_t* sums, const std::uint32_t* squares, const BoxRow& boxes,
                   std::uint32_t floor, int count, const SideRow& out) {
  HWY_DYNAMIC_DISPATCH(sides_of_boxes)(sums, squares, boxes, floor, count, out);
}

void double_each(const std::int16_t* in, int count, std::int16_t* out) {
  HWY_DYNAMIC_DISPATCH(twice_each)(in, count, out);
}

void deviations(const std::uint8_t* cells, const std::int16_t* left, const std::int16_t* right,
                const std::int16_t* inverse, int count, std::uint8_t* out, std::uint8_t* dark) {
  HWY_DYNAMIC_DISPATCH(deviations_of)(cells, left, right, inverse, count, out, dark);
}

void oddness(const DeviationRow& in, const std::int16_t* nearest, std::int16_t reached, int most, int count,
             std::uint8_t* out) {
  HWY_DYNAMIC_DISPATCH(oddness_of_row)(in, nearest, reached, most, count, out);
}

void add_excess(const std::uint8_t* values, const std::uint8_t* ground, int enough, int sign, int count,
                std::int32_t* sums) {
  HWY_DYNAMIC_DISPATCH(excess_of_row)(values, ground, enough, sign, count, sums);
}

} // namespace terrainseg::kernels
#endif
