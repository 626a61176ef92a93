// SPDX-License-Identifier: LGPL-2.1-or-later
// An estimate as one line of NDJSON (docs/terrain.schema.json).
//
// `boundary` has one number per mask column: the row as a fraction of the frame height with four decimals,
// `1` where there is none. Four decimals identify every row of a frame of up to 9999 rows (round (fraction *
// height)). A column takes at most 7 bytes: a line has 14 kB at 1920 columns, and 3.5 kB with mask-level=2.
//
// The mask's `runs` is a flat list value, length, value, length, ... in raster order. A run may continue in
// the next row; the lengths add up to width * height. In numpy: repeat (runs[0::2], runs[1::2]).reshape (h,
// w).
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "exchange/metric_estimate.hpp"
#include "terrainseg/estimate.hpp"

namespace terrainseg {

/// Members that a line has only if they are known.
struct LineExtras {
  const MetricEstimate* metric = nullptr; ///< member `metric`
  std::optional<std::uint64_t> utc; ///< member `utc`: nanoseconds since 1970, written to the microsecond
};

/// Appends one object and a newline. `pts` is in nanoseconds; negative values are written as null.
/// `with_mask` adds the mask as run lengths.
void append_json_line(std::string& out, const Estimate& estimate, std::int64_t pts, bool with_mask,
                      const LineExtras& extras = {});

/// Formats nanoseconds since 1970, below 2^63, as `2026-11-21T20:00:00.123456Z`.
std::string utc_text(std::uint64_t nanoseconds);

} // namespace terrainseg
