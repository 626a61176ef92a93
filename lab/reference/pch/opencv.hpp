// SPDX-License-Identifier: LGPL-2.1-or-later
// Compiled once for all sources of the reference; without it (-Db_pch=false) every source has what it needs.
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
