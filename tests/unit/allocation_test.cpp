// SPDX-License-Identifier: LGPL-2.1-or-later
// Counts every allocation: once running, a frame needs none.
#include <memory>

#include <gtest/gtest.h>

#include "support/allocations.hpp"
#include "support/frames.hpp"
#include "terrainseg/segmenter.hpp"

namespace terrainseg {
namespace {

using test::allocations;

TEST(Allocation, TheCounterCounts) {
  const long before = allocations;
  delete new volatile int(3);
  EXPECT_EQ(allocations - before, 1);
}

TEST(Allocation, NoneOnceRunning) {
  std::vector<std::unique_ptr<test::OwnedFrame>> frames;
  for (PixelFormat format : {PixelFormat::I420, PixelFormat::YUY2, PixelFormat::BGRx})
    for (int i = 0; i < 12; ++i)
      frames.push_back(std::make_unique<test::OwnedFrame>(format, 320, 240, test::drive(320, 240, i)));
  for (Preset preset : {Preset::paper, Preset::standard})
    for (int mask_level : {0, 2})
      for (int threads : {1, 2})
        for (std::size_t first : {0, 12, 24}) {
          Settings settings = Settings::of(preset);
          settings.motion = preset == Preset::standard ? Motion::automatic : Motion::off;
          settings.mask_level = mask_level;
          settings.n_threads = threads;
          settings.ignore_regions = {{0, 0, 40, 20}};
          Segmenter segmenter(settings);
          for (std::size_t i = 0; i < 3; ++i)
            ASSERT_TRUE(segmenter.process(frames[first + i]->frame()).ok());
          const long before = allocations;
          for (std::size_t i = 3; i < 12; ++i)
            ASSERT_TRUE(segmenter.process(frames[first + i]->frame()).ok());
          EXPECT_EQ(allocations - before, 0)
              << static_cast<int>(preset) << " " << mask_level << " " << threads << " " << first;
        }
}

// Ground that reaches higher than before, and the first field of stones on it.
TEST(Allocation, NoneWhereStonesAppear) {
  const auto painter = [](int sky, bool stones) {
    return [=](int x, int y) -> test::Components {
      if (y < sky)
        return {230, 150, 100};
      const int grain = (x * 7 + y * 13) % 11, in_stone = stones && x % 40 < 10 && y % 24 < 8 ? 1 : 0;
      return {static_cast<std::uint8_t>(100 + grain + in_stone * (x % 40 < 5 ? 70 : -60)), 128, 128};
    };
  };
  const test::OwnedFrame even(PixelFormat::I420, 320, 240, painter(140, false)),
      stony(PixelFormat::I420, 320, 240, painter(60, true));
  Segmenter segmenter{Settings{}};
  for (int i = 0; i < 4; ++i)
    ASSERT_TRUE(segmenter.process(even.frame()).ok());
  const long before = allocations;
  for (int i = 0; i < 9; ++i)
    ASSERT_TRUE(segmenter.process(stony.frame()).ok());
  EXPECT_EQ(allocations - before, 0);
  // It is a field: its stones are holes.
  const Estimate& estimate = segmenter.estimate();
  int doubtful = 0;
  for (int y = 0; y < estimate.mask.height; ++y)
    for (int x = 0; x < estimate.mask.width; ++x)
      doubtful += estimate.mask.plane.row(y)[x] == mask_doubtful;
  EXPECT_GT(doubtful, 1000);
}

TEST(Allocation, NoneWhereAVetoAppears) {
  const test::OwnedFrame frame(PixelFormat::I420, 320, 240, test::drive(320, 240, 0));
  std::vector<std::uint8_t> chequered(160 * 120);
  for (std::size_t i = 0; i < chequered.size(); ++i)
    chequered[i] =
        i < 160 * 100 && (i + i / 160) % 2 ? 255 : 0; // above the window: the paper's would learn finer cells
  const std::array<GrayView, 1> masks{{{{chequered.data(), 160}, 160, 120}}};
  const std::array<Rectangle, 2> rectangles{{{10, 100, 50, 50}, {100, 180, 300, 10}}};
  for (Preset preset : {Preset::paper, Preset::standard}) {
    Segmenter segmenter(Settings::of(preset));
    for (int i = 0; i < 4; ++i)
      ASSERT_TRUE(segmenter.process(frame.frame()).ok());
    const long before = allocations;
    for (int i = 0; i < 4; ++i)
      ASSERT_TRUE(segmenter.process(frame.frame(), {}, {}, {rectangles, masks}).ok());
    EXPECT_EQ(allocations - before, 0) << static_cast<int>(preset);
  }
}

// The rover turns its back to the sun.
TEST(Allocation, NoneWhereTheOwnShadowFalls) {
  const auto painter = [](int shade) {
    return [=](int x, int y) -> test::Components {
      if (y < 80)
        return {230, 150, 100};
      const int grain = (x * 7 + y * 13) % 11;
      return {static_cast<std::uint8_t>(y < shade ? 150 + grain : 60 + grain), 128, 128};
    };
  };
  const test::OwnedFrame lit(PixelFormat::I420, 320, 240, painter(240)),
      shaded(PixelFormat::I420, 320, 240, painter(224)); // of the window's 36 rows 16
  Segmenter segmenter{Settings{}};
  for (int i = 0; i < 4; ++i)
    ASSERT_TRUE(segmenter.process(lit.frame()).ok());
  const long before = allocations;
  for (int i = 0; i < 4; ++i)
    ASSERT_TRUE(segmenter.process(shaded.frame()).ok());
  EXPECT_EQ(allocations - before, 0);
}

} // namespace
} // namespace terrainseg
