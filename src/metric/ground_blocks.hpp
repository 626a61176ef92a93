// SPDX-License-Identifier: LGPL-2.1-or-later
// From rays to ranges and bearings, many columns at once: compiled for each of Highway's targets, with the
// same result on all.
#pragma once

#include <cstddef>

#include "metric/mount.hpp"

namespace terrainseg::metric {

/// Columns that are measured at once. They share one arc tangent.
inline constexpr std::size_t block_columns = 64;

/// The rays (x, y, 1) through the ends of neighbouring columns, NaN where the lens has none. The last ray is
/// repeated to fill the block.
struct RayBlock {
  double x[block_columns], y[block_columns];
  float beyond[block_columns]; ///< what stands for a range beyond range_max: +infinity, or NaN
};

/// As RangeColumns.
struct RangeBlock {
  float ranges[block_columns], bearings[block_columns], low[block_columns], high[block_columns];
};

/// `grounds`: as the camera stands, and pitched by one standard deviation down and up; `columns` of the block
/// are asked for, at least one.
extern void (*const measure)(const RayBlock& rays, std::size_t columns, const GroundProjection (&grounds)[3],
                             double range_max, RangeBlock& block);

} // namespace terrainseg::metric
