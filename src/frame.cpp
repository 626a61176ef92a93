// SPDX-License-Identifier: LGPL-2.1-or-later
#include "terrainseg/frame.hpp"

namespace terrainseg {
namespace {

constexpr FormatLayout planar(int second, int third, int x_shift, int y_shift) {
  const auto xs = static_cast<std::uint8_t>(x_shift), ys = static_cast<std::uint8_t>(y_shift);
  return {{{{0, 0, 1, 0, 0},
            {static_cast<std::uint8_t>(second), 0, 1, xs, ys},
            {static_cast<std::uint8_t>(third), 0, 1, xs, ys}}},
          3,
          false};
}

constexpr FormatLayout semi_planar(std::uint8_t u, std::uint8_t v) {
  return {{{{0, 0, 1, 0, 0}, {1, u, 2, 1, 1}, {1, v, 2, 1, 1}}}, 2, false};
}

constexpr FormatLayout packed_422(std::uint8_t y, std::uint8_t u, std::uint8_t v) {
  return {{{{0, y, 2, 0, 0}, {0, u, 4, 1, 0}, {0, v, 4, 1, 0}}}, 1, false};
}

constexpr FormatLayout packed_rgb(std::uint8_t step, std::uint8_t r, std::uint8_t g, std::uint8_t b) {
  return {{{{0, r, step, 0, 0}, {0, g, step, 0, 0}, {0, b, step, 0, 0}}}, 1, true};
}

constexpr std::array<FormatLayout, pixel_format_count> layouts = {{
    planar(1, 2, 1, 1),     // I420
    planar(2, 1, 1, 1),     // YV12
    semi_planar(0, 1),      // NV12
    semi_planar(1, 0),      // NV21
    planar(1, 2, 1, 0),     // Y42B
    planar(1, 2, 0, 0),     // Y444
    packed_422(0, 1, 3),    // YUY2
    packed_422(1, 0, 2),    // UYVY
    packed_rgb(3, 0, 1, 2), // RGB
    packed_rgb(3, 2, 1, 0), // BGR
    packed_rgb(4, 0, 1, 2), // RGBx
    packed_rgb(4, 2, 1, 0), // BGRx
    packed_rgb(4, 1, 2, 3), // xRGB
    packed_rgb(4, 3, 2, 1), // xBGR
    packed_rgb(4, 0, 1, 2), // RGBA
    packed_rgb(4, 2, 1, 0), // BGRA
    packed_rgb(4, 1, 2, 3), // ARGB
    packed_rgb(4, 3, 2, 1), // ABGR
}};

} // namespace

const FormatLayout& layout_of(PixelFormat format) {
  return layouts[static_cast<std::size_t>(format)];
}

} // namespace terrainseg
