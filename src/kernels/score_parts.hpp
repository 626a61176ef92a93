// SPDX-License-Identifier: LGPL-2.1-or-later
// The score of every pixel without a colour table: with 16 or 32 bins per component, the three small tables
// of a model fit vector registers, and one or two byte shuffles look up 16 to 64 pixels.
#pragma once

#include "kernels/score_table.hpp"

namespace terrainseg::kernels {

/// True when classify_row_by_parts() is faster than classify_row(): with vectors, for bit shifts 3 to 7.
bool parts_are_faster(int bit_shift);

/// Same result as classify_row() with the table of `scores`: 255 where score_of() <= score_limit, otherwise
/// 0. Returns how many are 255. `scores.bit_shift` is 3..7.
std::uint32_t classify_row_by_parts(const PixelRow& row, const ComponentScores& scores, std::uint8_t* out,
                                    int width);

} // namespace terrainseg::kernels
