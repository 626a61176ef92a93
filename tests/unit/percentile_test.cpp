// SPDX-License-Identifier: LGPL-2.1-or-later
#include "base/fixed.hpp"

#include <vector>

#include <gtest/gtest.h>

namespace terrainseg {
namespace {

TEST(Percentile, IsByRank) {
  std::vector<std::uint16_t> v{9, 1, 8, 2, 7, 3, 6, 4, 5, 0};
  EXPECT_EQ(percentile(v, 0), 0);
  EXPECT_EQ(percentile(v, 50), 5);
  EXPECT_EQ(percentile(v, 99), 9);
  std::vector<std::uint16_t> none;
  EXPECT_EQ(percentile(none, 50), 0);
}

} // namespace
} // namespace terrainseg
