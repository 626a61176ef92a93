// SPDX-License-Identifier: LGPL-2.1-or-later
#include "freespace/answer/answer_writer.hpp"

#include <random>

#include <gtest/gtest.h>

#include "base/workers.hpp"

namespace terrainseg {
namespace {

class FreeSpaceMask : public testing::TestWithParam<bool> {};

TEST_P(FreeSpaceMask, HoldsEveryPixelByTheCurves) {
  std::mt19937 dice(3);
  for (const int threads : {1, 3})
    for (const int level : {0, 1, 2, 4}) {
      const int frame_width = 97, frame_height = 61;
      const int width = subsampled(frame_width, level), height = subsampled(frame_height, level);
      FreeSpaceCurves curves;
      curves.level = level;
      for (int x = 0; x < width; ++x) {
        curves.boundary.push_back(static_cast<std::uint16_t>(dice() % (frame_height + 1)));
        curves.safe.push_back(static_cast<std::uint16_t>(curves.boundary[x] +
                                                         dice() % (frame_height + 1 - curves.boundary[x])));
      }
      curves.ground_behind = GetParam();
      for (int x = 0; GetParam() && x < width; ++x) {
        const int first = static_cast<int>(dice() % (curves.boundary[x] + 1)),
                  most = curves.boundary[x] - first;
        curves.behind_first.push_back(static_cast<std::uint16_t>(first));
        curves.behind_end.push_back(static_cast<std::uint16_t>(first + dice() % (most + 1)));
      }
      const std::vector<Rectangle> ignored{{10, 8, 20, 16}, {-5, 40, 9, 100}};
      std::vector<std::uint8_t> mask(static_cast<std::size_t>(width * height), 7);
      Workers workers(threads);
      const std::uint64_t traversable =
          FreeSpace().write(curves, ignored, {mask.data(), width}, height, workers);
      std::uint64_t count = 0;
      for (int y = 0; y < height; ++y)
        for (int x = 0; x < width; ++x) {
          const int px = x << level, py = y << level;
          int want = py >= curves.safe[x] ? 255 : py >= curves.boundary[x] ? 128 : 0;
          if (GetParam() && py >= curves.behind_first[x] && py < curves.behind_end[x])
            want = 255;
          for (const Rectangle& r : ignored)
            if (px >= r.x && px < r.x + r.width && py >= r.y && py < r.y + r.height)
              want = 128;
          ASSERT_EQ(mask[static_cast<std::size_t>(y * width + x)], want) << x << ' ' << y << ' ' << level;
          count += want == 255;
        }
      EXPECT_EQ(traversable, count);
    }
}

INSTANTIATE_TEST_SUITE_P(WithAndWithoutGroundBehind, FreeSpaceMask, testing::Bool());

// Curves that stay together, cross many rows or leave the picture; rows of more bytes than the mask's.
TEST(FreeSpace, WritesMasksOfAllShapes) {
  std::mt19937 dice(5);
  for (int width = 1; width <= 1200; width += width < 40 ? 1 : 300)
    for (const int height : {1, 2, 40, 1100})
      for (const unsigned spread : {1u, 3u, 600u})
        for (const int threads : {1, 2}) {
          FreeSpaceCurves curves;
          const int base = static_cast<int>(dice() % static_cast<unsigned>(height + 1));
          for (int x = 0; x < width; ++x) {
            const auto below = [&](int row) {
              return static_cast<std::uint16_t>(std::min(height, row + static_cast<int>(dice() % spread)));
            };
            curves.boundary.push_back(below(base));
            curves.safe.push_back(below(curves.boundary[x]));
          }
          const int stride = width + width % 3;
          std::vector<std::uint8_t> mask(static_cast<std::size_t>(stride * height), 77);
          Workers workers(threads);
          FreeSpace().write(curves, {}, {mask.data(), stride}, height, workers);
          for (int y = 0; y < height; ++y)
            for (int x = 0; x < stride; ++x) {
              const int want = x >= width                ? 77
                               : y >= curves.safe[x]     ? 255
                               : y >= curves.boundary[x] ? 128
                                                         : 0;
              ASSERT_EQ(mask[static_cast<std::size_t>(y * stride + x)], want)
                  << width << 'x' << height << " at " << x << ' ' << y;
            }
        }
}

std::vector<std::uint16_t> reached(const FrameCurve& safe) {
  std::vector<std::uint16_t> out(safe.size());
  reachable_rows(safe, 0, {4, 80, 3, 10}, 100, out);
  return out;
}

TEST(FreeSpace, ReachableUntilTheFirstBreak) {
  EXPECT_EQ(reached({10, 20, 30, 40, 50, 60, 70, 80, 89, 10}),
            (std::vector<std::uint16_t>{10, 20, 30, 40, 50, 60, 70, 80, 89, 10}));
  // Column 2 is closed down to the window's bottom edge: what lies behind it cannot be reached.
  EXPECT_EQ(reached({10, 20, 90, 40, 50, 60, 70, 100, 10, 10}),
            (std::vector<std::uint16_t>{100, 100, 100, 40, 50, 60, 70, 100, 100, 100}));
}

TEST(FreeSpace, AWindowThatIsBlockedLetsOnlyItsOpenColumnsThrough) {
  EXPECT_EQ(reached({10, 10, 10, 10, 95, 60, 95, 10, 10, 10}),
            (std::vector<std::uint16_t>{100, 100, 100, 100, 100, 60, 100, 100, 100, 100}));
  EXPECT_EQ(reached(FrameCurve(10, 100)), std::vector<std::uint16_t>(10, 100));
}

} // namespace
} // namespace terrainseg
