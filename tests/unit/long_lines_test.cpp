// SPDX-License-Identifier: LGPL-2.1-or-later
#include "freespace/look/long_lines.hpp"

#include <cmath>
#include <cstdlib>
#include <numbers>
#include <optional>
#include <random>
#include <vector>

#include <gtest/gtest.h>

#include "support/frames.hpp"
#include "terrainseg/segmenter.hpp"

namespace terrainseg {
namespace {

using test::Components;
using test::OwnedFrame;
using test::Painter;

/// A meeting point in shares of the frame, and the directions of the edges that run down from it, in degrees:
/// below 90 to the right.
struct Fan {
  double x, y;
  std::vector<double> degrees;
  int step = 40; ///< between neighbouring parts, in grey levels
  int noise = 2; ///< bits
};

/// Below the meeting point every second part between the edges is brighter; above it the frame is plain.
Painter parts(const Fan& fan, int width, int height) {
  return [=](int x, int y) {
    const double dx = x - fan.x * width, dy = y - fan.y * height;
    int luma = 100 + test::noise_at(x, y, 1, fan.noise);
    if (dy > 0) {
      const double angle = std::atan2(dy, dx) * 180 / std::numbers::pi;
      int edges = 0;
      for (const double degrees : fan.degrees)
        edges += angle > degrees;
      luma += edges % 2 * fan.step;
    }
    const auto grey = static_cast<std::uint8_t>(luma);
    return Components{grey, 128, 128};
  };
}

/// Row of the frame, or nothing.
std::optional<double> row_of(OwnedFrame& frame, int grid_level) {
  frame.frame().colorimetry = {ColorRange::full, ColorMatrix::bt601};
  const bool rgb = layout_of(frame.frame().format).rgb;
  Pyramid pyramid;
  pyramid.build(frame.frame(), coarse_plan(frame.frame().format, grid_level));
  LongLines lines;
  LumaLevels luma;
  luma.read(pyramid, texture_level(grid_level), grid_level,
            color_transform_of(rgb, frame.frame().colorimetry), rgb);
  lines.prepare(luma, grid_level);
  const auto row = lines.meeting_row(luma);
  return row ? std::optional(*row / 256.0) : std::nullopt;
}

std::optional<double> row_of(const Painter& paint, int width, int height, int level,
                             PixelFormat format = PixelFormat::I420) {
  OwnedFrame frame(format, width, height, paint);
  return row_of(frame, level);
}

const std::vector<double> corridor{20, 32, 45, 60, 120, 135, 148, 160};

TEST(LongLines, MeetWhereTheyWereDrawnTo) {
  struct Case {
    int width, height, level;
    Fan fan;
  };
  for (const Case& c : {Case{640, 480, 3, {0.5, 0.45, corridor}},
                        {854, 480, 3, {0.4, 0.3, corridor}},
                        {1920, 1080, 4, {0.55, 0.5, corridor}},
                        {652, 960, 3, {0.5, 0.4, {35, 50, 65, 115, 130, 145}}},
                        {640, 480, 3, {0.5, 0.4, corridor, 16}},
                        {640, 480, 3, {0.5, 0.4, corridor, 40, 4}}}) {
    const auto row = row_of(parts(c.fan, c.width, c.height), c.width, c.height, c.level);
    ASSERT_TRUE(row) << c.width << 'x' << c.height << ' ' << c.fan.step << ' ' << c.fan.noise;
    EXPECT_NEAR(*row / c.height, c.fan.y, 1.0 / 48) << c.width << 'x' << c.height;
  }
}

TEST(LongLines, MayMeetAboveTheFrame) {
  const auto row = row_of(parts({0.5, -0.1, {40, 52, 65, 115, 128, 140}}, 640, 480), 640, 480, 3);
  ASSERT_TRUE(row);
  EXPECT_NEAR(*row / 480, -0.1, 1.0 / 32);
}

TEST(LongLines, AreTheSameInRgb) {
  const Painter grey = [paint = parts({0.5, 0.45, corridor}, 640, 480)](int x, int y) {
    const Components c = paint(x, y);
    return Components{c[0], c[0], c[0]};
  };
  const auto row = row_of(grey, 640, 480, 3, PixelFormat::RGB);
  ASSERT_TRUE(row);
  EXPECT_NEAR(*row / 480, 0.45, 1.0 / 48);
}

TEST(LongLines, AreNotFoundWhereNoneMeet) {
  EXPECT_FALSE(row_of(parts({0.5, 0.45, {}}, 640, 480), 640, 480, 3)) << "plain";
  EXPECT_FALSE(row_of(parts({0.5, 0.45, {20, 32, 45, 60}}, 640, 480), 640, 480, 3)) << "from one side only";
  EXPECT_FALSE(row_of(parts({0.5, 0.45, {1, 2, 3, 177, 178, 179}}, 640, 480), 640, 480, 3)) << "too flat";
  EXPECT_FALSE(row_of(parts({0.5, 0.45, {80, 85, 95, 100}}, 640, 480), 640, 480, 3)) << "too steep";
  const auto stripes = [](int x, int y) {
    return Components{static_cast<std::uint8_t>(80 + (x + y) / 24 % 2 * 60), 128, 128};
  };
  EXPECT_FALSE(row_of(stripes, 640, 480, 3)) << "parallel";
  std::mt19937 random(7);
  const auto noise = [&](int, int) {
    return Components{static_cast<std::uint8_t>(random() % 256), 128, 128};
  };
  EXPECT_FALSE(row_of(noise, 640, 480, 3)) << "noise";
  EXPECT_FALSE(row_of(noise, 640, 480, 2)) << "noise";
}

TEST(LongLines, AreNotSearchedInFramesThatAreTooSmallOrInGridsThatAreTooFine) {
  EXPECT_FALSE(row_of(parts({0.5, 0.45, corridor}, 14, 20), 14, 20, 0));
  EXPECT_FALSE(row_of(parts({0.5, 0.45, corridor}, 640, 480), 640, 480, 1));
}

TEST(LineWatch, LooksAtTheFirstFramesAndThenAtOneOfTwelve) {
  LineWatch watch;
  for (int frame = 0; frame < 100; ++frame)
    EXPECT_EQ(watch.due(480), frame < 4 || frame % 12 == 0) << frame;
  for (int frame = 0; frame < 30; ++frame)
    EXPECT_EQ(watch.due(240), frame < 4 || frame % 12 == 0) << "another size, frame " << frame;
}

TEST(LineWatch, LooksAgainUntilTwoLooksAgree) {
  LineWatch watch;
  for (int frame = 0; frame < 24; ++frame)
    watch.due(480);
  ASSERT_TRUE(watch.due(480));
  watch.take(200 << 8);
  ASSERT_TRUE(watch.due(480)) << "one look found a row";
  watch.take(300 << 8);
  ASSERT_TRUE(watch.due(480)) << "two looks disagree";
  watch.take(305 << 8);
  EXPECT_TRUE(watch.line().known());
  EXPECT_FALSE(watch.due(480)) << "they agree";
  for (int frame = 28; frame < 36; ++frame)
    EXPECT_FALSE(watch.due(480)) << frame;
  for (int frame = 36; frame < 40; ++frame) {
    EXPECT_TRUE(watch.due(480)) << frame;
    watch.take((frame % 2 ? 100 : 200) << 8);
  }
  EXPECT_FALSE(watch.due(480)) << "four looks disagree";
}

TEST(LineWatch, BelievesWhatTwoLooksFind) {
  LineWatch watch;
  ASSERT_TRUE(watch.due(480));
  EXPECT_FALSE(watch.line().known());
  watch.take(200 << 8);
  EXPECT_FALSE(watch.line().known());
  watch.take(std::nullopt);
  watch.take(210 << 8); // 480 / 48 = 10 rows away
  EXPECT_EQ(watch.line().row_q8, 210 << 8);
  EXPECT_EQ(watch.line().source, FrameLine::Source::lines);
  watch.take((220 << 8) + 1);
  EXPECT_FALSE(watch.line().known()) << "another row";
  watch.take(219 << 8);
  EXPECT_TRUE(watch.line().known());
  for (int look = 0; look < 4; ++look)
    watch.take(std::nullopt);
  EXPECT_TRUE(watch.line().known()) << "four looks may find nothing";
  watch.take(std::nullopt);
  EXPECT_FALSE(watch.line().known());
  watch.take(219 << 8);
  EXPECT_FALSE(watch.line().known()) << "forgotten: the next row must be found twice";
  watch.take(219 << 8);
  EXPECT_TRUE(watch.line().known());
  ASSERT_TRUE(watch.due(240));
  EXPECT_FALSE(watch.line().known()) << "another size";
}

/// A room whose floor, walls and ceiling have the same colour: only thin dark lines where they meet and
/// between the tiles tell them apart.
Painter white_room(int width, int height) {
  return [=](int x, int y) {
    const double dx = x - 0.5 * width, dy = y - 0.4 * height;
    int luma = 190 + test::noise_at(x, y, 5, 2);
    const double across = std::abs(dx), floor = dy, ceiling = -dy; // the ceiling is higher above the camera
    for (const double slope : {0.35, 0.5, 0.75, 1.1, 1.6})
      if (std::abs(floor - slope * across) < 4 || std::abs(ceiling - 1.2 * slope * across) < 4)
        luma -= 20;
    return Components{static_cast<std::uint8_t>(luma), 128, 128};
  };
}

TEST(LongLines, EndTheGroundInARoomOfOneColour) {
  const auto highest_ground = [](bool long_lines, double hint) {
    Settings settings;
    settings.motion = Motion::off;
    settings.long_lines = long_lines;
    settings.horizon_hint_q8 = static_cast<int>(256 * hint);
    Segmenter segmenter(settings);
    const OwnedFrame frame(PixelFormat::I420, 640, 480, white_room(640, 480));
    for (int i = 0; i < 4; ++i)
      EXPECT_TRUE(segmenter.process(frame.frame()).ok());
    const Estimate& e = segmenter.estimate();
    EXPECT_EQ(e.vanishing_row, -1) << "a guess is no measurement";
    for (int y = 0; y < e.mask.height; ++y)
      for (int x = 0; x < e.mask.width; ++x)
        if (e.mask.plane.row(y)[x] == mask_traversable)
          return y;
    return e.mask.height;
  };
  constexpr int line = 480 * 2 / 5, rise = 480 / 32, cell = 8;
  EXPECT_LT(highest_ground(false, -1), line - 4 * rise) << "the test has no sense: nothing is flooded";
  EXPECT_GE(highest_ground(true, -1), line - rise - 2 * cell);
  EXPECT_LT(highest_ground(true, 0), line - 4 * rise) << "the user's hint is believed";
}

} // namespace
} // namespace terrainseg
