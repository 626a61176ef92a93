// SPDX-License-Identifier: LGPL-2.1-or-later
// Compiled once for all unit tests.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <map>
#include <memory>
#include <random>
#include <string>
#include <vector>

#include <gtest/gtest.h>
