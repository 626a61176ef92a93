// SPDX-License-Identifier: LGPL-2.1-or-later
#include "kernels/ground_warp.hpp"

#include <algorithm>
#include <cstdlib>

#include "kernels/targets.hpp"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "kernels/ground_warp.cpp"
#include <hwy/foreach_target.h>
// Must follow foreach_target.h.
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace terrainseg::kernels {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

// These loops are auto-vectorised.

/// Sums of four neighbours.
void add_fours(const std::uint16_t* __restrict in, int count, std::uint16_t* __restrict out) {
  for (int x = 0; x < count; ++x)
    out[x] = static_cast<std::uint16_t>((in[x] + in[x + 1]) + (in[x + 2] + in[x + 3]));
}

/// `halves` are the halved sums of columns from `radius` to the left on; `fours` the sums of four neighbours
/// of them.
template <int radius>
void subtract_mean(const std::uint8_t* __restrict in, const std::uint16_t* __restrict halves,
                   const std::uint16_t* __restrict fours, int width, int gain, std::uint8_t* __restrict out) {
  constexpr int side = 2 * radius + 1;
  constexpr unsigned per_sum = (4 * 65536 + side * side / 2) / (side * side);
  static_assert(side == 4 + 4 + 2 + 1 || side == 4 + 4 + 4 + 4 + 1);
  const auto narrow_gain = static_cast<std::int16_t>(gain);
  for (int x = 0; x < width; ++x) {
    const int rest = side == 17 ? fours[x + 8] + fours[x + 12] : halves[x + 8] + halves[x + 9];
    const auto half_sum =
        static_cast<std::uint16_t>((fours[x] + fours[x + 4]) + (rest + halves[x + side - 1]));
    const auto twice = static_cast<std::uint16_t>((half_sum * per_sum) >> 16);
    const auto mean = static_cast<std::int16_t>(twice / 2);
    const auto passed = static_cast<std::int16_t>((in[x] - mean) * narrow_gain),
               value = static_cast<std::int16_t>(passed + 128),
               positive = value < 1 ? std::int16_t{1} : value;
    out[x] = static_cast<std::uint8_t>(positive > 255 ? std::int16_t{255} : positive);
  }
}

/// Moves sums of columns down by a row, and halves them.
void move_down(const std::uint8_t* __restrict added, const std::uint8_t* __restrict removed, int width,
               std::uint16_t* __restrict sums, std::uint16_t* __restrict halves) {
  for (int x = 0; x < width; ++x) {
    sums[x] = static_cast<std::uint16_t>(sums[x] + added[x] - removed[x]);
    halves[x] = static_cast<std::uint16_t>(sums[x] / 2);
  }
}

template <int radius>
void high_pass_of(const std::uint8_t* in, std::ptrdiff_t stride, int width, int height, int gain,
                  std::uint8_t* out, std::uint16_t* work) {
  const int count = width + 2 * radius;
  std::uint16_t *sums = work, *halves = work + count, *fours = halves + count;
  const auto row = [&](int y) { return in + std::clamp(y, 0, height - 1) * stride; };
  // Of the rows around the one above the first: those from -radius - 1 to radius - 1.
  for (int x = 0; x < width; ++x)
    sums[x] = static_cast<std::uint16_t>((radius + 1) * in[x]);
  for (int k = 0; k < radius; ++k)
    for (int x = 0; x < width; ++x)
      sums[x] = static_cast<std::uint16_t>(sums[x] + row(k)[x]);
  for (int y = 0; y < height; ++y) {
    move_down(row(y + radius), row(y - radius - 1), width, sums, halves + radius);
    std::fill_n(halves, radius, halves[radius]);
    std::fill_n(halves + radius + width, radius, halves[radius + width - 1]);
    add_fours(halves, count - 3, fours);
    subtract_mean<radius>(row(y), halves, fours, width, gain, out + static_cast<std::ptrdiff_t>(y) * width);
  }
}

void high_pass_any(const std::uint8_t* in, std::ptrdiff_t stride, int width, int height, int radius, int gain,
                   std::uint8_t* out, std::uint16_t* work) {
  if (width > 0 && height > 0)
    with_constant<5, 8>(
        radius, [&](auto r) HWY_ATTR { high_pass_of<r>(in, stride, width, height, gain, out, work); });
}

void steepest_of_row(const std::uint8_t* __restrict above, const std::uint8_t* __restrict here,
                     const std::uint8_t* __restrict under, const std::uint8_t* __restrict ground, int width,
                     int rank, std::uint16_t* __restrict keys) {
  for (int x = 1; x < width - 1; ++x) {
    const auto across = static_cast<std::int16_t>(here[x + 1] - here[x - 1]);
    const auto down = static_cast<std::int16_t>(under[x] - above[x]);
    auto slope = static_cast<std::int16_t>((across < 0 ? -across : across) + (down < 0 ? -down : down));
    slope = slope > 255 ? std::int16_t{255} : slope;
    const auto key = static_cast<std::uint16_t>(ground[x] ? slope * 16 + rank : 0);
    keys[x] = key > keys[x] ? key : keys[x];
  }
}

void mean_of_cells(const std::uint8_t* __restrict in, std::ptrdiff_t stride, int count,
                   std::uint8_t* __restrict out) {
  for (int x = 0; x < count; ++x) {
    int sum = 8;
    for (int y = 0; y < 4; ++y)
      for (int k = 0; k < 4; ++k)
        sum += in[y * stride + 4 * x + k];
    out[x] = static_cast<std::uint8_t>(sum >> 4);
  }
}

HWY_INLINE std::uint8_t bilinear(const Picture& source, std::int32_t u, std::int32_t v) {
  const int column = u >> 16, row = v >> 16;
  if (static_cast<unsigned>(column) >= static_cast<unsigned>(source.width - 1) ||
      static_cast<unsigned>(row) >= static_cast<unsigned>(source.height - 1))
    return 0;
  const std::uint8_t* at = source.row(row) + column;
  const int fu = (u >> 9) & 127, fv = (v >> 9) & 127;
  const int upper = at[0] * (128 - fu) + at[1] * fu,
            lower = at[source.width] * (128 - fu) + at[source.width + 1] * fu;
  return static_cast<std::uint8_t>((upper * (128 - fv) + lower * fv + 8192) >> 14);
}

/// Whether both ends of a segment are beyond the same side of the picture.
HWY_INLINE bool lies_outside(const Picture& source, const std::int32_t* nodes) {
  const std::int32_t right = (source.width - 1) << 16, bottom = (source.height - 1) << 16;
  return (nodes[0] < 0 && nodes[2] < 0) || (nodes[1] < 0 && nodes[3] < 0) ||
         (nodes[0] >= right && nodes[2] >= right) || (nodes[1] >= bottom && nodes[3] >= bottom);
}

#if HWY_TARGET != HWY_SCALAR
/// Pixels that one look-up in 16 bytes of a row gives.
constexpr int looked_up = 8;
/// Look-ups at once, and the bytes of each.
#if HWY_MAX_BYTES >= 32 && !HWY_HAVE_SCALABLE
constexpr int lookups = 2;
using Looked = hn::FixedTag<std::uint8_t, 32>;
HWY_INLINE hn::Vec<Looked> read(const std::uint8_t* first, const std::uint8_t* second) {
  const hn::Half<Looked> half;
  return hn::Combine(Looked(), hn::LoadU(half, second), hn::LoadU(half, first));
}
#else
constexpr int lookups = 1;
using Looked = hn::CappedTag<std::uint8_t, 16>;
HWY_INLINE hn::Vec<Looked> read(const std::uint8_t* first, const std::uint8_t*) {
  return hn::LoadU(Looked(), first);
}
#endif

/// Whether warp_few() can compute pixels at these steps: from any start the columns of a look-up span less
/// than 15, and its rows are at most two.
HWY_INLINE bool are_near(std::int32_t du, std::int32_t dv) {
  constexpr int last = looked_up - 1;
  return du >= 0 && last * du < 14 << 16 && last * std::abs(dv) < 1 << 16;
}

/// Computes the pixels from (u0, v0) on. All lie inside the picture, which has at least 16 columns.
HWY_INLINE void warp_few(const Picture& source, std::int32_t u0, std::int32_t v0, std::int32_t du,
                         std::int32_t dv, std::uint8_t* out) {
  const Looked d8;
  const hn::Repartition<std::int16_t, Looked> d;
  const auto set = [&](std::int32_t value) HWY_ATTR { return hn::Set(d, static_cast<std::int16_t>(value)); };
  // The column and the row where each look-up begins.
  const std::int32_t u1 = u0 + (lookups - 1) * looked_up * du, v1 = v0 + (lookups - 1) * looked_up * dv,
                     rise = std::min((looked_up - 1) * dv, 0);
  const int column0 = u0 >> 16, row0 = (v0 + rise) >> 16, column1 = u1 >> 16, row1 = (v1 + rise) >> 16;
  // Both in units of 1/128, from the beginning of the look-up: the sum of a multiple and of what the 9 bits
  // below carry.
  const auto index = hn::Iota(d, 0);
  const auto position = [&](std::int32_t start, std::int32_t step, int begin0, int begin1) HWY_ATTR {
    const auto below = hn::Add(set(start & 511), hn::Mul(index, set(step & 511)));
    auto whole = hn::Add(set((start >> 9) - begin0 * 128), hn::Mul(index, set(step >> 9)));
    if constexpr (lookups > 1) {
      const auto second = hn::Gt(index, set(looked_up - 1));
      whole = hn::Sub(whole, hn::IfThenElseZero(second, set((begin1 - begin0) * 128)));
    }
    return hn::Add(whole, hn::ShiftRight<9>(below));
  };
  const auto u = position(u0, du, column0, column1), v = position(v0, dv, row0, row1);
  // Looks up two neighbouring pixels as a pair of bytes.
  const auto at = hn::ShiftRight<7>(u);
  const auto both = hn::BitCast(d8, hn::Add(hn::Or(at, hn::ShiftLeft<8>(at)), set(256)));
  const std::ptrdiff_t width = source.width;
  const std::uint8_t *from0 = source.row(row0) + column0, *from1 = source.row(row1) + column1;
  const auto pixels = [&](std::ptrdiff_t after0, std::ptrdiff_t after1) HWY_ATTR {
    return hn::BitCast(d, hn::TableLookupBytes(read(from0 + after0, from1 + after1), both));
  };
  // The third row is read where a pixel needs it, and never the last one of the picture.
  const int last = source.height - 3;
  const auto first = pixels(0, 0), second = pixels(width, width),
             third = pixels(row0 < last ? 2 * width : width, row1 < last ? 2 * width : width);
  const auto fu = hn::And(u, set(127)), fv = hn::And(v, set(127));
  const auto mix = [&](auto pair) HWY_ATTR {
    const auto left = hn::And(pair, set(255)),
               right =
                   hn::BitCast(d, hn::ShiftRight<8>(hn::BitCast(hn::RebindToUnsigned<decltype(d)>(), pair)));
    return hn::Add(hn::ShiftLeft<7>(left), hn::Mul(hn::Sub(right, left), fu));
  };
  const auto is_second = hn::Gt(v, set(127));
  const auto upper = mix(hn::IfThenElse(is_second, second, first)),
             lower = mix(hn::IfThenElse(is_second, third, second));
  // (128 upper + (lower - upper) fv + 2^13) / 2^14, in 16 bits: the difference by its upper and its lower
  // part.
  const auto difference = hn::Sub(lower, upper);
  const auto carried = hn::ShiftRight<7>(hn::Mul(hn::And(difference, set(127)), fv)),
             whole = hn::Mul(hn::ShiftRight<7>(difference), fv);
  const auto sum = hn::Add(hn::Add(upper, set(64)), hn::Add(whole, carried));
  const hn::Rebind<std::uint8_t, decltype(d)> bytes;
  hn::StoreU(hn::DemoteTo(bytes, hn::ShiftRight<7>(sum)), bytes, out);
}
#endif

HWY_INLINE void warp_row(const Picture& source, const std::int32_t* nodes, int segments, std::uint8_t* out) {
#if HWY_TARGET != HWY_SCALAR
  const int right = source.width < 16 ? 0 : (source.width - 2) << 16, bottom = (source.height - 2) << 16;
  const auto is_inside = [=](std::int32_t u, std::int32_t v) {
    return u >= 0 && v >= 0 && u < right && v < bottom;
  };
  bool ends_inside = is_inside(nodes[0], nodes[1]);
#endif
  for (int s = 0; s < segments; ++s, nodes += 2, out += 16) {
    const std::int32_t du = (nodes[2] - nodes[0]) / 16, dv = (nodes[3] - nodes[1]) / 16;
#if HWY_TARGET != HWY_SCALAR
    const bool starts_inside = ends_inside;
    ends_inside = is_inside(nodes[2], nodes[3]);
    if (starts_inside && ends_inside && are_near(du, dv)) {
      for (int x = 0; x < 16; x += lookups * looked_up)
        warp_few(source, nodes[0] + x * du, nodes[1] + x * dv, du, dv, out + x);
      continue;
    }
#endif
    if (lies_outside(source, nodes)) {
      std::fill_n(out, 16, std::uint8_t{0});
      continue;
    }
    for (int x = 0; x < 16; ++x)
      out[x] = bilinear(source, nodes[0] + x * du, nodes[1] + x * dv);
  }
}

void warp_all(const Picture& picture, const std::int32_t* nodes, int segments, int rows, std::uint8_t* out,
              std::ptrdiff_t out_stride) {
  const Picture source = picture; // a copy, which the pixels that are written cannot change
  for (int y = 0; y < rows; ++y)
    warp_row(source, nodes + static_cast<std::ptrdiff_t>(y) * 2 * (segments + 1), segments,
             out + y * out_stride);
}

// Auto-vectorised.
void place_all(const HypothesisShifts& shifts, int x, int y, int reach, int above, int below, int stride,
               std::int32_t* __restrict offsets) {
  for (int k = 0; k < most_offsets; ++k) {
    const int along = shifts.along[k], aside = shifts.aside[k];
    const int column = (along * x - aside * y + (1 << 14)) >> 15,
              row = (along * y + aside * x + (1 << 14)) >> 15;
    const bool possible = row >= -above && row <= below && shifts.least_reach[k] <= reach;
    offsets[k] = possible ? row * stride + column : no_offset;
  }
}

#if HWY_TARGET != HWY_SCALAR
using D8 = hn::CappedTag<std::uint8_t, 16>;
using D16 = hn::Repartition<std::uint16_t, D8>;
using D32 = hn::Repartition<std::uint32_t, D8>;

/// Sums of each four neighbouring bytes; the sums fit a byte.
HWY_INLINE hn::Vec<D32> sum_fours(hn::Vec<D8> bytes) {
  const D16 d16;
  const D32 d32;
  const auto pairs = hn::BitCast(d16, bytes);
  const auto twos = hn::Add(hn::And(pairs, hn::Set(d16, 255)), hn::ShiftRight<8>(pairs));
  const auto fours = hn::BitCast(d32, twos);
  return hn::Add(hn::And(fours, hn::Set(d32, 65535)), hn::ShiftRight<16>(fours));
}

/// Compares four cells at once.
void compare(const std::uint8_t* frame, std::ptrdiff_t frame_stride, const std::uint8_t* warped,
             std::ptrdiff_t warped_stride, const std::int32_t* offsets, std::uint16_t* sums,
             std::ptrdiff_t plane, std::uint8_t* whole) {
  const D8 d;
  const hn::RebindToSigned<D32> signed32;
  const hn::Rebind<std::uint16_t, D32> half;
  const auto most = hn::Set(d, 40);
  const auto row0 = hn::LoadU(d, frame), row1 = hn::LoadU(d, frame + frame_stride),
             row2 = hn::LoadU(d, frame + 2 * frame_stride), row3 = hn::LoadU(d, frame + 3 * frame_stride);
  const auto clipped = [&](auto mine, const std::uint8_t* at) HWY_ATTR {
    const auto other = hn::LoadU(d, at);
    return hn::Min(hn::Or(hn::SaturatedSub(mine, other), hn::SaturatedSub(other, mine)), most);
  };
  for (int k = 0; k < most_offsets; ++k, sums += plane) {
    if (offsets[k] == no_offset) {
      hn::StoreU(hn::Set(half, most_difference), half, sums);
      continue;
    }
    const std::uint8_t* at = warped + offsets[k];
    const auto upper = hn::Add(clipped(row0, at), clipped(row1, at + warped_stride)),
               lower = hn::Add(clipped(row2, at + 2 * warped_stride), clipped(row3, at + 3 * warped_stride));
    const auto sum = sum_fours(hn::Add(upper, lower));
    hn::StoreU(hn::DemoteTo(half, hn::BitCast(signed32, sum)), half, sums);
  }
  const auto least =
      hn::Min(hn::Min(hn::LoadU(d, warped), hn::LoadU(d, warped + warped_stride)),
              hn::Min(hn::LoadU(d, warped + 2 * warped_stride), hn::LoadU(d, warped + 3 * warped_stride)));
  alignas(16) std::uint32_t holes[4];
  hn::Store(hn::BitCast(D32(), hn::VecFromMask(d, hn::Eq(least, hn::Zero(d)))), D32(), holes);
  for (int c = 0; c < 4; ++c)
    whole[c] = holes[c] == 0;
}
#else

void compare(const std::uint8_t* frame, std::ptrdiff_t frame_stride, const std::uint8_t* warped,
             std::ptrdiff_t warped_stride, const std::int32_t* offsets, std::uint16_t* sums,
             std::ptrdiff_t plane, std::uint8_t* whole) {
  for (int c = 0; c < 4; ++c) {
    whole[c] = 1;
    for (int y = 0; y < 4; ++y)
      for (int x = 4 * c; x < 4 * c + 4; ++x)
        if (warped[y * warped_stride + x] == 0)
          whole[c] = 0;
    for (int k = 0; k < most_offsets; ++k) {
      int sum = offsets[k] == no_offset ? most_difference : 0;
      for (int y = 0; y < 4 && offsets[k] != no_offset; ++y)
        for (int x = 4 * c; x < 4 * c + 4; ++x)
          sum += std::min(std::abs(frame[y * frame_stride + x] - warped[offsets[k] + y * warped_stride + x]),
                          40);
      sums[k * plane + c] = static_cast<std::uint16_t>(sum);
    }
  }
}

#endif

// These loops are auto-vectorised too.
void add_rows(const std::uint16_t* __restrict above, const std::uint16_t* __restrict here,
              const std::uint16_t* __restrict under, int columns, std::uint16_t* __restrict sums) {
  for (int j = 0; j < columns + 2; ++j)
    sums[j] = static_cast<std::uint16_t>(above[j] + here[j] + under[j]);
}

HWY_INLINE std::uint16_t window_at(const std::uint16_t* sums, int j) {
  return static_cast<std::uint16_t>(sums[j] + sums[j + 1] + sums[j + 2]);
}

void store_windows(const std::uint16_t* __restrict sums, int columns, std::uint16_t* __restrict out) {
  for (int j = 0; j < columns; ++j)
    out[j] = window_at(sums, j);
}

void lower_to(const std::uint16_t* __restrict sums, int columns, std::uint16_t* __restrict least) {
  for (int j = 0; j < columns; ++j) {
    const std::uint16_t cost = window_at(sums, j);
    least[j] = cost < least[j] ? cost : least[j];
  }
}

void lower_with(const std::uint16_t* __restrict sums, std::uint16_t index, int columns,
                std::uint16_t* __restrict least, std::uint16_t* __restrict which) {
  for (int j = 0; j < columns; ++j) {
    const std::uint16_t cost = window_at(sums, j);
    const bool less = cost < least[j];
    which[j] = less ? index : which[j];
    least[j] = less ? cost : least[j];
  }
}

void add_windows(const std::uint16_t* above, const std::uint16_t* here, const std::uint16_t* under,
                 int columns, std::ptrdiff_t plane, const HypothesisOrder& order, const WindowCosts& out,
                 std::uint16_t* work) {
  const auto rows_of = [&](int k) {
    add_rows(above + k * plane, here + k * plane, under + k * plane, columns, work);
    return work;
  };
  store_windows(rows_of(0), columns, out.ground);
  store_windows(rows_of(order.even_grey), columns, out.even_grey);
  store_windows(rows_of(order.first_control), columns, out.control);
  for (int k = order.first_control + 1; k < order.end_control; ++k)
    lower_to(rows_of(k), columns, out.control);
  store_windows(rows_of(order.first_standing), columns, out.standing);
  std::fill_n(out.which, columns, std::uint16_t{0});
  for (int k = order.first_standing + 1; k < order.end_standing; ++k)
    lower_with(rows_of(k), static_cast<std::uint16_t>(k - order.first_standing), columns, out.standing,
               out.which);
}

// --- sums of cells that are moved with the ground ---

HWY_INLINE void mix_sums(const std::int16_t* a, const std::int16_t* b, const std::int16_t* c,
                         const std::int16_t* d, int fu, int fv, int keep, std::int16_t* out) {
  const hn::CappedTag<std::int32_t, 4> wide;
  const hn::Rebind<std::int16_t, decltype(wide)> narrow;
  for (std::size_t i = 0; i < 4; i += hn::Lanes(wide)) {
    const auto row = [&](const std::int16_t* left, const std::int16_t* right) HWY_ATTR {
      return hn::Add(hn::Mul(hn::PromoteTo(wide, hn::LoadU(narrow, left + i)), hn::Set(wide, 64 - fu)),
                     hn::Mul(hn::PromoteTo(wide, hn::LoadU(narrow, right + i)), hn::Set(wide, fu)));
    };
    const auto sum =
        hn::Add(hn::Mul(row(a, b), hn::Set(wide, 64 - fv)), hn::Mul(row(c, d), hn::Set(wide, fv)));
    const auto value = hn::ShiftRight<12>(hn::Add(sum, hn::Set(wide, 2048)));
    const auto kept = hn::ShiftRight<8>(hn::Add(hn::Mul(value, hn::Set(wide, keep)), hn::Set(wide, 128)));
    hn::StoreU(hn::DemoteTo(narrow, kept), narrow, out + i);
  }
}

void move_sums(const SumSource& source, const std::int32_t* nodes, int columns, int keep, std::int16_t* out) {
  for (int j = 0; j < columns; ++j, out += 4) {
    const std::int32_t* node = nodes + j / 4 * 2;
    const int u = node[0] + (node[2] - node[0]) * (j % 4) / 4,
              v = node[1] + (node[3] - node[1]) * (j % 4) / 4;
    const int column = u >> 10, row = v >> 10; // cells of 4 pixels in Q8
    // Positions up to half a cell outside use the outermost cells.
    if (column < -1 || row < -1 || column > source.columns - 1 || row > source.rows - 1) {
      std::fill_n(out, 4, std::int16_t{0});
      continue;
    }
    const int c0 = std::max(column, 0), c1 = std::min(column + 1, source.columns - 1), r0 = std::max(row, 0),
              r1 = std::min(row + 1, source.rows - 1);
    const std::int16_t *upper = source.sums + std::ptrdiff_t{4} * r0 * source.columns,
                       *lower = source.sums + std::ptrdiff_t{4} * r1 * source.columns;
    mix_sums(upper + 4 * c0, upper + 4 * c1, lower + 4 * c0, lower + 4 * c1, (u & 1023) >> 4, (v & 1023) >> 4,
             keep, out);
  }
}

/// Quotients bit by bit: two integer bits and eight fraction bits. Auto-vectorised.
void evidence_of(const std::int16_t* __restrict sums, int count, std::int16_t* __restrict evidence) {
  for (int i = 0; i < count; ++i) {
    const std::int16_t quality = sums[4 * i], frames = sums[4 * i + 1];
    const auto divisor = static_cast<std::uint16_t>(frames > 8192 ? frames : std::int16_t{8192}),
               twice = static_cast<std::uint16_t>(2 * divisor);
    auto rest = static_cast<std::uint16_t>(quality < 0 ? -quality : quality);
    std::uint16_t quotient = rest >= twice ? 1 : 0;
    rest = static_cast<std::uint16_t>(rest >= twice ? rest - twice : rest);
#pragma GCC unroll 9
    for (int bit = 0; bit < 9; ++bit) {
      const bool less = rest < divisor;
      quotient = static_cast<std::uint16_t>(2 * quotient + (less ? 0 : 1));
      rest = static_cast<std::uint16_t>(less ? rest : rest - divisor);
      rest = static_cast<std::uint16_t>(2 * rest);
    }
    const auto size = static_cast<std::int16_t>(quotient);
    evidence[i] = static_cast<std::int16_t>(quality < 0 ? -size : size);
  }
}

} // namespace HWY_NAMESPACE
} // namespace terrainseg::kernels
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace terrainseg::kernels {

TERRAINSEG_DISPATCH(high_pass, high_pass_any);
TERRAINSEG_DISPATCH(steepest, steepest_of_row);
TERRAINSEG_DISPATCH(mean_of_quarters, mean_of_cells);
TERRAINSEG_DISPATCH(warp_rows, warp_all);
TERRAINSEG_DISPATCH(place_hypotheses, place_all);
TERRAINSEG_DISPATCH(compare_cells, compare);
TERRAINSEG_DISPATCH(window_costs, add_windows);
TERRAINSEG_DISPATCH(moved_sums, move_sums);
TERRAINSEG_DISPATCH(evidence_of_sums, evidence_of);

} // namespace terrainseg::kernels
#endif
