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

} // namespace
} // namespace terrainseg
