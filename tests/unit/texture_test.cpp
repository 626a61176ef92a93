// SPDX-License-Identifier: LGPL-2.1-or-later
#include "freespace/look/view.hpp"

#include <gtest/gtest.h>

#include "support/frames.hpp"

namespace terrainseg {
namespace {

using test::Components;
using test::OwnedFrame;

const Colorimetry full{ColorRange::full, ColorMatrix::bt601};

struct Read {
  GridReader reader;
  Grid grid;
  std::vector<std::uint16_t> texture;
};

Read read(OwnedFrame& frame, int level, const Colorimetry& colorimetry = full) {
  frame.frame().colorimetry = colorimetry;
  Pyramid pyramid;
  pyramid.build(frame.frame(), coarse_plan(frame.frame().format, level));
  const bool rgb = layout_of(frame.frame().format).rgb;
  const ColorTransform transform = color_transform_of(rgb, colorimetry);
  Read result;
  result.grid = result.reader.read(pyramid, level, transform, {});
  LumaLevels luma;
  luma.read(pyramid, texture_level(level), level, transform, rgb);
  TextureReader().read(luma, result.grid, result.texture);
  return result;
}

TEST(Texture, OneColourHasNone) {
  for (const int level : {0, 1, 2, 3, 4}) {
    OwnedFrame frame(PixelFormat::I420, 131, 97, [](int, int) { return Components{90, 120, 130}; });
    for (const std::uint16_t t : read(frame, level).texture)
      ASSERT_EQ(t, 0) << level;
  }
}

// A ramp rises by the same step in every column of a level: twice as steep one level coarser.
TEST(Texture, ARampGivesItsSlopeOnEveryBand) {
  OwnedFrame frame(PixelFormat::I420, 128, 128, [](int x, int) {
    return Components{static_cast<std::uint8_t>(2 * x), 128, 128};
  });
  const Read r = read(frame, 3); // bands at levels 2, 1, 0: steps 8, 4, 2
  EXPECT_NEAR(r.texture[r.grid.at(8, 8)], 16 * (8 + 4 + 2), 8);
  const Read one = read(frame, 1); // one band, step 2, scaled to three
  EXPECT_NEAR(one.texture[one.grid.at(30, 30)], 16 * 2 * 3, 8);
}

TEST(Texture, UprightThingsOnly) {
  OwnedFrame across(PixelFormat::I420, 96, 96, [](int, int y) {
    return Components{static_cast<std::uint8_t>(y % 8 < 4 ? 60 : 180), 128, 128};
  });
  for (const std::uint16_t t : read(across, 3).texture)
    ASSERT_EQ(t, 0);
  OwnedFrame upright(PixelFormat::I420, 96, 96, [](int x, int) {
    return Components{static_cast<std::uint8_t>(x % 3 ? 60 : 180), 128, 128};
  });
  const Read r = read(upright, 3);
  EXPECT_GT(r.texture[r.grid.at(5, 5)], 200);
}

TEST(Texture, LiesAroundTheCellNotBesideIt) {
  // Noise from frame row 48 down, level 3: cell row 6 is centred there. Rows above must stay nearly smooth.
  OwnedFrame frame(PixelFormat::I420, 96, 96, [](int x, int y) {
    return Components{static_cast<std::uint8_t>(y < 48 ? 100 : 60 + test::noise_at(x, y, 1, 7)), 128, 128};
  });
  const Read r = read(frame, 3);
  EXPECT_LT(r.texture[r.grid.at(4, 6)] * 4, r.texture[r.grid.at(8, 6)]);
  const int half = r.texture[r.grid.at(6, 6)], whole = r.texture[r.grid.at(8, 6)];
  EXPECT_GT(half * 4, whole);
  EXPECT_LT(half, whole);
}

TEST(Texture, TheSameInRgbAndInBothRanges) {
  const auto gray = [](int x, int y) { return 40 + test::noise_at(x / 2, y / 2, 7, 7); };
  OwnedFrame yuv(PixelFormat::I420, 96, 64, [&](int x, int y) {
    return Components{static_cast<std::uint8_t>(gray(x, y)), 128, 128};
  });
  OwnedFrame limited(PixelFormat::I420, 96, 64, [&](int x, int y) {
    return Components{static_cast<std::uint8_t>(16 + gray(x, y) * 219 / 255), 128, 128};
  });
  OwnedFrame rgb(PixelFormat::RGB, 96, 64, [&](int x, int y) {
    const auto v = static_cast<std::uint8_t>(gray(x, y));
    return Components{v, v, v};
  });
  const Read a = read(yuv, 2), b = read(limited, 2, {}), c = read(rgb, 2);
  for (std::size_t i = 0; i < a.texture.size(); ++i) {
    ASSERT_NEAR(a.texture[i], b.texture[i], 60);
    ASSERT_NEAR(a.texture[i], c.texture[i], 40);
  }
}

TEST(Texture, OddSizesStayInside) {
  for (int width = 8; width < 40; ++width)
    for (const int level : {0, 1, 2, 3}) {
      OwnedFrame frame(PixelFormat::Y444, width, 9 + width % 5, [](int x, int y) {
        return Components{static_cast<std::uint8_t>(test::noise_at(x, y, 3, 8)), 128, 128};
      });
      for (const std::uint16_t t : read(frame, level).texture)
        ASSERT_LE(t, 3 * 255 * 16);
    }
}

} // namespace
} // namespace terrainseg
