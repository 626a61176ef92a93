// SPDX-License-Identifier: LGPL-2.1-or-later
#include "base/color.hpp"

#include <algorithm>

namespace terrainseg {
namespace {

/// Coefficients of V in R, U in G, V in G and U in B for full-range components (Q16).
struct Weights {
  std::int64_t red_v, green_u, green_v, blue_u;
};

// For ITU-R BT.601, BT.709 and BT.2020: 2 (1 - Kr); the others follow from Kr and Kb.
constexpr Weights weights_of(ColorMatrix matrix) {
  switch (matrix) {
  case ColorMatrix::bt709:
    return {103206, 12276, 30679, 121609};
  case ColorMatrix::bt2020:
    return {96639, 10784, 37444, 123299};
  case ColorMatrix::bt601:
    break;
  }
  return {91881, 22553, 46802, 116130};
}

/// Converts Q24 to 8 bits, rounded and clamped.
std::uint8_t to_byte(std::int64_t value) {
  return static_cast<std::uint8_t>(std::clamp<std::int64_t>((value + (1 << 23)) >> 24, 0, 255));
}

/// Gains from limited to full range: 255/219 and 255/224 in Q16.
constexpr std::int64_t luma_gain = 76309, chroma_gain = 74606, unity = 65536;

} // namespace

std::array<std::uint8_t, 3> rgb_of(const std::array<std::uint16_t, 3>& mean, const ColorSpace& space) {
  const bool limited = space.colorimetry.range == ColorRange::limited;
  const std::int64_t black = limited ? 16 << 8 : 0, gain = limited ? luma_gain : unity;
  const auto level = [&](int c) { return (std::int64_t{mean[c]} - black) * gain; }; // Q24
  if (space.rgb)
    return {to_byte(level(0)), to_byte(level(1)), to_byte(level(2))};
  const Weights w = weights_of(space.colorimetry.matrix);
  const auto chroma = [&](int c) {
    return ((std::int64_t{mean[c]} - (128 << 8)) * (limited ? chroma_gain : unity)) >> 16; // Q8
  };
  const std::int64_t y = level(0), u = chroma(1), v = chroma(2);
  return {to_byte(y + w.red_v * v), to_byte(y - w.green_u * u - w.green_v * v), to_byte(y + w.blue_u * u)};
}

} // namespace terrainseg
