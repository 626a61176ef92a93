// SPDX-License-Identifier: LGPL-2.1-or-later
#include "terrainseg/frame.hpp"

#include <cstdlib>

#include "base/pipeline.hpp"

namespace terrainseg {
namespace {

constexpr FormatLayout planar(std::uint8_t second, std::uint8_t third, std::uint8_t x_shift,
                              std::uint8_t y_shift) {
  return {{{{0, 0, 1, 0, 0}, {second, 0, 1, x_shift, y_shift}, {third, 0, 1, x_shift, y_shift}}}, 3, false};
}

constexpr FormatLayout semi_planar(std::uint8_t u, std::uint8_t v, std::uint8_t x_shift = 1,
                                   std::uint8_t y_shift = 1) {
  return {{{{0, 0, 1, 0, 0}, {1, u, 2, x_shift, y_shift}, {1, v, 2, x_shift, y_shift}}}, 2, false};
}

constexpr FormatLayout packed_422(std::uint8_t y, std::uint8_t u, std::uint8_t v) {
  return {{{{0, y, 2, 0, 0}, {0, u, 4, 1, 0}, {0, v, 4, 1, 0}}}, 1, false};
}

constexpr FormatLayout packed_rgb(std::uint8_t step, std::uint8_t r, std::uint8_t g, std::uint8_t b) {
  return {{{{0, r, step, 0, 0}, {0, g, step, 0, 0}, {0, b, step, 0, 0}}}, 1, true};
}

constexpr FormatLayout gray() {
  return {{{{0, 0, 1, 0, 0}, {}, {}}}, 1, false, 1};
}

/// Changes a layout to samples of two bytes with `depth` bits above `shift` unused bits.
constexpr FormatLayout deep(FormatLayout layout, std::uint8_t depth, std::uint8_t shift) {
  for (ComponentLayout& part : layout.components) {
    part.offset = static_cast<std::uint8_t>(2 * part.offset);
    part.step = static_cast<std::uint8_t>(2 * part.step);
  }
  layout.depth = depth;
  layout.shift = shift;
  return layout;
}

constexpr std::array<FormatLayout, pixel_format_count> layouts = {{
    planar(1, 2, 1, 1),              // I420
    planar(2, 1, 1, 1),              // YV12
    semi_planar(0, 1),               // NV12
    semi_planar(1, 0),               // NV21
    planar(1, 2, 1, 0),              // Y42B
    planar(1, 2, 0, 0),              // Y444
    packed_422(0, 1, 3),             // YUY2
    packed_422(1, 0, 2),             // UYVY
    packed_rgb(3, 0, 1, 2),          // RGB
    packed_rgb(3, 2, 1, 0),          // BGR
    packed_rgb(4, 0, 1, 2),          // RGBx
    packed_rgb(4, 2, 1, 0),          // BGRx
    packed_rgb(4, 1, 2, 3),          // xRGB
    packed_rgb(4, 3, 2, 1),          // xBGR
    packed_rgb(4, 0, 1, 2),          // RGBA
    packed_rgb(4, 2, 1, 0),          // BGRA
    packed_rgb(4, 1, 2, 3),          // ARGB
    packed_rgb(4, 3, 2, 1),          // ABGR
    semi_planar(0, 1, 1, 0),         // NV16
    semi_planar(1, 0, 1, 0),         // NV61
    semi_planar(0, 1, 0, 0),         // NV24
    packed_422(0, 3, 1),             // YVYU
    packed_422(1, 2, 0),             // VYUY
    gray(),                          // GRAY8
    deep(gray(), 16, 0),             // GRAY16_LE
    deep(semi_planar(0, 1), 10, 6),  // P010_10LE
    deep(planar(1, 2, 1, 1), 10, 0), // I420_10LE
    deep(planar(1, 2, 1, 0), 10, 0), // I422_10LE
}};

} // namespace

const FormatLayout& layout_of(PixelFormat format) {
  return layouts[static_cast<std::size_t>(format)];
}

std::string flaw_of(const Frame& frame) {
  constexpr int most = 32767;
  if (static_cast<int>(frame.format) >= pixel_format_count)
    return "the pixel format is not one of those that are read";
  if (frame.width < 1 || frame.height < 1 || frame.width > most || frame.height > most)
    return "a frame of " + std::to_string(frame.width) + "x" + std::to_string(frame.height) +
           " pixels: each side must be 1.." + std::to_string(most);
  const FormatLayout& layout = layout_of(frame.format);
  for (const ComponentLayout& part : layout.parts()) {
    const Plane& plane = frame.planes[part.plane];
    if (!plane.data)
      return "plane " + std::to_string(part.plane) + " of the frame has no data";
    const int row = row_bytes(layout, part.plane, frame.width);
    if (std::abs(plane.stride) < row && subsampled(frame.height, part.y_shift) > 1)
      return "plane " + std::to_string(part.plane) + " has a stride of " + std::to_string(plane.stride) +
             " bytes, a row needs " + std::to_string(row);
  }
  return {};
}

std::string flaw_of(const MaskTarget& target, const Frame& frame, int mask_level) {
  if (!target.plane.data)
    return {};
  const auto text_of = [](int width, int height) {
    return std::to_string(width) + "x" + std::to_string(height);
  };
  const int width = mask_extent(frame.width, mask_level), height = mask_extent(frame.height, mask_level);
  if (target.width != width || target.height != height)
    return "the mask target is " + text_of(target.width, target.height) + ", the mask of this frame is " +
           text_of(width, height);
  if (std::abs(target.plane.stride) < target.width && target.height > 1)
    return "the mask target's stride of " + std::to_string(target.plane.stride) +
           " bytes is shorter than its row of " + std::to_string(target.width);
  return {};
}

} // namespace terrainseg
