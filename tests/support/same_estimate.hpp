// SPDX-License-Identifier: LGPL-2.1-or-later
// What has to be the same when an estimate comes back from where it was sent.
#pragma once

#include <algorithm>
#include <cstdint>
#include <vector>

#include <gtest/gtest.h>

#include "terrainseg/estimate.hpp"

namespace terrainseg::test {

/// The pixels of a mask, row by row, without what lies between the rows.
inline std::vector<std::uint8_t> packed(const GrayView& m) {
  std::vector<std::uint8_t> pixels;
  for (int y = 0; y < m.height; ++y)
    pixels.insert(pixels.end(), m.plane.row(y), m.plane.row(y) + m.width);
  return pixels;
}

/// All but mask, boundary, and the colours of the models, which the metadata does not hold.
inline void expect_same_numbers(const Estimate& a, const Estimate& b) {
  EXPECT_EQ(a.frame, b.frame);
  EXPECT_EQ(a.frame_width, b.frame_width);
  EXPECT_EQ(a.frame_height, b.frame_height);
  EXPECT_EQ(a.horizon_row, b.horizon_row);
  EXPECT_EQ(a.horizon_confidence, b.horizon_confidence);
  EXPECT_EQ(a.mask_region, b.mask_region);
  EXPECT_EQ(a.confidence, b.confidence);
  EXPECT_EQ(a.traversable_permille, b.traversable_permille);
  EXPECT_EQ(a.window, b.window);
  EXPECT_EQ(a.model_generation, b.model_generation);
  EXPECT_EQ(a.flags, b.flags);
  ASSERT_EQ(a.model_count, b.model_count);
  for (std::size_t i = 0; i < static_cast<std::size_t>(a.model_count); ++i) {
    EXPECT_EQ(a.models[i].mean, b.models[i].mean);
    EXPECT_EQ(a.models[i].variance, b.models[i].variance);
    EXPECT_EQ(a.models[i].mass, b.models[i].mass);
  }
}

inline void expect_same(const Estimate& a, const Estimate& b) {
  expect_same_numbers(a, b);
  EXPECT_EQ(packed(a.mask), packed(b.mask));
  EXPECT_TRUE(std::ranges::equal(a.boundary, b.boundary));
}

} // namespace terrainseg::test
