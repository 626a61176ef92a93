// SPDX-License-Identifier: LGPL-2.1-or-later
// Compiled once for all sources of a library; without it (-Db_pch=false) every source has what it needs.
#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <limits>
#include <memory>
#include <numeric>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>
