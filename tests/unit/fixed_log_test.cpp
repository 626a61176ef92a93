// SPDX-License-Identifier: LGPL-2.1-or-later
#include "base/fixed.hpp"

#include <cmath>

#include <gtest/gtest.h>

namespace terrainseg {
namespace {

TEST(FixedLog, IsTheLogarithmToOneHundredth) {
  for (std::uint64_t x = 1; x < 70000; ++x) {
    const double truth = 256 * std::log2(static_cast<double>(x));
    ASSERT_LE(log2_q8(x), truth + 0.51) << x;
    ASSERT_GT(log2_q8(x), truth - 2.0) << x;
  }
}

TEST(FixedLog, ExactAtPowersOfTwoAndMonotonous) {
  for (int n = 0; n < 64; ++n)
    EXPECT_EQ(log2_q8(std::uint64_t{1} << n), 256 * n);
  for (std::uint64_t x = 1; x < 5000; ++x)
    ASSERT_LE(log2_q8(x), log2_q8(x + 1));
  EXPECT_EQ(log2_q8(0), -256);
  EXPECT_LT(log2_q8(~std::uint64_t{0}), 64 * 256);
}

} // namespace
} // namespace terrainseg
