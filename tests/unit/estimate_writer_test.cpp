// SPDX-License-Identifier: LGPL-2.1-or-later
#include "base/estimate_writer.hpp"

#include <algorithm>
#include <array>

#include <gtest/gtest.h>

namespace terrainseg {
namespace {

TEST(FreePermilleAhead, CountsTheWindowsColumns) {
  const std::vector<std::uint16_t> boundary{0, 0, 50, 40, 41, 100, 0, 0};
  EXPECT_EQ(free_permille_ahead(boundary, 0, {2, 56, 4, 8}, 16), 250); // of 50, 40, 41, 100 only 40 is free
  EXPECT_EQ(free_permille_ahead(boundary, 0, {2, 66, 4, 8}, 16), 750);
  EXPECT_EQ(free_permille_ahead(boundary, 1, {12, 66, 4, 8}, 16), 1000);
  EXPECT_EQ(free_permille_ahead(boundary, 3, {9, 66, 1, 8}, 16), 1000); // narrower than a mask column
}

struct Started {
  Settings settings;
  EstimateWriter writer;
  explicit Started(int mask_level = 0, const MaskTarget& target = {}) {
    settings.mask_level = mask_level;
    Frame frame;
    frame.width = 41;
    frame.height = 30;
    writer.start(frame, target, settings, {10, 20, 16, 10}, 7);
  }
};

TEST(EstimateWriter, StartsWithTheFrameAndNothingKnown) {
  Started s(2);
  const Estimate& e = s.writer.estimate();
  EXPECT_EQ(e.frame, 7u);
  EXPECT_EQ(e.frame_width, 41);
  EXPECT_EQ(e.mask.width, 11);
  EXPECT_EQ(e.mask.height, 8);
  EXPECT_EQ(e.mask_region, (Rectangle{0, 0, 41, 30}));
  EXPECT_EQ(e.window, (Rectangle{10, 20, 16, 10}));
  EXPECT_EQ(e.flags, flag_unknown);
  ASSERT_EQ(e.boundary.size(), 11u);
  for (const std::uint16_t row : e.boundary)
    EXPECT_EQ(row, 30);
}

TEST(EstimateWriter, WritesIntoATargetAndNotBesideIt) {
  std::array<std::uint8_t, 50 * 30> memory;
  memory.fill(9);
  Started s(0, {{memory.data(), 50}, 41, 30});
  s.writer.estimate().flags = flag_frozen;
  s.writer.label_unknown();
  EXPECT_EQ(s.writer.estimate().flags, flag_frozen | flag_unknown | flag_blocked);
  for (int y = 0; y < 30; ++y)
    for (int x = 0; x < 50; ++x)
      ASSERT_EQ(memory[static_cast<std::size_t>(y * 50 + x)], x < 41 ? 128 : 9);
}

TEST(EstimateWriter, TellsWhatIsFreeAndWhetherTheWayIsBlocked) {
  Started s;
  s.writer.estimate().flags = flag_learned;
  s.settings.blocked_below = 500;
  // Free for four rows ahead of the window (row 20) means a boundary of 16 or less; 8 of its 16 columns are.
  std::fill_n(s.writer.boundary().begin() + 10, 8, std::uint16_t{16});
  std::fill_n(s.writer.boundary().begin() + 18, 8, std::uint16_t{17});
  s.writer.tell_free_space(123, s.settings, 2);
  EXPECT_EQ(s.writer.estimate().traversable_permille, 100); // of 1230
  EXPECT_EQ(s.writer.estimate().flags, flag_learned);
  s.settings.blocked_below = 501;
  s.writer.tell_free_space(123, s.settings, 2);
  EXPECT_EQ(s.writer.estimate().flags, flag_learned | flag_blocked);
}

TEST(EstimateWriter, ModelsAreToldInTheOrderTheyCome) {
  Started s;
  const ColorSpace full{false, {ColorRange::full, ColorMatrix::bt601}};
  s.writer.add_model({{100 << 8, 128 << 8, 128 << 8}, {256, 256, 256}, 5 << 8}, full);
  s.writer.add_model({{200 << 8, 128 << 8, 128 << 8}, {256, 256, 256}, 3}, full);
  const Estimate& e = s.writer.estimate();
  ASSERT_EQ(e.model_count, 2);
  EXPECT_EQ(e.models[0].mass, 5u);
  EXPECT_EQ(e.models[1].mass, 1u) << "a model that is there weighs something";
  EXPECT_EQ(e.models[0].rgb, (std::array<std::uint8_t, 3>{100, 100, 100}));
  EXPECT_EQ(e.models[1].rgb, (std::array<std::uint8_t, 3>{200, 200, 200}));
}

} // namespace
} // namespace terrainseg
