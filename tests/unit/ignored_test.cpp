// SPDX-License-Identifier: LGPL-2.1-or-later
#include "coarse/grid.hpp"

#include <array>
#include <random>
#include <vector>

#include <gtest/gtest.h>

#include "terrainseg/estimate.hpp"

namespace terrainseg {
namespace {

TEST(MarkIgnored, CountsEachPixelOnce) {
  std::vector<std::uint8_t> mask(10 * 8, mask_traversable);
  const std::array<Rectangle, 3> ignored{{{0, 0, 8, 8}, {4, 4, 8, 8}, {-4, -4, 2, 2}}};
  // Level 1: pixels 0..7 are columns 0..3, 4..11 are 2..5.
  EXPECT_EQ(mark_ignored(ignored, 1, {mask.data(), 10}, 10, 8), 16u + 16 - 4);
  EXPECT_EQ(mask[0], mask_doubtful);
  EXPECT_EQ(mask[3], mask_doubtful);
  EXPECT_EQ(mask[4], mask_traversable);
  EXPECT_EQ(mask[5 * 10 + 5], mask_doubtful);
  EXPECT_EQ(mask[5 * 10 + 6], mask_traversable);
}

TEST(FillIgnored, TakesTheCellsWhoseCentresAreCovered) {
  // Level 2, 4 x 3 cells: the region's pixels 3..9 hold the centres 4 and 8, its rows 5..8 only 8.
  const std::array<Rectangle, 1> ignored{{{3, 5, 7, 4}}};
  std::vector<std::uint8_t> cells(12, 5);
  fill_ignored(ignored, 2, 4, 3, 1, cells.data());
  EXPECT_EQ(cells, (std::vector<std::uint8_t>{5, 5, 5, 5, 5, 5, 5, 5, 5, 1, 1, 5}));
}

/// The vetoed pixels of a frame, one by one and with fractions: a mask pixel touches a pixel of the frame
/// when the two have more than an edge in common.
std::vector<bool> vetoed_pixels(const Veto& veto, int width, int height) {
  std::vector<bool> pixels(static_cast<std::size_t>(width) * static_cast<std::size_t>(height));
  const auto touch = [](int a, int count_a, int b, int count_b) {
    const double first_a = static_cast<double>(a) / count_a, end_a = static_cast<double>(a + 1) / count_a,
                 first_b = static_cast<double>(b) / count_b, end_b = static_cast<double>(b + 1) / count_b;
    return std::min(end_a, end_b) - std::max(first_a, first_b) > 1e-9;
  };
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x) {
      bool any = false;
      for (const Rectangle& r : veto.rectangles)
        any |= x >= r.x && x < r.x + r.width && y >= r.y && y < r.y + r.height;
      for (const GrayView& mask : veto.masks)
        for (int v = 0; v < mask.height && !any; ++v)
          for (int u = 0; u < mask.width && !any; ++u)
            any = mask.plane.row(v)[u] >= 128 && touch(u, mask.width, x, width) &&
                  touch(v, mask.height, y, height);
      pixels[static_cast<std::size_t>(y * width + x)] = any;
    }
  return pixels;
}

/// Some vetoes for a frame of 53 x 38: sparse and dense masks of other sizes with padded rows, rectangles of
/// which some leave the frame.
template <typename Use> void with_vetoes(Use use) {
  std::mt19937 random(7);
  const auto below = [&](int limit) { return static_cast<int>(random() % static_cast<unsigned>(limit)); };
  for (int round = 0; round < 60; ++round) {
    std::vector<std::vector<std::uint8_t>> bytes;
    std::vector<GrayView> masks;
    std::vector<Rectangle> rectangles;
    for (int i = below(3); i > 0; --i) {
      const int width = 1 + below(90), height = 1 + below(60), stride = width + below(9),
                share = 1 + below(80);
      bytes.emplace_back(static_cast<std::size_t>(stride * height));
      for (std::uint8_t& byte : bytes.back())
        byte = static_cast<std::uint8_t>(below(share) ? below(128) : 128 + below(128));
      masks.push_back({{bytes.back().data(), stride}, width, height});
    }
    for (int i = below(4); i > 0; --i)
      rectangles.push_back({below(70) - 10, below(50) - 10, below(20) - 2, below(20) - 2});
    use(Veto{rectangles, masks});
  }
}

TEST(VetoArea, MarksEveryMaskPixelThatCoversAVetoedOne) {
  constexpr int width = 53, height = 38;
  with_vetoes([&](const Veto& veto) {
    const std::vector<bool> vetoed = vetoed_pixels(veto, width, height);
    const VetoArea area(veto, width, height);
    for (int level : {0, 1, 3}) {
      const int columns = subsampled(width, level), rows = subsampled(height, level);
      std::vector<std::uint8_t> mask(static_cast<std::size_t>(columns * rows));
      for (std::size_t i = 0; i < mask.size(); ++i)
        mask[i] = i % 3 ? mask_traversable : mask_doubtful;
      std::vector<std::uint8_t> expected = mask;
      std::vector<std::uint16_t> curve(static_cast<std::size_t>(columns), 9), lowered = curve;
      std::uint64_t turned = 0;
      for (int y = 0; y < height; ++y)
        for (int x = 0; x < width; ++x)
          if (vetoed[static_cast<std::size_t>(y * width + x)]) {
            std::uint8_t& pixel = expected[static_cast<std::size_t>((y >> level) * columns + (x >> level))];
            turned += pixel == mask_traversable;
            pixel = mask_not_traversable;
            std::uint16_t& row = lowered[static_cast<std::size_t>(x >> level)];
            row = std::max(row, static_cast<std::uint16_t>(y + 1));
          }
      EXPECT_EQ(area.mark(level, {mask.data(), columns}, columns, rows), turned);
      EXPECT_EQ(mask, expected) << level;
      area.lower(level, curve);
      EXPECT_EQ(curve, lowered) << level;
    }
  });
}

TEST(VetoArea, TakesTheCellsThatAVetoedPixelIsNearestTo) {
  constexpr int width = 53, height = 38;
  with_vetoes([&](const Veto& veto) {
    const std::vector<bool> vetoed = vetoed_pixels(veto, width, height);
    const VetoArea area(veto, width, height);
    for (int level : {0, 2, 4}) {
      const int columns = subsampled(width, level), rows = subsampled(height, level);
      // The nearest centre, of two equally near ones the later.
      const auto nearest = [level](int pixel, int count) {
        int best = 0;
        for (int cell = 1; cell < count; ++cell)
          if (std::abs((cell << level) - pixel) <= std::abs((best << level) - pixel))
            best = cell;
        return best;
      };
      std::vector<std::uint8_t> expected(static_cast<std::size_t>(columns * rows), 5);
      for (int y = 0; y < height; ++y)
        for (int x = 0; x < width; ++x)
          if (vetoed[static_cast<std::size_t>(y * width + x)])
            expected[static_cast<std::size_t>(nearest(y, rows) * columns + nearest(x, columns))] = 1;
      std::vector<std::uint8_t> cells(expected.size(), 5), asked = cells;
      area.fill_cells(level, columns, rows, 1, cells.data());
      EXPECT_EQ(cells, expected) << level;
      for (int y = 0; y < rows; ++y)
        for (int x = 0; x < columns; ++x)
          if (area.touches_cell(level, x, y))
            asked[static_cast<std::size_t>(y * columns + x)] = 1;
      EXPECT_EQ(asked, expected) << level;
    }
  });
}

} // namespace
} // namespace terrainseg
