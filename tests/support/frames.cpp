// SPDX-License-Identifier: LGPL-2.1-or-later
#include "frames.hpp"

#include <algorithm>
#include <utility>

namespace terrainseg::test {

OwnedFrame::OwnedFrame(PixelFormat format, int width, int height, const Painter& paint, int padding) {
  const FormatLayout& layout = layout_of(format);
  frame_.format = format;
  frame_.width = width;
  frame_.height = height;
  for (int p = 0; p < layout.planes; ++p) {
    const int stride = row_bytes(layout, p, width) + padding;
    planes_[p].assign(static_cast<std::size_t>(stride) * plane_rows(layout, p, height), 0xa5);
    frame_.planes[p] = {planes_[p].data(), stride};
  }
  for (int c = 0; c < layout.component_count; ++c) {
    const ComponentLayout& part = layout.components[c];
    for (int y = 0; y < subsampled(height, part.y_shift); ++y)
      for (int x = 0; x < subsampled(width, part.x_shift); ++x)
        put(layout, &planes_[part.plane][y * frame_.planes[part.plane].stride + part.offset + x * part.step],
            paint(x << part.x_shift, y << part.y_shift)[c]);
  }
}

void OwnedFrame::put(const FormatLayout& layout, std::uint8_t* at, std::uint8_t value) {
  if (layout.depth == 8) {
    *at = value;
    return;
  }
  noise_ = noise_ * 1664525U + 1013904223U;
  const unsigned below = noise_ >> (40 - layout.depth);
  const unsigned word = (value << (layout.depth - 8) | below) << layout.shift;
  at[0] = static_cast<std::uint8_t>(word);
  at[1] = static_cast<std::uint8_t>(word >> 8);
}

Painter drive(int width, int height, int frame) {
  return [=](int x, int y) -> Components {
    const int horizon = height * 2 / 5, light = (frame * 3) % 17;
    const auto shade = [&](int value, int bits, int z) {
      return static_cast<std::uint8_t>(
          std::clamp(value + noise_at(x, y, frame * 8 + z, bits) - (1 << bits >> 1), 0, 255));
    };
    if (y < horizon)
      return {shade(200 + y * 20 / height, 2, 0), shade(150, 1, 1), shade(112, 1, 2)};
    const int left = width / 5 + frame, far = width * 3 / 4 - frame;
    if (x >= left && x < left + width / 8 && y < height * 7 / 10)
      return {shade(60, 4, 3), shade(170, 2, 4), shade(90, 2, 5)};
    if (x >= far && x < far + width / 10 && y < height * 11 / 20)
      return {shade(170, 3, 6), shade(100, 2, 7), shade(180, 2, 8)};
    return {shade(95 + light + (y - horizon) * 12 / height, 4, 9), shade(124, 2, 10), shade(134, 2, 11)};
  };
}

Painter remembered(const Painter& paint, int width, int height) {
  std::vector<Components> pixels;
  pixels.reserve(static_cast<std::size_t>(width) * height);
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x)
      pixels.push_back(paint(x, y));
  return [pixels = std::move(pixels), width](int x, int y) { return pixels[y * width + x]; };
}

} // namespace terrainseg::test
