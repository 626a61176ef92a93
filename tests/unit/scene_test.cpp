// SPDX-License-Identifier: LGPL-2.1-or-later
// The rendered scene: the same picture every time, a truth that fits it, every format and size.
#include "scene/scene.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <set>

namespace {

using namespace terrainseg;
using scene::Kind;
using scene::Light;
using scene::Motion;
using scene::Picture;
using scene::Renderer;

constexpr Kind kinds[] = {Kind::road, Kind::trail, Kind::corridor, Kind::plain};
constexpr Light lights[] = {Light::day, Light::dusk, Light::drift, Light::sun};
constexpr Motion motions[] = {Motion::straight, Motion::turn, Motion::bumpy, Motion::still};

scene::Settings settings_of(Kind kind, Light light = Light::day, Motion motion = Motion::straight,
                            std::uint32_t seed = 1, int obstacles = 40) {
  scene::Settings settings;
  settings.kind = kind;
  settings.light = light;
  settings.motion = motion;
  settings.seed = seed;
  settings.obstacles = obstacles;
  return settings;
}

struct Shot {
  Picture picture;
  Shot(const scene::Settings& settings, std::uint64_t number, int width, int height,
       PixelFormat format = PixelFormat::RGB, Colorimetry colorimetry = {ColorRange::full, {}})
      : picture(format, width, height, colorimetry) {
    Renderer(settings, width, height).render(number, picture);
  }
  int label(int x, int y) const { return picture.labels().plane.row(y)[x]; }
  int sample(int component, int x, int y) const {
    const Frame frame = picture.frame();
    const ComponentLayout& l = layout_of(frame.format).components[component];
    const std::uint8_t* at = frame.planes[l.plane].row(y >> l.y_shift) + l.offset + (x >> l.x_shift) * l.step;
    const FormatLayout& layout = layout_of(frame.format);
    return layout.depth == 8 ? *at : (at[0] + 256 * at[1]) >> (layout.depth - 8 + layout.shift);
  }
};

bool same(const Picture& a, const Picture& b) {
  const Frame fa = a.frame(), fb = b.frame();
  const FormatLayout& layout = layout_of(fa.format);
  for (const ComponentLayout& l : layout.parts())
    for (int y = 0; y < subsampled(fa.height, l.y_shift); ++y)
      for (int x = 0; x < subsampled(fa.width, l.x_shift); ++x)
        if (fa.planes[l.plane].row(y)[l.offset + x * l.step] !=
            fb.planes[l.plane].row(y)[l.offset + x * l.step])
          return false;
  for (int y = 0; y < fa.height; ++y)
    if (!std::equal(a.labels().plane.row(y), a.labels().plane.row(y) + fa.width, b.labels().plane.row(y)))
      return false;
  return a.horizon_row() == b.horizon_row();
}

double mean_luma(const Shot& shot) {
  double sum = 0;
  const Frame frame = shot.picture.frame();
  for (int y = frame.height / 2; y < frame.height; ++y)
    for (int x = 0; x < frame.width; ++x)
      sum += shot.sample(1, x, y);
  return sum / (frame.width * (frame.height - frame.height / 2));
}

TEST(Scene, AFrameStandsForItself) {
  for (const Kind kind : kinds) {
    const auto settings = settings_of(kind, Light::drift, Motion::turn, 5);
    Renderer renderer(settings, 90, 50);
    Picture forth(PixelFormat::I420, 90, 50), back(PixelFormat::I420, 90, 50),
        other(PixelFormat::I420, 90, 50);
    renderer.render(400, forth);
    renderer.render(3, other);
    renderer.render(400, back);
    EXPECT_TRUE(same(forth, back));
    EXPECT_FALSE(same(forth, other));
    EXPECT_TRUE(same(forth, Shot(settings, 400, 90, 50, PixelFormat::I420, {}).picture));
    EXPECT_EQ(forth.frame().pts, 400LL * 1'000'000'000 / 30);
    EXPECT_FALSE(same(
        forth,
        Shot(settings_of(kind, Light::drift, Motion::turn, 6), 400, 90, 50, PixelFormat::I420, {}).picture));
  }
}

TEST(Scene, TheTruthIsComplete) {
  for (const Kind kind : kinds)
    for (const Light light : {Light::day, Light::dusk, Light::drift}) // with a sun: scene_light_test
      for (const Motion motion : motions)
        for (const std::uint32_t seed : {1, 2, 3})
          for (const std::uint64_t number : {0, 77, 100000}) {
            const Shot shot(settings_of(kind, light, motion, seed), number, 160, 90);
            std::set<int> seen;
            int window = 0, driven = 0;
            for (int y = 0; y < 90; ++y)
              for (int x = 0; x < 160; ++x) {
                const int label = shot.label(x, y);
                ASSERT_TRUE((label >= 0 && label <= 3) || label == 255) << label;
                seen.insert(label);
                if (y >= 90 - 13 && x >= 56 && x < 104) {
                  ++window;
                  driven += label == scene::driven_terrain;
                }
              }
            const auto where = testing::Message()
                               << "scene " << static_cast<int>(kind) << " motion " << static_cast<int>(motion)
                               << " seed " << seed << " frame " << number;
            EXPECT_TRUE(seen.count(scene::driven_terrain)) << where;
            EXPECT_TRUE(seen.count(scene::not_traversable)) << where;
            EXPECT_EQ(seen.count(scene::sky), kind == Kind::corridor ? 0U : seen.count(scene::sky)) << where;
            // What the filter trains on is what is driven on.
            EXPECT_GE(driven, window * (motion == Motion::turn ? 0.8 : 0.97)) << where;
          }
}

TEST(Scene, TheHorizonDividesGroundAndSky) {
  for (const Kind kind : kinds)
    for (const Motion motion : motions)
      for (const std::uint64_t number : {0, 31, 250}) {
        const Shot shot(settings_of(kind, Light::day, motion), number, 320, 180);
        const int row = shot.picture.horizon_row();
        ASSERT_GT(row, 20);
        ASSERT_LT(row, 120);
        // In the middle of the width roll plays no part.
        for (int y = 0; y < 180; ++y) {
          const int label = shot.label(160, y);
          if (y < row) {
            EXPECT_TRUE(label == scene::sky || label == scene::not_traversable) << y << " of " << row;
          } else if (y > row) {
            EXPECT_NE(label, scene::sky) << y << " of " << row;
          }
        }
        if (kind == Kind::plain && motion != Motion::turn) {
          int ground = 0; // nothing hides a plain's far end for long
          for (int x = 158; x < 162; ++x)
            ground += shot.label(x, row + 4) == scene::driven_terrain;
          EXPECT_GE(ground, 1);
        }
      }
}

TEST(Scene, EveryFormatShowsTheSamePicture) {
  constexpr int width = 51, height = 35; // odd: chroma samples with one pixel
  const auto settings = settings_of(Kind::road);
  const Shot reference(settings, 9, width, height);
  const double kr[3] = {0.299, 0.2126, 0.2627}, kb[3] = {0.114, 0.0722, 0.0593};
  for (int f = 0; f < pixel_format_count; ++f)
    for (int m = 0; m < 3; ++m)
      for (const ColorRange range : {ColorRange::limited, ColorRange::full}) {
        const auto format = static_cast<PixelFormat>(f);
        const FormatLayout& layout = layout_of(format);
        const Shot shot(settings, 9, width, height, format, {range, static_cast<ColorMatrix>(m)});
        const bool limited = range == ColorRange::limited;
        double worst = 0;
        for (int c = 0; c < layout.component_count; ++c) {
          const ComponentLayout& l = layout.components[c];
          for (int y = 0; y < height; ++y)
            for (int x = 0; x < width; ++x) {
              double rgb[3] = {};
              int pixels = 0;
              for (int py = y >> l.y_shift << l.y_shift;
                   py < std::min(((y >> l.y_shift) + 1) << l.y_shift, height); ++py)
                for (int px = x >> l.x_shift << l.x_shift;
                     px < std::min(((x >> l.x_shift) + 1) << l.x_shift, width); ++px) {
                  for (int k = 0; k < 3; ++k)
                    rgb[k] += reference.sample(k, px, py);
                  ++pixels;
                }
              for (double& v : rgb)
                v /= pixels;
              const double luma = kr[m] * rgb[0] + (1 - kr[m] - kb[m]) * rgb[1] + kb[m] * rgb[2];
              double expected;
              if (layout.rgb)
                expected = limited ? 16 + rgb[c] * 219 / 255 : rgb[c];
              else if (c == 0)
                expected = limited ? 16 + luma * 219 / 255 : luma;
              else
                expected =
                    128 + (c == 1 ? (rgb[2] - luma) / (2 - 2 * kb[m]) : (rgb[0] - luma) / (2 - 2 * kr[m])) *
                              (limited ? 224.0 / 255 : 1);
              worst = std::max(worst, std::abs(shot.sample(c, x, y) - std::clamp(expected, 0.0, 255.0)));
            }
        }
        EXPECT_LE(worst, 0.51) << "format " << f << " matrix " << m;
      }
}

TEST(Scene, EverySize) {
  for (const auto& size : {std::array{1, 1}, std::array{2, 1}, std::array{1, 300}, std::array{700, 3},
                           std::array{17, 33}, std::array{1280, 720}})
    for (const Kind kind : kinds) {
      const Shot shot(settings_of(kind, Light::day, Motion::bumpy), 12, size[0], size[1], PixelFormat::NV12,
                      {});
      const int row = shot.picture.horizon_row();
      EXPECT_GE(row, -1);
      EXPECT_LT(row, size[1]);
    }
}

TEST(Scene, TheSameViewAtEverySize) {
  for (const Kind kind : kinds) {
    const Shot small(settings_of(kind), 20, 160, 90), large(settings_of(kind), 20, 640, 360);
    int differ = 0;
    for (int y = 0; y < 90; ++y)
      for (int x = 0; x < 160; ++x)
        differ += small.label(x, y) != large.label(4 * x + 2, 4 * y + 2);
    EXPECT_LT(differ, 160 * 90 * 0.04);
    EXPECT_NEAR(small.picture.horizon_row() * 4, large.picture.horizon_row(), 4);
  }
}

TEST(Scene, ObstaclesFollowTheirProperty) {
  for (const Kind kind : kinds) {
    int none = 0, many = 0;
    for (const std::uint32_t seed : {1, 2, 3})
      for (const std::uint64_t number : {0, 120}) {
        const Shot without(settings_of(kind, Light::day, Motion::straight, seed, 0), number, 160, 90);
        const Shot with(settings_of(kind, Light::day, Motion::straight, seed, 100), number, 160, 90);
        for (int y = 45; y < 90; ++y)
          for (int x = 0; x < 160; ++x) {
            none += without.label(x, y) == scene::not_traversable;
            many += with.label(x, y) == scene::not_traversable;
          }
      }
    EXPECT_GT(many, none + 300) << static_cast<int>(kind);
  }
}

TEST(Scene, LightChangesThePicture) {
  for (const Kind kind : kinds) {
    const double day = mean_luma(Shot(settings_of(kind), 0, 160, 90));
    const double dusk = mean_luma(Shot(settings_of(kind, Light::dusk), 0, 160, 90));
    EXPECT_LT(dusk, 0.8 * day);
    EXPECT_GT(day, 60);
    EXPECT_LT(day, 200);
    double darkest = 255, brightest = 0;
    for (const std::uint64_t number : {0, 60, 120, 180, 240, 300}) {
      const double luma = mean_luma(Shot(settings_of(kind, Light::drift, Motion::still), number, 160, 90));
      darkest = std::min(darkest, luma);
      brightest = std::max(brightest, luma);
    }
    EXPECT_GT(brightest, 1.25 * darkest);
  }
}

TEST(Scene, MotionMovesTheHorizon) {
  for (const Kind kind : kinds) {
    const auto spread = [&](Motion motion) {
      int lowest = 1000, highest = -1;
      for (std::uint64_t number = 0; number < 90; number += 9) {
        const int row = Shot(settings_of(kind, Light::day, motion), number, 160, 90).picture.horizon_row();
        lowest = std::min(lowest, row);
        highest = std::max(highest, row);
      }
      return highest - lowest;
    };
    EXPECT_EQ(spread(Motion::still), 0);
    EXPECT_LE(spread(Motion::straight), 2);
    EXPECT_GE(spread(Motion::bumpy), 3);
  }
}

TEST(Scene, StandingStillOnlyNoiseMoves) {
  const auto settings = settings_of(Kind::corridor, Light::day, Motion::still);
  const Shot a(settings, 0, 160, 90), b(settings, 500, 160, 90);
  double difference = 0;
  for (int y = 0; y < 90; ++y)
    for (int x = 0; x < 160; ++x) {
      ASSERT_EQ(a.label(x, y), b.label(x, y));
      difference += std::abs(a.sample(1, x, y) - b.sample(1, x, y));
    }
  difference /= 160 * 90;
  EXPECT_GT(difference, 0.5);
  EXPECT_LT(difference, 4);
}

// FNV-1a of all bytes of the pixels and labels.
std::uint64_t digest(const Picture& picture) {
  std::uint64_t hash = 0xcbf29ce484222325U;
  const auto add = [&](const std::uint8_t* bytes, int count) {
    for (int i = 0; i < count; ++i)
      hash = (hash ^ bytes[i]) * 0x100000001b3U;
  };
  const Frame frame = picture.frame();
  for (const ComponentLayout& l : layout_of(frame.format).parts())
    for (int y = 0; y < subsampled(frame.height, l.y_shift); ++y)
      add(frame.planes[l.plane].row(y), subsampled(frame.width, l.x_shift));
  for (int y = 0; y < frame.height; ++y)
    add(picture.labels().plane.row(y), frame.width);
  return hash;
}

TEST(Scene, TheSameBytesFromEveryCompilerAndMachine) {
  // Whoever changes the pictures writes the new digests here; GCC and Clang, optimised or not, must agree.
  constexpr std::uint64_t expected[4][4] = {
      {0x6f674112a5656563U, 0x9cb2b44c32df1fa4U, 0xd858bedc8d38d9d2U, 0x1719bd1a4ae1c09U},
      {0xed80fa1ae55d18bbU, 0x6b80999b13aa3fe0U, 0x54386a7963621741U, 0x8c35e494d27ce20U},
      {0xe8357ccd01a9a440U, 0xcd3d3e054d71c47U, 0x70c56e5efbeec7f8U, 0xa9eab2c527d5eb7U},
      {0x6c52c4e973f2751eU, 0x29dbb13a3b24cbf1U, 0xc20878f0e3a5315dU, 0xcab0f1e72e4391fbU}};
  for (int k = 0; k < 4; ++k)
    for (int i = 0; i < 4; ++i) {
      auto settings =
          settings_of(kinds[k], lights[i], motions[(k + i) % 4], static_cast<std::uint32_t>(i + 1));
      settings.wet = lights[i] == Light::sun;
      const Shot shot(settings, static_cast<std::uint64_t>(331 * i), 203, 115, PixelFormat::I420, {});
      EXPECT_EQ(digest(shot.picture), expected[k][i])
          << std::hex << "0x" << digest(shot.picture) << " scene " << k << " " << i;
    }
}

} // namespace
