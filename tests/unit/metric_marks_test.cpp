// SPDX-License-Identifier: LGPL-2.1-or-later
// Metres on a picture, pixel by pixel.
#include <array>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "painter/metric_marks.hpp"

namespace terrainseg {
namespace {

constexpr int width = 64, height = 40;

/// RGB, black; white letters then show as they are.
struct Page {
  std::vector<std::uint8_t> pixels = std::vector<std::uint8_t>(width * height * 3);

  MutableFrame frame() {
    MutableFrame f;
    f.format = PixelFormat::RGB;
    f.width = width;
    f.height = height;
    f.colorimetry = {ColorRange::full, ColorMatrix::bt601};
    f.planes[0] = {pixels.data(), width * 3};
    return f;
  }
  void paint(const MetricMarks& marks, const PaintStyle& style = {OverlayStyle::tint, 256, 0xff00c83c}) {
    paint_metres(frame(), marks, style);
  }
  std::array<int, 3> at(int x, int y) const {
    const std::uint8_t* p = &pixels[static_cast<std::size_t>((y * width + x) * 3)];
    return {p[0], p[1], p[2]};
  }
  /// A part of the picture as text: # where it is white.
  std::string text(int x, int y, int w, int h) const {
    std::string out;
    for (int row = y; row < y + h; ++row, out += '\n')
      for (int column = x; column < x + w; ++column)
        out += at(column, row) == std::array{255, 255, 255} ? '#' : '.';
    return out;
  }
};

TEST(MetricMarks, NumbersAreReadable) {
  Page page;
  const MetricMark mark{MetricMark::Kind::boundary, 32, 30, 47};
  page.paint({{&mark, 1}, {}, 0, 0});
  // "4.7m" in letters of 5 x 7, one apart, in a box of 25 x 9 whose lower edge is two pixels above row 30.
  EXPECT_EQ(page.text(32 - 12, 30 - 11, 25, 9), ".........................\n"
                                                "....#........#####.......\n"
                                                "...##............#.......\n"
                                                "..#.#...........#..##.#..\n"
                                                ".#..#..........#...#.#.#.\n"
                                                ".#####........#....#.#.#.\n"
                                                "....#...##....#....#.#.#.\n"
                                                "....#...##....#....#.#.#.\n"
                                                ".........................\n");
}

TEST(MetricMarks, ATickIsADashWithItsNumber) {
  Page page;
  const MetricMark mark{MetricMark::Kind::tick, 20, 20, 50};
  page.paint({{&mark, 1}, {}, 0, 0});
  EXPECT_EQ(page.text(14, 20, 14, 1), "...#######....\n");
  EXPECT_EQ(page.text(17, 19, 7, 1), ".......\n");
  EXPECT_EQ(page.text(25, 16, 13, 9), ".............\n"
                                      ".#####.......\n"
                                      ".#...........\n"
                                      ".####..##.#..\n"
                                      ".....#.#.#.#.\n"
                                      ".....#.#.#.#.\n"
                                      ".#...#.#.#.#.\n"
                                      "..###..#.#.#.\n"
                                      ".............\n");
}

TEST(MetricMarks, TheMapHasItsColours) {
  Page page;
  const std::vector<std::uint8_t> map = {map_outside, map_outside, map_outside,  map_outside, map_outside,
                                         map_outside, map_free,    map_unknown,  map_ring,    map_outside,
                                         map_outside, map_vehicle, map_obstacle, map_outside, map_outside,
                                         map_outside, map_outside, map_outside,  map_outside, map_outside};
  page.paint({{}, {{map.data(), 5}, 5, 4}, 50, 10});
  EXPECT_EQ(page.at(51, 11), (std::array{0, 200, 60}));
  EXPECT_EQ(page.at(52, 11), (std::array{60, 60, 60}));
  EXPECT_EQ(page.at(53, 11), (std::array{128, 128, 128}));
  EXPECT_EQ(page.at(51, 12), (std::array{255, 255, 255}));
  EXPECT_EQ(page.at(52, 12), (std::array{255, 72, 40}));
  EXPECT_EQ(page.at(53, 12), (std::array{0, 0, 0}));
  EXPECT_EQ(page.at(50, 10), (std::array{255, 255, 255})) << "a frame around it";
  EXPECT_EQ(page.at(49, 10), (std::array{0, 0, 0}));
}

TEST(MetricMarks, InvisibleStylesDrawNothing) {
  const MetricMark mark{MetricMark::Kind::tick, 20, 20, 50};
  for (const PaintStyle& style : {PaintStyle{OverlayStyle::mask, 256}, PaintStyle{OverlayStyle::tint, 0},
                                  PaintStyle{OverlayStyle::map, 256, 0x00ffffff}}) {
    Page page;
    page.paint({{&mark, 1}, {}, 0, 0}, style);
    EXPECT_EQ(page.pixels, Page().pixels);
  }
}

/// A frame of any format whose planes lie between bytes that must stay.
struct Guarded {
  static constexpr int guard = 64;
  static constexpr std::uint8_t untouched = 0x5a;
  std::array<std::vector<std::uint8_t>, 3> planes;
  MutableFrame frame;

  explicit Guarded(PixelFormat format) {
    frame.format = format;
    frame.width = width;
    frame.height = height;
    const FormatLayout& layout = layout_of(format);
    for (int p = 0; p < layout.planes; ++p) {
      const int stride = row_bytes(layout, p, width) + guard;
      planes[p].assign(static_cast<std::size_t>(stride * plane_rows(layout, p, height) + guard), untouched);
      frame.planes[p] = {planes[p].data() + guard, stride};
    }
  }
  bool guards_are_intact() const {
    const FormatLayout& layout = layout_of(frame.format);
    for (int p = 0; p < layout.planes; ++p) {
      const std::size_t row = static_cast<std::size_t>(row_bytes(layout, p, width)), stride = row + guard;
      for (std::size_t i = 0; i < planes[p].size(); ++i)
        if ((i < guard || (i - guard) % stride >= row) && planes[p][i] != untouched)
          return false;
    }
    return true;
  }
};

TEST(MetricMarks, WhatLiesOutsideIsLeftOut) {
  const std::vector<std::uint8_t> map(100, map_free);
  for (const int place : {-2000000, -6, 36, 60, 2000000})
    for (int f = 0; f < pixel_format_count; ++f) {
      Guarded picture(static_cast<PixelFormat>(f));
      std::vector<MetricMark> marks;
      for (const auto kind : {MetricMark::Kind::tick, MetricMark::Kind::boundary, MetricMark::Kind::ring})
        marks.push_back({kind, place, place / 2, 99999});
      paint_metres(picture.frame, {marks, {{map.data(), 10}, 10, 10}, place, place / 2}, {});
      EXPECT_TRUE(picture.guards_are_intact()) << f << " " << place;
    }
}

} // namespace
} // namespace terrainseg
