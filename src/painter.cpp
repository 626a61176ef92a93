// SPDX-License-Identifier: LGPL-2.1-or-later
#include "painter.hpp"

#include <algorithm>

#include "painter/canvas.hpp"

namespace terrainseg {
namespace {

using namespace drawing;

constexpr Ink window_rgb = {255, 214, 0};
constexpr Ink horizon_rgb = {255, 64, 160};

// The luma weights of red and blue in 1/10000, of ITU-R BT.601, BT.709 and BT.2020.
struct LumaWeights {
  int red, blue;
};
constexpr int weight_unit = 10000;
constexpr std::array<LumaWeights, 3> luma_weights = {{{2990, 1140}, {2126, 722}, {2627, 593}}};

constexpr std::int64_t divide_rounded(std::int64_t numerator, std::int64_t denominator) {
  return (numerator + (numerator < 0 ? -denominator : denominator) / 2) / denominator;
}

constexpr std::uint8_t to_byte(std::int64_t value) {
  return static_cast<std::uint8_t>(std::clamp<std::int64_t>(value, 0, 255));
}

/// What is drawn: the estimate brought to the size of the frame.
class StretchedMask {
 public:
  StretchedMask(const GrayView& mask, const Rectangle& region) : mask_(mask), region_(region) {}

  const Rectangle& region() const { return region_; }

  /// Mask values of `count` pixels of row y from x on, both inside the region: where they lie when the mask
  /// has the frame's width, else in `room`.
  const std::uint8_t* values(int y, int x, int count, std::uint8_t* room) const {
    // The sample whose cell holds the centre of the row.
    const std::int64_t sample = (2LL * (y - region_.y) + 1) * mask_.height / (2LL * region_.height);
    const std::uint8_t* row = mask_.plane.row(sample);
    if (mask_.width == region_.width)
      return row + (x - region_.x);
    // The same for successive columns without a division each.
    const std::int64_t step = 2LL * mask_.width, unit = 2LL * region_.width;
    const std::int64_t start = (2LL * (x - region_.x) + 1) * mask_.width;
    std::int64_t column = start / unit, rest = start % unit;
    const std::int64_t whole = step / unit, part = step % unit;
    for (int i = 0; i < count; ++i) {
      room[i] = row[column];
      column += whole;
      rest += part;
      if (rest >= unit) {
        rest -= unit;
        ++column;
      }
    }
    return room;
  }

 private:
  GrayView mask_;
  Rectangle region_;
};

int half_of(int strength) {
  return (strength + 1) / 2;
}

void paint_tint(const Canvas& canvas, const StretchedMask& mask, const Ink& ink, int strength) {
  const auto full = static_cast<Coverage>(strength), half = static_cast<Coverage>(half_of(strength));
  canvas.blend(mask.region(), ink, [&](int y, int x, int count, Coverage* out) {
    std::array<std::uint8_t, tile_width> room;
    kernels::cover_mask(mask.values(y, x, count, room.data()), count, full, half, out);
  });
}

/// The tint of pictures without colour, where a grey on the ground would look like any other: lines across
/// the ground from the lower left to the upper right, white ones with a black one beside each, that are seen
/// on dark and on bright ground.
void paint_hatch(const Canvas& canvas, const StretchedMask& mask, int strength, int thickness) {
  const auto full = static_cast<Coverage>(strength), half = static_cast<Coverage>(half_of(strength));
  const int distance = 8 * thickness;
  const auto lines = [&](const Ink& ink, int begin) {
    canvas.blend(mask.region(), ink, [&](int y, int x, int count, Coverage* out) {
      std::array<std::uint8_t, tile_width> room;
      kernels::cover_mask(mask.values(y, x, count, room.data()), count, full, half, out);
      for (int i = 0, along = (x + y) % distance; i < count;) {
        const bool on_line = along >= begin && along < begin + thickness;
        const int next = on_line ? begin + thickness : along < begin ? begin : distance;
        const int run = std::min(next - along, count - i);
        if (!on_line)
          std::fill_n(out + i, run, Coverage{0});
        i += run;
        along = next % distance;
      }
    });
  };
  lines(canvas.ink(white_rgb), 0);
  lines(canvas.ink(black_rgb), thickness);
}

// The edge runs inside the area: a pixel belongs to it when a worse one lies within `reach` rows and columns.
void paint_contour(const Canvas& canvas, const StretchedMask& mask, const Ink& ink, int strength, int reach) {
  constexpr int max_reach = 32;
  reach = std::min(reach, max_reach);
  const auto full = static_cast<Coverage>(strength), half = static_cast<Coverage>(half_of(strength));
  const Rectangle inside = intersection(mask.region(), canvas.bounds());
  canvas.blend(inside, ink, [&](int y, int x, int count, Coverage* out) {
    std::array<std::uint8_t, tile_width + 2 * max_reach> own_room, row_room, worst;
    const int left = std::max(x - reach, inside.x);
    const int right = std::min(x + count + reach, inside.x + inside.width);
    const int span = right - left;
    const std::uint8_t* const own = mask.values(y, left, span, own_room.data());
    std::copy_n(own, span, worst.data());
    const int top = std::max(y - reach, inside.y), bottom = std::min(y + reach, inside.y + inside.height - 1);
    for (int other = top; other <= bottom; ++other) {
      if (other == y)
        continue;
      const std::uint8_t* const row = mask.values(other, left, span, row_room.data());
      for (int i = 0; i < span; ++i)
        worst[i] = std::min(worst[i], row[i]);
    }
    std::array<std::uint8_t, tile_width> lowest;
    std::fill_n(lowest.data(), count, std::uint8_t{255});
    for (int shift = -reach; shift <= reach; ++shift) {
      const int begin = std::max(0, left - (x + shift)), end = std::min(count, right - (x + shift));
      const std::uint8_t* shifted = worst.data() + (x + shift - left);
      for (int i = begin; i < end; ++i)
        lowest[i] = std::min(lowest[i], shifted[i]);
    }
    for (int i = 0; i < count; ++i) {
      const std::uint8_t value = own[x - left + i];
      const bool edge = value >= 192 && lowest[i] < 192;
      const bool doubtful_edge = value >= 64 && lowest[i] < 64;
      out[i] = edge ? full : doubtful_edge ? half : Coverage{0};
    }
  });
}

void paint_mask(const Canvas& canvas, const StretchedMask& mask, bool have_mask) {
  const Ink white = canvas.ink(white_rgb);
  canvas.fill(canvas.bounds(), canvas.ink(black_rgb), opaque);
  const Rectangle known = have_mask ? intersection(mask.region(), canvas.bounds()) : Rectangle{};
  // v + (v >> 7) as coverage of white over black gives back v itself.
  canvas.blend(canvas.bounds(), white, [&](int y, int x, int count, Coverage* out) {
    std::fill_n(out, count, static_cast<Coverage>(mask_doubtful + (mask_doubtful >> 7)));
    if (y < known.y || y >= known.y + known.height)
      return;
    const int begin = std::max(x, known.x), end = std::min(x + count, known.x + known.width);
    if (begin >= end)
      return;
    std::array<std::uint8_t, tile_width> room;
    const std::uint8_t* const values = mask.values(y, begin, end - begin, room.data());
    for (int i = 0; i < end - begin; ++i)
      out[begin - x + i] = static_cast<Coverage>(values[i] + (values[i] >> 7));
  });
}

// One line per learned colour at the top left: a track that stands for the whole mass, and on it the model's
// share in its own colour.
void paint_bars(const Canvas& canvas, const Estimate& estimate) {
  const int count = std::clamp(estimate.model_count, 0, max_models);
  // Capped, so that the sum of eight fits.
  const auto mass_of = [&](int i) { return std::min(estimate.models[i].mass, std::uint64_t{1} << 60); };
  std::uint64_t total = 0;
  for (int i = 0; i < count; ++i)
    total += mass_of(i);
  const int bar = std::max(canvas.height() / 36, 3), gap = std::max(bar / 3, 1);
  const int frame = std::max(bar / 10, 1);
  const int track = std::max(canvas.width() / 4, 8);
  const Ink white = canvas.ink(white_rgb), black = canvas.ink(black_rgb);
  for (int i = 0; i < count; ++i) {
    const ModelSummary& model = estimate.models[i];
    const Rectangle box = {2 * gap, 2 * gap + i * (bar + gap), track, bar};
    const Rectangle inner = {box.x + frame, box.y + frame, box.width - 2 * frame, box.height - 2 * frame};
    canvas.fill(box, black, opaque / 2);
    canvas.outline(box, frame, white, opaque);
    if (total == 0)
      continue;
    // Brought to 32 bits, so that the product with a width cannot overflow.
    std::uint64_t mass = mass_of(i), whole = total;
    for (; whole >> 32; whole >>= 1)
      mass >>= 1;
    const auto length = static_cast<int>(mass * static_cast<std::uint64_t>(std::max(inner.width, 0)) / whole);
    canvas.fill({inner.x, inner.y, model.mass > 0 ? std::max(length, 1) : 0, inner.height},
                canvas.ink(model.rgb), opaque);
  }
}

void paint_horizon(const Canvas& canvas, int row, bool held, int thickness, int strength) {
  const Ink ink = canvas.ink(horizon_rgb);
  const Rectangle line = {0, row - thickness / 2, canvas.width(), thickness};
  if (!held)
    return canvas.fill(line, ink, strength);
  const int dash = std::max(canvas.width() / 40, 2);
  canvas.blend(line, ink, [&](int, int x, int count, Coverage* out) {
    for (int i = 0; i < count; ++i)
      out[i] = static_cast<Coverage>((x + i) / dash % 2 == 0 ? strength : 0);
  });
}

int scaled(int position, int from, int to) {
  const std::int64_t moved = static_cast<std::int64_t>(position) * to / from;
  return static_cast<int>(std::clamp<std::int64_t>(moved, -(1 << 24), 1 << 24));
}

Rectangle scaled(const Rectangle& r, int from_width, int from_height, int to_width, int to_height) {
  const int left = scaled(r.x, from_width, to_width), top = scaled(r.y, from_height, to_height);
  // Clamped before the sum, so that a wild rectangle of foreign metadata cannot overflow.
  const auto end = [](int start, int extent) { return std::clamp(start, -(1 << 24), 1 << 24) + extent; };
  return {left, top, scaled(end(r.x, std::clamp(r.width, 0, 1 << 24)), from_width, to_width) - left,
          scaled(end(r.y, std::clamp(r.height, 0, 1 << 24)), from_height, to_height) - top};
}

} // namespace

std::array<std::uint8_t, 3> color_in(PixelFormat format, const Colorimetry& colorimetry,
                                     const std::array<std::uint8_t, 3>& rgb) {
  const bool limited = colorimetry.range == ColorRange::limited;
  if (layout_of(format).rgb) {
    if (!limited)
      return rgb;
    Ink ink;
    for (int c = 0; c < 3; ++c)
      ink[c] = to_byte(16 + divide_rounded(219 * rgb[c], 255));
    return ink;
  }
  const LumaWeights& weights = luma_weights[static_cast<std::size_t>(colorimetry.matrix)];
  const std::int64_t luma = weights.red * rgb[0] + (weight_unit - weights.red - weights.blue) * rgb[1] +
                            weights.blue * rgb[2]; // in 1/10000
  const auto chroma = [&](std::uint8_t primary, int weight) {
    const std::int64_t difference = static_cast<std::int64_t>(primary) * weight_unit - luma;
    const std::int64_t span = 2LL * (weight_unit - weight) * 255;
    return to_byte(128 + divide_rounded(difference * (limited ? 224 : 255), span));
  };
  const std::int64_t y =
      limited ? 16 + divide_rounded(219 * luma, 255LL * weight_unit) : divide_rounded(luma, weight_unit);
  return {to_byte(y), chroma(rgb[2], weights.blue), chroma(rgb[0], weights.red)};
}

void paint(const MutableFrame& frame, const Estimate& estimate, const PaintStyle& style) {
  if (!drawable(frame))
    return;
  const Canvas canvas(frame);
  const int from_width = estimate.frame_width > 0 ? estimate.frame_width : frame.width;
  const int from_height = estimate.frame_height > 0 ? estimate.frame_height : frame.height;
  const auto to_frame = [&](const Rectangle& r) {
    return scaled(r, from_width, from_height, frame.width, frame.height);
  };
  const StretchedMask mask(estimate.mask, to_frame(estimate.mask_region));
  const bool have_mask = !estimate.mask.empty() && !mask.region().empty();
  if (style.style == OverlayStyle::mask)
    return paint_mask(canvas, mask, have_mask);

  const int strength = strength_of(style);
  if (strength == 0)
    return;
  const Ink color = canvas.ink(style.color);
  const int line_strength = std::min(2 * strength, opaque);
  const int thickness = std::clamp((frame.height + 180) / 360, 1, 16);

  if (have_mask) {
    const int width = std::clamp((frame.height + 120) / 240, 1, 16); // of the contour, of a line of the hatch
    if (style.style == OverlayStyle::contour)
      paint_contour(canvas, mask, color, line_strength, width);
    else if (canvas.has_colour())
      paint_tint(canvas, mask, color, strength);
    else
      paint_hatch(canvas, mask, strength, width);
  }
  canvas.outline(to_frame(estimate.window), thickness, canvas.ink(window_rgb), line_strength);
  if (estimate.horizon_row >= 0)
    paint_horizon(canvas, scaled(estimate.horizon_row, from_height, frame.height),
                  estimate.flags & flag_horizon_held, thickness, line_strength);
  if (style.style == OverlayStyle::models)
    paint_bars(canvas, estimate);
}

} // namespace terrainseg
