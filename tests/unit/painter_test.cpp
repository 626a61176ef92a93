// SPDX-License-Identifier: LGPL-2.1-or-later
// The painter against the blend equation in doubles, in every format and memory layout.
#include "painter.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <random>

namespace {

using namespace terrainseg;

constexpr std::uint8_t untouched = 0xa5; // fills what lies between the samples

struct Picture {
  std::array<std::vector<std::uint8_t>, 3> memory;
  MutableFrame frame;

  Picture(PixelFormat format, int width, int height, int padding = 0, bool flipped = false,
          std::uint32_t seed = 1, Colorimetry colorimetry = {}) {
    frame.format = format;
    frame.width = width;
    frame.height = height;
    frame.colorimetry = colorimetry;
    const FormatLayout& layout = layout_of(format);
    for (int p = 0; p < layout.planes; ++p) {
      const int stride = row_bytes(layout, p, width) + padding, rows = plane_rows(layout, p, height);
      memory[p].assign(static_cast<std::size_t>(stride) * rows, untouched);
      frame.planes[p] = {memory[p].data(), stride};
      if (flipped)
        frame.planes[p] = {memory[p].data() + static_cast<std::ptrdiff_t>(stride) * (rows - 1), -stride};
    }
    std::mt19937 random(seed);
    each_sample([&](int c, int x, int y) {
      std::uint8_t* at = bytes(c, x, y);
      for (int i = 0; i < sample_bytes(); ++i)
        at[i] = static_cast<std::uint8_t>(random());
      if (is(PixelFormat::P010_10LE))
        at[0] &= 0xc0;
      if (is(PixelFormat::I420_10LE) || is(PixelFormat::I422_10LE))
        at[1] &= 3;
    });
  }

  bool is(PixelFormat format) const { return frame.format == format; }
  bool is_ten_bit() const {
    return is(PixelFormat::P010_10LE) || is(PixelFormat::I420_10LE) || is(PixelFormat::I422_10LE);
  }
  int sample_bytes() const { return is_ten_bit() || is(PixelFormat::GRAY16_LE) ? 2 : 1; }
  int components() const { return is(PixelFormat::GRAY8) || is(PixelFormat::GRAY16_LE) ? 1 : 3; }
  /// Steps of a sample in one of 8 bits.
  int scale() const { return is_ten_bit() ? 4 : sample_bytes() == 2 ? 256 : 1; }

  std::uint8_t* bytes(int component, int x, int y) {
    const ComponentLayout& c = layout_of(frame.format).components[component];
    return frame.planes[c.plane].row(y) + c.offset + x * c.step;
  }

  /// In steps of 8 bits; what lies below them behind the point.
  double sample(int component, int x, int y) {
    const std::uint8_t* at = bytes(component, x, y);
    const int word = sample_bytes() == 2 ? at[0] + 256 * at[1] : at[0];
    return static_cast<double>(is(PixelFormat::P010_10LE) ? word / 64.0 : word) / scale();
  }

  void each_sample(const std::function<void(int, int, int)>& visit) const {
    for (int c = 0; c < components(); ++c) {
      const ComponentLayout& l = layout_of(frame.format).components[c];
      for (int y = 0; y < subsampled(frame.height, l.y_shift); ++y)
        for (int x = 0; x < subsampled(frame.width, l.x_shift); ++x)
          visit(c, x, y);
    }
  }

  std::array<int, 3> pixel(int x, int y) {
    std::array<int, 3> values{128, 128, 128};
    for (int c = 0; c < components(); ++c) {
      const ComponentLayout& l = layout_of(frame.format).components[c];
      values[c] = static_cast<int>(sample(c, x >> l.x_shift, y >> l.y_shift));
    }
    return values;
  }
};

struct Mask {
  std::vector<std::uint8_t> values;
  int width, height;

  Mask(int w, int h, std::uint32_t seed) : values(static_cast<std::size_t>(w) * h), width(w), height(h) {
    std::mt19937 random(seed);
    constexpr std::uint8_t levels[3] = {mask_not_traversable, mask_doubtful, mask_traversable};
    for (auto& v : values)
      v = levels[random() % 3];
  }
  std::uint8_t at(int x, int y) const { return values[static_cast<std::size_t>(y) * width + x]; }
  GrayView view() const { return {{values.data(), width}, width, height}; }
};

Estimate estimate_of(const Mask& mask, int width, int height) {
  Estimate estimate;
  estimate.frame_width = width;
  estimate.frame_height = height;
  estimate.mask = mask.view();
  estimate.mask_region = {0, 0, width, height};
  return estimate;
}

// Blends in doubles: `coverage(x, y)` of each pixel, averaged over the pixels of a sample.
void expect_blended(Picture& before, Picture& after, const std::array<std::uint8_t, 3>& ink,
                    const std::function<double(int, int)>& coverage) {
  const MutableFrame& f = before.frame;
  int wrong = 0;
  before.each_sample([&](int c, int x, int y) {
    const double old = before.sample(c, x, y);
    const ComponentLayout& l = layout_of(f.format).components[c];
    double sum = 0;
    int pixels = 0;
    for (int dy = 0; dy < 1 << l.y_shift; ++dy)
      for (int dx = 0; dx < 1 << l.x_shift; ++dx) {
        const int px = (x << l.x_shift) + dx, py = (y << l.y_shift) + dy;
        if (px < f.width && py < f.height) {
          sum += coverage(px, py);
          ++pixels;
        }
      }
    const double a = sum / pixels;
    const double expected = old + (ink[c] - old) * a;
    // Half a step for the result and half a 1/256 of the coverage.
    const double tolerance = 0.5 + 0.5 / before.scale();
    if (std::abs(after.sample(c, x, y) - expected) > tolerance && ++wrong < 5)
      ADD_FAILURE() << "format " << static_cast<int>(f.format) << " component " << c << " at " << x << ","
                    << y << ": " << after.sample(c, x, y) << " instead of " << expected;
  });
  EXPECT_EQ(wrong, 0);
}

// Lines of one pixel, eight apart: white ones, and a black one right of each.
void expect_hatched(Picture& before, Picture& after, const std::function<double(int, int)>& coverage) {
  const MutableFrame& f = before.frame;
  before.each_sample([&](int c, int x, int y) {
    const int place = (x + y) % 8;
    const std::uint8_t grey = place == 0 ? 255 : 0;
    const double old = before.sample(c, x, y), ink = color_in(f.format, f.colorimetry, {grey, grey, grey})[0];
    const double expected = place > 1 ? old : old + (ink - old) * coverage(x, y);
    ASSERT_NEAR(after.sample(c, x, y), expected, 0.5 + 0.5 / before.scale()) << x << "," << y;
  });
}

// Every byte that is no sample must still hold the fill.
void expect_gaps_untouched(Picture& picture) {
  picture.each_sample(
      [&](int c, int x, int y) { std::fill_n(picture.bytes(c, x, y), picture.sample_bytes(), untouched); });
  for (const auto& plane : picture.memory)
    for (const std::uint8_t byte : plane)
      ASSERT_EQ(byte, untouched);
}

constexpr std::array<std::array<int, 2>, 7> sizes = {
    {{1, 1}, {2, 2}, {3, 5}, {16, 9}, {33, 17}, {1025, 3}, {2050, 4}}};

TEST(Painter, ColorsInEveryColorimetry) {
  const double red[3] = {0.299, 0.2126, 0.2627}, blue[3] = {0.114, 0.0722, 0.0593};
  std::mt19937 random(3);
  for (int trial = 0; trial < 2000; ++trial) {
    std::array<std::uint8_t, 3> rgb;
    for (auto& v : rgb)
      v = trial < 8 ? static_cast<std::uint8_t>(random() % 2 * 255) : static_cast<std::uint8_t>(random());
    for (int m = 0; m < 3; ++m)
      for (const ColorRange range : {ColorRange::limited, ColorRange::full}) {
        const Colorimetry colorimetry = {range, static_cast<ColorMatrix>(m)};
        const double r = rgb[0] / 255.0, g = rgb[1] / 255.0, b = rgb[2] / 255.0;
        const double y = red[m] * r + (1 - red[m] - blue[m]) * g + blue[m] * b;
        const double u = (b - y) / (2 - 2 * blue[m]), v = (r - y) / (2 - 2 * red[m]);
        const bool limited = range == ColorRange::limited;
        const double expected[3] = {limited ? 16 + 219 * y : 255 * y,
                                    std::min(255.0, 128 + (limited ? 224 : 255) * u),
                                    std::min(255.0, 128 + (limited ? 224 : 255) * v)};
        const auto yuv = color_in(PixelFormat::NV12, colorimetry, rgb);
        const auto packed = color_in(PixelFormat::xBGR, colorimetry, rgb);
        for (int c = 0; c < 3; ++c) {
          ASSERT_LE(std::abs(yuv[c] - expected[c]), 0.5 + 1e-9);
          ASSERT_LE(std::abs(packed[c] - (limited ? 16 + 219 * rgb[c] / 255.0 : rgb[c])), 0.5 + 1e-9);
        }
      }
  }
}

bool has_colour(PixelFormat format) {
  return layout_of(format).component_count == 3;
}

TEST(Painter, TintInEveryFormatSizeAndLayout) {
  for (int f = 0; f < pixel_format_count; ++f)
    for (const auto [width, height] : sizes)
      for (const int padding : {0, 7}) {
        const auto format = static_cast<PixelFormat>(f);
        const Colorimetry colorimetry = {f % 2 ? ColorRange::full : ColorRange::limited,
                                         static_cast<ColorMatrix>(f % 3)};
        Picture before(format, width, height, padding, padding != 0, 5, colorimetry);
        Picture after(format, width, height, padding, padding != 0, 5, colorimetry);
        const Mask mask(width, height, 7);
        const PaintStyle style = {OverlayStyle::tint, 100, 0xff2040f0};
        paint(after.frame, estimate_of(mask, width, height), style);
        const auto ink = color_in(format, colorimetry, {0x20, 0x40, 0xf0});
        const auto strength = [&](int x, int y) {
          return mask.at(x, y) == 255 ? 100 / 256.0 : mask.at(x, y) == 128 ? 50 / 256.0 : 0.0;
        };
        if (has_colour(format))
          expect_blended(before, after, ink, strength);
        else
          expect_hatched(before, after, strength);
        expect_gaps_untouched(after);
      }
}

// On ground of any brightness, and half as strongly where it is doubtful.
TEST(Painter, GroundIsSeenInPicturesWithoutColour) {
  for (const PixelFormat format : {PixelFormat::GRAY8, PixelFormat::GRAY16_LE})
    for (const int brightness : {0, 60, 128, 137, 200, 255}) {
      Picture picture(format, 640, 360);
      picture.each_sample([&](int c, int x, int y) {
        std::fill_n(picture.bytes(c, x, y), picture.sample_bytes(), static_cast<std::uint8_t>(brightness));
      });
      Mask mask(640, 360, 1);
      for (int y = 0; y < 360; ++y)
        for (int x = 0; x < 640; ++x)
          mask.values[static_cast<std::size_t>(y) * 640 + x] = y < 120   ? mask_not_traversable
                                                               : y < 240 ? mask_doubtful
                                                                         : mask_traversable;
      const double before = picture.sample(0, 0, 0);
      paint(picture.frame, estimate_of(mask, 640, 360), {});
      const auto spread = [&](int top,
                              int bottom) { // between the brightest and the darkest, away from the borders
        double least = 1e9, most = -1e9;
        for (int y = top; y < bottom; ++y)
          for (int x = 0; x < 640; ++x) {
            least = std::min<double>(least, picture.sample(0, x, y));
            most = std::max<double>(most, picture.sample(0, x, y));
          }
        return most - least;
      };
      EXPECT_EQ(spread(0, 120), 0) << brightness;
      EXPECT_EQ(picture.sample(0, 5, 60), before) << brightness;
      EXPECT_GT(spread(240, 360), 80) << brightness;
      EXPECT_NEAR(spread(120, 240), spread(240, 360) / 2, 2) << brightness;
    }
}

TEST(Painter, AlphaZeroChangesNothing) {
  for (int f = 0; f < pixel_format_count; ++f)
    for (const OverlayStyle look : {OverlayStyle::tint, OverlayStyle::contour, OverlayStyle::models})
      for (const PaintStyle style : {PaintStyle{look, 0}, PaintStyle{look, 256, 0x00ffffff}}) {
        Picture before(static_cast<PixelFormat>(f), 45, 31), after(static_cast<PixelFormat>(f), 45, 31);
        const Mask mask(45, 31, 2);
        Estimate estimate = estimate_of(mask, 45, 31);
        estimate.window = {10, 20, 15, 8};
        estimate.horizon_row = 9;
        estimate.model_count = 2;
        estimate.models[0].mass = 7;
        paint(after.frame, estimate, style);
        EXPECT_EQ(before.memory, after.memory);
      }
}

TEST(Painter, FullAlphaReplaces) {
  for (int f = 0; f < pixel_format_count; ++f) {
    Picture picture(static_cast<PixelFormat>(f), 37, 21, 3);
    Mask mask(37, 21, 2);
    std::fill(mask.values.begin(), mask.values.end(), mask_traversable);
    paint(picture.frame, estimate_of(mask, 37, 21), {OverlayStyle::tint, 256, 0xff1177cc});
    if (!has_colour(picture.frame.format)) // lines
      continue;
    const auto ink = color_in(picture.frame.format, {}, {0x11, 0x77, 0xcc});
    picture.each_sample([&](int c, int x, int y) { ASSERT_EQ(picture.sample(c, x, y), ink[c]); });
  }
}

TEST(Painter, OpacityOfTheColorScalesAlpha) {
  Picture before(PixelFormat::RGB, 8, 8), after(PixelFormat::RGB, 8, 8);
  Mask mask(8, 8, 2);
  std::fill(mask.values.begin(), mask.values.end(), mask_traversable);
  paint(after.frame, estimate_of(mask, 8, 8), {OverlayStyle::tint, 256, 0x80ffffff});
  expect_blended(before, after, color_in(PixelFormat::RGB, {}, {255, 255, 255}),
                 [](int, int) { return 129 / 256.0; });
}

TEST(Painter, RegionOfTheMask) {
  // An odd corner: chroma samples at the border are shared with pixels outside.
  const Rectangle region = {5, 3, 20, 11};
  for (int f = 0; f < pixel_format_count; ++f)
    for (const auto& mask_size : {std::array{20, 11}, std::array{7, 4}, std::array{63, 40}}) {
      const int mask_width = mask_size[0], mask_height = mask_size[1];
      const auto format = static_cast<PixelFormat>(f);
      if (!has_colour(format)) // lines
        continue;
      Picture before(format, 37, 21, 5), after(format, 37, 21, 5);
      const Mask mask(mask_width, mask_height, 4);
      Estimate estimate = estimate_of(mask, 37, 21);
      estimate.mask_region = region;
      paint(after.frame, estimate, {OverlayStyle::tint, 256, 0xffff0000});
      expect_blended(before, after, color_in(format, {}, {255, 0, 0}), [&](int x, int y) {
        if (x < 5 || x >= 25 || y < 3 || y >= 14)
          return 0.0;
        const auto column = static_cast<int>(std::floor((x - 5 + 0.5) * mask_width / 20));
        const auto row = static_cast<int>(std::floor((y - 3 + 0.5) * mask_height / 11));
        return mask.at(column, row) == 255 ? 1.0 : mask.at(column, row) == 128 ? 0.5 : 0.0;
      });
    }
}

TEST(Painter, ContourIsTheInnerEdge) {
  // Three nested areas, so that both kinds of edge occur; and a speckled one.
  for (const auto& size : {std::array{61, 47}, std::array{1100, 40}, std::array{90, 800}}) {
    const int width = size[0], height = size[1];
    Mask nested(width, height, 1);
    for (int y = 0; y < height; ++y)
      for (int x = 0; x < width; ++x) {
        const int depth = std::min({x, y, width - 1 - x, height + 20 - y});
        nested.values[static_cast<std::size_t>(y) * width + x] = depth > 12 ? 255 : depth > 6 ? 128 : 0;
      }
    const int reach = std::clamp((height + 120) / 240, 1, 16);
    for (const Mask& mask : {nested, Mask(width, height, 9)}) {
      Picture before(PixelFormat::RGB, width, height), after(PixelFormat::RGB, width, height);
      paint(after.frame, estimate_of(mask, width, height), {OverlayStyle::contour, 60, 0xff00ff00});
      int edges = 0;
      expect_blended(before, after, color_in(PixelFormat::RGB, {}, {0, 255, 0}), [&](int x, int y) {
        int lowest = 255;
        for (int dy = -reach; dy <= reach; ++dy)
          for (int dx = -reach; dx <= reach; ++dx)
            if (x + dx >= 0 && x + dx < width && y + dy >= 0 && y + dy < height)
              lowest = std::min<int>(lowest, mask.at(x + dx, y + dy));
        const int own = mask.at(x, y);
        if (own > lowest)
          ++edges;
        return own == lowest ? 0.0 : own == 255 ? 120 / 256.0 : 60 / 256.0;
      });
      EXPECT_GT(edges, 0);
    }
  }
}

TEST(Painter, MaskStyleGivesBackTheMask) {
  for (int f = 0; f < pixel_format_count; ++f) {
    const auto format = static_cast<PixelFormat>(f);
    const Colorimetry full = {ColorRange::full, ColorMatrix::bt709};
    Picture picture(format, 31, 17, 4, true, 1, full);
    const Mask mask(20, 11, 6);
    Estimate estimate = estimate_of(mask, 31, 17);
    estimate.mask_region = {5, 3, 20, 11};
    estimate.window = {2, 2, 9, 9};
    estimate.horizon_row = 5;
    paint(picture.frame, estimate, {OverlayStyle::mask, 0});
    const bool rgb = layout_of(format).rgb;
    for (int y = 0; y < 17; ++y)
      for (int x = 0; x < 31; ++x) {
        const bool inside = x >= 5 && x < 25 && y >= 3 && y < 14;
        const int value = inside ? mask.at(x - 5, y - 3) : 128;
        const std::array<int, 3> expected = {value, rgb ? value : 128, rgb ? value : 128};
        ASSERT_EQ(picture.pixel(x, y), expected) << f << " at " << x << "," << y;
      }
    expect_gaps_untouched(picture);
  }
}

TEST(Painter, MaskStyleInLimitedRange) {
  Picture picture(PixelFormat::I420, 9, 2);
  Mask mask(9, 2, 6);
  mask.values = {0, 128, 255, 0, 128, 255, 0, 128, 255, 255, 255, 255, 0, 0, 0, 128, 128, 128};
  paint(picture.frame, estimate_of(mask, 9, 2), {OverlayStyle::mask});
  for (int y = 0; y < 2; ++y)
    for (int x = 0; x < 9; ++x) {
      const double expected = 16 + mask.at(x, y) * 219 / 255.0;
      EXPECT_LE(std::abs(picture.pixel(x, y)[0] - expected), 0.51);
      EXPECT_EQ(picture.pixel(x, y)[1], 128);
    }
}

TEST(Painter, MaskStyleWithoutMaskIsUnknown) {
  Picture picture(PixelFormat::RGBx, 6, 4, 0, false, 1, {ColorRange::full, {}});
  paint(picture.frame, Estimate{}, {OverlayStyle::mask});
  picture.each_sample([&](int c, int x, int y) { ASSERT_EQ(picture.sample(c, x, y), 128); });
}

TEST(Painter, WindowAndHorizonAreStretched) {
  // An estimate of a frame of half the size.
  Picture before(PixelFormat::RGB, 80, 60), after(PixelFormat::RGB, 80, 60);
  Estimate estimate;
  estimate.frame_width = 40;
  estimate.frame_height = 30;
  estimate.window = {10, 20, 12, 8};
  estimate.horizon_row = 7;
  paint(after.frame, estimate, {OverlayStyle::tint, 128});
  for (int y = 0; y < 60; ++y)
    for (int x = 0; x < 80; ++x) {
      const bool in_window = x >= 20 && x < 44 && y >= 40 && y < 56;
      const bool deep = x >= 21 && x < 43 && y >= 41 && y < 55;
      const bool drawn = (in_window && !deep) || y == 14;
      ASSERT_EQ(before.pixel(x, y) != after.pixel(x, y), drawn) << x << "," << y;
    }
  EXPECT_EQ(after.pixel(3, 14), after.pixel(70, 14)); // twice 128 is opaque
}

TEST(Painter, HeldHorizonIsDashed) {
  Picture before(PixelFormat::Y444, 200, 20), after(PixelFormat::Y444, 200, 20);
  Estimate estimate;
  estimate.horizon_row = 7;
  estimate.flags = flag_horizon_held;
  paint(after.frame, estimate, {OverlayStyle::tint, 256});
  int drawn = 0;
  for (int x = 0; x < 200; ++x)
    drawn += before.pixel(x, 7) != after.pixel(x, 7);
  EXPECT_GE(drawn, 95);
  EXPECT_LE(drawn, 105);
}

TEST(Painter, BarsAreAsLongAsTheirShare) {
  Picture picture(PixelFormat::RGB, 640, 360, 0, false, 1, {ColorRange::full, {}});
  Estimate estimate;
  estimate.model_count = 4;
  const std::uint64_t masses[4] = {std::uint64_t{6} << 50, std::uint64_t{3} << 50, std::uint64_t{1} << 50, 0};
  for (int i = 0; i < 4; ++i) {
    estimate.models[i].mass = masses[i];
    estimate.models[i].rgb = {static_cast<std::uint8_t>(200 - 20 * i), 30, static_cast<std::uint8_t>(i)};
  }
  paint(picture.frame, estimate, {OverlayStyle::models, 100});
  std::array<int, 4> pixels{};
  for (int y = 0; y < 360; ++y)
    for (int x = 0; x < 640; ++x)
      for (int i = 0; i < 4; ++i)
        pixels[i] += picture.pixel(x, y) == std::array<int, 3>{200 - 20 * i, 30, i};
  const double total = pixels[0] + pixels[1] + pixels[2];
  EXPECT_GT(total, 500);
  EXPECT_NEAR(pixels[0] / total, 0.6, 0.01);
  EXPECT_NEAR(pixels[1] / total, 0.3, 0.01);
  EXPECT_NEAR(pixels[2] / total, 0.1, 0.01);
  EXPECT_EQ(pixels[3], 0);
}

TEST(Painter, BarsOfSmallMassesAndFrames) {
  for (const auto [width, height] : sizes) {
    Picture picture(PixelFormat::NV12, width, height, 2);
    Estimate estimate;
    estimate.model_count = max_models + 5; // foreign metadata
    for (auto& model : estimate.models)
      model.mass = 1;
    paint(picture.frame, estimate, {OverlayStyle::models});
    expect_gaps_untouched(picture);
  }
}

TEST(Painter, WildEstimatesStayInside) {
  std::mt19937 random(8);
  const auto wild = [&] {
    constexpr int edges[] = {-2147483647 - 1, 2147483647, -1, 0, 1, 40, -40, 1 << 20};
    return edges[random() % 8];
  };
  for (int trial = 0; trial < 3000; ++trial) {
    Picture picture(static_cast<PixelFormat>(trial % pixel_format_count), 41, 23, 3);
    const Mask mask(13, 7, 1);
    Estimate estimate = estimate_of(mask, std::abs(wild() / 2), std::abs(wild() / 2));
    estimate.mask_region = {wild(), wild(), wild(), wild()};
    estimate.window = {wild(), wild(), wild(), wild()};
    estimate.horizon_row = wild();
    estimate.model_count = wild();
    const PaintStyle style = {static_cast<OverlayStyle>(random() % 4), wild()};
    paint(picture.frame, estimate, style);
    expect_gaps_untouched(picture);
  }
}

TEST(Painter, NoFrameNoDrawing) {
  const Mask mask(4, 4, 1);
  MutableFrame nothing;
  paint(nothing, estimate_of(mask, 4, 4), {});
  Picture picture(PixelFormat::I420, 4, 4);
  picture.frame.planes[2] = {};
  const auto before = picture.memory;
  paint(picture.frame, estimate_of(mask, 4, 4), {});
  EXPECT_EQ(picture.memory, before);
}

} // namespace
