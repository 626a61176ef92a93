// SPDX-License-Identifier: LGPL-2.1-or-later
#include "base/lattice.hpp"

#include <gtest/gtest.h>

namespace terrainseg {
namespace {

TEST(CellsOfWindow, AreNeverEmpty) {
  EXPECT_EQ(cells_of_window({64, 64, 64, 32}, 4, 20, 12), (Rectangle{4, 4, 4, 2}));
  EXPECT_EQ(cells_of_window({33, 33, 5, 3}, 5, 4, 4), (Rectangle{1, 1, 1, 1}));
  EXPECT_EQ(cells_of_window({127, 127, 1, 1}, 5, 4, 4), (Rectangle{3, 3, 1, 1}));
  EXPECT_EQ(cells_of_window({0, 0, 1, 1}, 6, 1, 1), (Rectangle{0, 0, 1, 1}));
}

} // namespace
} // namespace terrainseg
