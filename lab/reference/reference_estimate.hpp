// SPDX-License-Identifier: LGPL-2.1-or-later
// What the reference engine knows in the words of the filter, so that both can be drawn, sent and scored
// alike.
#pragma once

#include <cstdint>
#include <vector>

#include "lab/reference/reference_engine.hpp"
#include "terrainseg/estimate.hpp"

namespace terrainseg::reference {

/// Fills every field that the unmodified algorithm has an answer for; it has none for the horizon, and its
/// confidence is the share of the training pixels that it labels terrain. `boundary` holds the rows that the
/// estimate points to, and estimate.mask points into `result`: both must outlive it. `blocked_below` as in
/// Settings.
Estimate describe(const ReferenceResult& result, std::uint64_t frame, std::uint32_t generation,
                  int blocked_below, std::vector<std::uint16_t>& boundary);

} // namespace terrainseg::reference
