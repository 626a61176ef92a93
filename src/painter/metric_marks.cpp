// SPDX-License-Identifier: LGPL-2.1-or-later
#include "painter/metric_marks.hpp"

#include <algorithm>
#include <charconv>
#include <string_view>

#include "painter/canvas.hpp"

namespace terrainseg {
namespace {

using namespace drawing;

constexpr Ink grey_rgb = {120, 120, 120};
constexpr Ink obstacle_rgb = {255, 72, 40};
constexpr int glyph_width = 5, glyph_height = 7, glyph_step = glyph_width + 1;

/// Glyphs of 0..9, '.' and 'm': rows from the top, the leftmost pixel is bit 4.
constexpr std::uint8_t glyphs[12][glyph_height] = {
    {0x0e, 0x11, 0x13, 0x15, 0x19, 0x11, 0x0e}, {0x04, 0x0c, 0x04, 0x04, 0x04, 0x04, 0x0e},
    {0x0e, 0x11, 0x01, 0x06, 0x08, 0x10, 0x1f}, {0x1f, 0x02, 0x04, 0x06, 0x01, 0x11, 0x0e},
    {0x02, 0x06, 0x0a, 0x12, 0x1f, 0x02, 0x02}, {0x1f, 0x10, 0x1e, 0x01, 0x01, 0x11, 0x0e},
    {0x06, 0x08, 0x10, 0x1e, 0x11, 0x11, 0x0e}, {0x1f, 0x01, 0x02, 0x04, 0x08, 0x08, 0x08},
    {0x0e, 0x11, 0x11, 0x0e, 0x11, 0x11, 0x0e}, {0x0e, 0x11, 0x11, 0x0f, 0x01, 0x02, 0x0c},
    {0x00, 0x00, 0x00, 0x00, 0x00, 0x0c, 0x0c}, {0x00, 0x00, 0x1a, 0x15, 0x15, 0x15, 0x15}};

int glyph_of(char letter) {
  return letter == '.' ? 10 : letter == 'm' ? 11 : letter - '0';
}

/// Metres with or without a decimal, followed by the unit.
struct Label {
  Label(int decimetres, bool with_decimal) {
    decimetres = std::clamp(decimetres, 0, 99999);
    end = std::to_chars(text, text + 8, decimetres / 10).ptr;
    if (with_decimal || decimetres % 10 != 0) {
      *end++ = '.';
      *end++ = static_cast<char>('0' + decimetres % 10);
    }
    *end++ = 'm';
  }
  std::string_view view() const { return {text, static_cast<std::size_t>(end - text)}; }
  int width(int scale) const { return static_cast<int>(view().size()) * glyph_step * scale + scale; }

  char text[12];
  char* end;
};

int scale_of(int frame_height) {
  return std::clamp(frame_height / 300, 1, 12);
}

/// White text on a dark box whose top left corner is given.
void write(const Canvas& canvas, const Label& label, int x, int y, int scale, int strength) {
  const Rectangle box{x, y, label.width(scale), (glyph_height + 2) * scale};
  canvas.fill(box, canvas.ink(black_rgb), strength * 5 / 8);
  const std::string_view text = label.view();
  canvas.blend(box, canvas.ink(white_rgb), [&](int py, int px, int count, Coverage* out) {
    const int row = (py - y) / scale - 1;
    for (int i = 0; i < count; ++i) {
      const int column = (px + i - x) / scale - 1;
      const bool inside = row >= 0 && row < glyph_height && column >= 0;
      const int letter = column / glyph_step, bit = column % glyph_step;
      const bool on =
          inside && letter < static_cast<int>(text.size()) && bit < glyph_width &&
          glyphs[glyph_of(text[static_cast<std::size_t>(letter)])][row] >> (glyph_width - 1 - bit) & 1;
      out[i] = static_cast<Coverage>(on ? strength : 0);
    }
  });
}

void paint_mark(const Canvas& canvas, const MetricMark& mark, int scale, int strength) {
  const bool ring = mark.kind == MetricMark::Kind::ring;
  const int size = ring ? std::max(scale / 2, 1) : scale;
  const Label label(mark.decimetres, mark.kind == MetricMark::Kind::boundary);
  const int width = label.width(size), height = (glyph_height + 2) * size;
  if (mark.kind == MetricMark::Kind::boundary)
    return write(canvas, label, mark.x - width / 2, mark.y - height - 2 * size, size, strength);
  if (ring)
    return write(canvas, label, mark.x - width / 2, mark.y - height / 2, size, strength);
  const int half = std::max(canvas.width() / 40, 3), thick = std::max(size, 1);
  canvas.fill({mark.x - half, mark.y - thick / 2, 2 * half + 1, thick}, canvas.ink(white_rgb), strength);
  write(canvas, label, mark.x + half + 2 * size, mark.y - height / 2, size, strength);
}

/// One blend for each kind of cell, because a chroma sample may belong to cells of several kinds.
void paint_map(const Canvas& canvas, const MetricMarks& m, const Ink& color, int strength) {
  const Rectangle area{m.map_x, m.map_y, m.map.width, m.map.height};
  struct Layer {
    MapCell cell;
    Ink ink;
    int strength;
  };
  canvas.fill(area, canvas.ink(black_rgb), strength * 7 / 8);
  for (const Layer& layer :
       {Layer{map_unknown, canvas.ink(grey_rgb), strength / 2}, Layer{map_free, color, strength},
        Layer{map_obstacle, canvas.ink(obstacle_rgb), strength},
        Layer{map_ring, canvas.ink(white_rgb), strength / 2},
        Layer{map_vehicle, canvas.ink(white_rgb), strength}})
    canvas.blend(area, layer.ink, [&](int y, int x, int count, Coverage* out) {
      const std::uint8_t* row = m.map.plane.row(y - m.map_y) + (x - m.map_x);
      for (int i = 0; i < count; ++i)
        out[i] = static_cast<Coverage>(row[i] == layer.cell ? layer.strength : 0);
    });
  canvas.outline(area, 1, canvas.ink(white_rgb), strength);
}

} // namespace

int metric_digit_height(int frame_height) {
  return glyph_height * scale_of(frame_height);
}

void paint_metres(const MutableFrame& frame, const MetricMarks& m, const PaintStyle& style) {
  const int strength = std::min(2 * strength_of(style), opaque);
  if (!drawable(frame) || style.style == OverlayStyle::mask || strength == 0)
    return;
  const Canvas canvas(frame);
  if (!m.map.empty())
    paint_map(canvas, m, canvas.ink(style.color), strength);
  for (const MetricMark& mark : m.marks)
    paint_mark(canvas, mark, scale_of(frame.height), strength);
}

} // namespace terrainseg
