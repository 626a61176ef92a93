// SPDX-License-Identifier: LGPL-2.1-or-later
// Compiled once for all unit tests.
#include <algorithm>
#include <array>
#include <cstdint>
#include <random>
#include <string>
#include <vector>

#include <gtest/gtest.h>
