// SPDX-License-Identifier: LGPL-2.1-or-later
// An estimate as one line of NDJSON (docs/terrain.schema.json).
#pragma once

#include <cstdint>
#include <string>

#include "terrainseg/estimate.hpp"

namespace terrainseg {

/// Appends one object and a newline. `pts` in nanoseconds, below 0 = null. `with_mask` adds the mask as run
/// lengths.
void append_json_line(std::string& out, const Estimate& estimate, std::int64_t pts, bool with_mask);

} // namespace terrainseg
