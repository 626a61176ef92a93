// SPDX-License-Identifier: LGPL-2.1-or-later
// Drawing primitives: areas of a frame of any format that are blended with a colour.
//
// Everything is drawn as a blend of one colour with a coverage of 0..256 per pixel. Frames are processed in
// tiles, so that the coverage fits into the L1 cache and no memory is allocated.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>

#include "kernels/blend.hpp"
#include "painter.hpp"

namespace terrainseg::drawing {

inline constexpr int tile_width = 2048;
inline constexpr int opaque = 256;

using Ink = std::array<std::uint8_t, 3>;
inline constexpr Ink black_rgb = {0, 0, 0}, white_rgb = {255, 255, 255};
using kernels::Coverage;

inline Rectangle intersection(const Rectangle& a, const Rectangle& b) {
  const int left = std::max(a.x, b.x), top = std::max(a.y, b.y);
  const auto end = [](int start, int extent) { return static_cast<std::int64_t>(start) + extent; };
  const auto right = std::min(end(a.x, a.width), end(b.x, b.width));
  const auto bottom = std::min(end(a.y, a.height), end(b.y, b.height));
  return {left, top, static_cast<int>(std::max<std::int64_t>(right - left, 0)),
          static_cast<int>(std::max<std::int64_t>(bottom - top, 0))};
}

class Canvas {
 public:
  explicit Canvas(const MutableFrame& frame) : frame_(frame), layout_(layout_of(frame.format)) {}

  int width() const { return frame_.width; }
  int height() const { return frame_.height; }
  bool has_colour() const { return layout_.component_count == 3; }
  Rectangle bounds() const { return {0, 0, frame_.width, frame_.height}; }
  /// The colour of 0xAARRGGBB without its opacity.
  Ink ink(std::uint32_t color) const {
    return ink(Ink{static_cast<std::uint8_t>(color >> 16), static_cast<std::uint8_t>(color >> 8),
                   static_cast<std::uint8_t>(color)});
  }
  Ink ink(const Ink& rgb) const { return color_in(frame_.format, frame_.colorimetry, rgb); }

  /// Blends `ink` over an area. `cover(y, x, count, out)` writes the coverage of `count` pixels of row y,
  /// beginning at column x, all within the area.
  template <class Cover> void blend(const Rectangle& area, const Ink& ink, Cover&& cover) const {
    const Rectangle r = intersection(area, bounds());
    if (r.empty())
      return;
    const int x_shift = layout_.components[1].x_shift, y_shift = layout_.components[1].y_shift;
    const int block_width = 1 << x_shift, block_height = 1 << y_shift;
    const int left = r.x & -block_width, right = r.x + r.width, bottom = r.y + r.height;
    // A tile includes the neighbours that share chroma samples with the area, with coverage 0.
    const int end = std::min((right + block_width - 1) & -block_width, frame_.width);
    std::array<std::array<Coverage, tile_width>, 2> rows;
    for (int y = r.y & -block_height; y < bottom; y += block_height) {
      const int row_count = std::min(block_height, frame_.height - y);
      for (int x = left; x < end; x += tile_width) {
        const int count = std::min(tile_width, end - x);
        const int first = std::max(r.x - x, 0), last = std::min(right - x, count);
        for (int i = 0; i < row_count; ++i) {
          Coverage* row = rows[i].data();
          if (y + i < r.y || y + i >= bottom) {
            std::fill_n(row, count, Coverage{0});
            continue;
          }
          std::fill_n(row, first, Coverage{0});
          cover(y + i, x + first, last - first, row + first);
          std::fill(row + last, row + count, Coverage{0});
        }
        blend_tile(x, y, count, row_count, rows, ink);
      }
    }
  }

  void fill(const Rectangle& area, const Ink& ink, int strength) const {
    blend(area, ink, [strength](int, int, int count, Coverage* out) {
      std::fill_n(out, count, static_cast<Coverage>(strength));
    });
  }

  /// The outline of a rectangle, `thickness` pixels wide, inside it.
  void outline(const Rectangle& r, int thickness, const Ink& ink, int strength) const {
    if (r.empty())
      return;
    // One blend for all four sides, so that the chroma samples of the corners are blended only once.
    blend(r, ink, [&](int y, int x, int count, Coverage* out) {
      const bool edge_row = y < r.y + thickness || y >= r.y + r.height - thickness;
      std::fill_n(out, count, static_cast<Coverage>(edge_row ? strength : 0));
      for (const int side : {r.x, r.x + r.width - thickness}) {
        const int first = std::clamp(side - x, 0, count), end = std::clamp(side + thickness - x, 0, count);
        std::fill(out + first, out + end, static_cast<Coverage>(strength));
      }
    });
  }

 private:
  void blend_tile(int x, int y, int count, int row_count,
                  const std::array<std::array<Coverage, tile_width>, 2>& rows, const Ink& ink) const {
    const auto& [first, second, third] = layout_.components;
    const auto samples = [&](const ComponentLayout& c, int row) {
      return frame_.planes[c.plane].row(row >> c.y_shift) +
             static_cast<std::ptrdiff_t>(x >> c.x_shift) * c.step + c.offset;
    };
    bool covered = false;
    for (int i = 0; i < row_count; ++i) {
      const Coverage* row = rows[i].data();
      if (!kernels::covers(row, count))
        continue;
      covered = true;
      if (layout_.rgb)
        blend_rgb(samples(first, y + i) - first.offset, row, count, ink);
      else if (packed_422())
        blend_packed_422(samples(first, y + i) - first.offset, row, count, ink);
      else {
        blend_component(samples(first, y + i), row, count, ink[0]);
        if (second.x_shift == 0)
          blend_chroma(samples(second, y + i), samples(third, y + i), row, count, ink);
      }
    }
    if (!covered || packed_422() || second.x_shift == 0)
      return;
    std::array<Coverage, tile_width> pooled;
    kernels::pool_coverage(rows[0].data(), row_count == 2 ? rows[1].data() : nullptr, count, pooled.data());
    blend_chroma(samples(second, y), samples(third, y), pooled.data(), subsampled(count, second.x_shift),
                 ink);
  }

  bool packed_422() const { return !layout_.rgb && layout_.planes == 1 && layout_.component_count == 3; }

  // One sample per coverage value. Formats with more than 8 bits use the 8-bit ink with zeros as lower bits,
  // which gives the same value when it is read.
  void blend_component(std::uint8_t* samples, const Coverage* coverage, int count, std::uint8_t ink) const {
    if (layout_.sample_bytes() == 1)
      kernels::blend_plane(samples, coverage, count, ink);
    else
      kernels::blend_words(samples, coverage, count, layout_.shift, deep(ink));
  }

  // The chroma of planar formats; grey has none.
  void blend_chroma(std::uint8_t* u, std::uint8_t* v, const Coverage* coverage, int count,
                    const Ink& ink) const {
    if (layout_.component_count == 1)
      return;
    if (layout_.planes == 3) {
      blend_component(u, coverage, count, ink[1]);
      blend_component(v, coverage, count, ink[2]);
      return;
    }
    const std::array<std::uint8_t, 2> inks = {ink[u < v ? 1 : 2], ink[u < v ? 2 : 1]};
    if (layout_.sample_bytes() == 1)
      kernels::blend_pairs(std::min(u, v), coverage, count, inks);
    else
      kernels::blend_word_pairs(std::min(u, v), coverage, count, layout_.shift,
                                {deep(inks[0]), deep(inks[1])});
  }

  std::uint16_t deep(std::uint8_t ink) const {
    return static_cast<std::uint16_t>(ink << (layout_.depth - 8));
  }

  void blend_rgb(std::uint8_t* pixels, const Coverage* coverage, int count, const Ink& ink) const {
    std::array<std::uint8_t, 4> order{};
    int untouched = 6;
    for (int c = 0; c < 3; ++c) {
      order[layout_.components[c].offset] = ink[c];
      untouched -= layout_.components[c].offset;
    }
    if (layout_.components[0].step == 3)
      kernels::blend_triples(pixels, coverage, count, {order[0], order[1], order[2]});
    else
      kernels::blend_quads(pixels, coverage, count, order, untouched);
  }

  void blend_packed_422(std::uint8_t* pixels, const Coverage* coverage, int count, const Ink& ink) const {
    const auto& [luma, u, v] = layout_.components;
    const bool u_first = u.offset < v.offset;
    kernels::blend_422(pixels, coverage, count, {ink[0], ink[u_first ? 1 : 2], ink[u_first ? 2 : 1]},
                       luma.offset == 0);
  }

  MutableFrame frame_;
  const FormatLayout& layout_;
};

/// Product of the alpha of the style and of its colour, 0..256.
inline int strength_of(const PaintStyle& style) {
  const int opacity = static_cast<int>(style.color >> 24);
  return std::clamp(style.alpha, 0, opaque) * (opacity + (opacity >> 7)) >> 8;
}

/// Whether the frame can be drawn on.
inline bool drawable(const MutableFrame& frame) {
  if (frame.width <= 0 || frame.height <= 0)
    return false;
  const int planes = layout_of(frame.format).planes;
  return std::all_of(frame.planes.begin(), frame.planes.begin() + planes,
                     [](const MutablePlane& plane) { return plane.data != nullptr; });
}

} // namespace terrainseg::drawing
