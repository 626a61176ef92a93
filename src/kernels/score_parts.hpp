// SPDX-License-Identifier: LGPL-2.1-or-later
// The score of every pixel without a colour table: with 16 or 32 bins a component, the three small tables of
// a model fit vector registers, and looking 16 to 64 pixels up takes one or two byte shuffles.
#pragma once

#include "kernels/score_table.hpp"

namespace terrainseg::kernels {

/// True where classify_row_by_parts() beats classify_row(): with vectors, for bit shifts 3 to 7.
bool parts_are_faster(int bit_shift);

/// The bits of classify_row() with the table of `scores`, straight from `scores`: 255 where score_of() <=
/// score_limit, else 0; returns how many are 255. `scores.bit_shift` is 3..7.
std::uint32_t classify_row_by_parts(const PixelRow& row, const ComponentScores& scores, std::uint8_t* out,
                                    int width);

} // namespace terrainseg::kernels
