// SPDX-License-Identifier: LGPL-2.1-or-later
#include "base/color_transform.hpp"

#include <algorithm>
#include <cstring>

#include "kernels/cells.hpp"

namespace terrainseg {
namespace {

/// Converts Q24 to 8 bits, rounded and clamped.
std::uint8_t to_byte(std::int64_t value) {
  return static_cast<std::uint8_t>(std::clamp<std::int64_t>((value + (1 << 23)) >> 24, 0, 255));
}

/// Gains from limited to full range: 255/219 and 255/224 in Q16.
constexpr std::int64_t luma_gain = 76309, chroma_gain = 74606, unity = 65536;

constexpr int fraction = 16;
constexpr std::int64_t one = std::int64_t{1} << 28; // working precision of the matrices
using Matrix = std::array<std::array<std::int64_t, 3>, 3>;

struct LumaWeights {
  std::int64_t red, blue; // in 1/10000
};

LumaWeights luma_weights_of(ColorMatrix matrix) {
  constexpr LumaWeights weights[] = {{2990, 1140}, {2126, 722}, {2627, 593}};
  return weights[static_cast<int>(matrix)];
}

Matrix to_rgb(const LumaWeights& w) {
  const std::int64_t green = 10000 - w.red - w.blue;
  const std::int64_t rv = one * 2 * (10000 - w.red) / 10000, bu = one * 2 * (10000 - w.blue) / 10000;
  return {{{one, 0, rv}, {one, -bu * w.blue / green, -rv * w.red / green}, {one, bu, 0}}};
}

Matrix from_rgb(const LumaWeights& w) {
  const std::int64_t green = 10000 - w.red - w.blue;
  const std::int64_t u = 2 * (10000 - w.blue), v = 2 * (10000 - w.red);
  return {{{one * w.red / 10000, one * green / 10000, one * w.blue / 10000},
           {-one * w.red / u, -one * green / u, one / 2},
           {one / 2, -one * green / v, -one * w.blue / v}}};
}

Matrix product(const Matrix& a, const Matrix& b) {
  Matrix m{};
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j)
      m[i][j] = (a[i][0] * b[0][j] + a[i][1] * b[1][j] + a[i][2] * b[2][j]) / one;
  return m;
}

void transform_component(const ColorTransform& t, std::size_t k,
                         const std::array<const std::uint8_t*, 3>& source, std::uint8_t* target, int count) {
  if (t.identity)
    std::memmove(target, source[k], count);
  else
    kernels::weigh_components(source, t.matrix[k], t.offset[k], count, target);
}

} // namespace

std::array<std::uint8_t, 3> rgb_of(const std::array<std::uint16_t, 3>& mean, const ColorSpace& space) {
  const bool limited = space.colorimetry.range == ColorRange::limited;
  const std::int64_t black = limited ? 16 << 8 : 0, gain = limited ? luma_gain : unity;
  const auto level = [&](int c) { return (std::int64_t{mean[c]} - black) * gain; }; // Q24
  if (space.rgb)
    return {to_byte(level(0)), to_byte(level(1)), to_byte(level(2))};
  const Matrix m = to_rgb(luma_weights_of(space.colorimetry.matrix));
  const auto chroma = [&](int c) {
    return ((std::int64_t{mean[c]} - (128 << 8)) * (limited ? chroma_gain : unity)) >> 16; // Q8
  };
  const std::int64_t y = level(0), u = chroma(1), v = chroma(2);
  const auto color = [&](int c) {
    const auto q16 = [&](int k) { return (m[c][k] + 2048) >> 12; };
    return to_byte(y + q16(1) * u + q16(2) * v);
  };
  return {color(0), color(1), color(2)};
}

ColorTransform color_transform_of(bool rgb, const Colorimetry& colorimetry) {
  const LumaWeights bt601 = luma_weights_of(ColorMatrix::bt601);
  Matrix m{{{one, 0, 0}, {0, one, 0}, {0, 0, one}}};
  if (rgb)
    m = from_rgb(bt601);
  else if (colorimetry.matrix != ColorMatrix::bt601)
    m = product(from_rgb(bt601), to_rgb(luma_weights_of(colorimetry.matrix)));

  const bool limited = colorimetry.range == ColorRange::limited;
  ColorTransform t;
  for (int i = 0; i < 3; ++i) {
    std::int64_t zero = 0; // sum of the contributions of the inputs' zero points
    for (int j = 0; j < 3; ++j) {
      const bool chroma = !rgb && j > 0;
      const std::int64_t span = !limited ? 255 : chroma ? 224 : 219;
      t.matrix[i][j] = static_cast<std::int32_t>((m[i][j] * 255 / span) >> (28 - fraction));
      zero += std::int64_t{t.matrix[i][j]} * (chroma ? 128 : limited ? 16 : 0);
    }
    const std::int64_t half = std::int64_t{1} << (fraction - 1);
    t.offset[i] = static_cast<std::int32_t>((i > 0 ? std::int64_t{128} << fraction : 0) + half - zero);
  }
  t.identity = !rgb && !limited && colorimetry.matrix == ColorMatrix::bt601;
  return t;
}

void transform_row(const ColorTransform& t, const std::array<const std::uint8_t*, 3>& source,
                   const std::array<std::uint8_t*, 3>& target, int count) {
  for (std::size_t k = 0; k < 3; ++k)
    transform_component(t, k, source, target[k], count);
}

void transform_luma_row(const ColorTransform& t, const std::array<const std::uint8_t*, 3>& source,
                        std::uint8_t* target, int count) {
  transform_component(t, 0, source, target, count);
}

} // namespace terrainseg
