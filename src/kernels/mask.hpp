// SPDX-License-Identifier: LGPL-2.1-or-later
// The loop that writes the mask of the default pipeline from two curves.
#pragma once

#include <cstddef>
#include <cstdint>

namespace terrainseg::kernels {

/// Writes rows first..end-1 of a mask of `width` columns: 0 above boundary[x], 128 from there to above
/// safe[x], 255 from safe[x] on; boundary[x] <= safe[x]. Rows count from the mask's top; `mask` points to row
/// 0. `work` has 2 * width bytes. Rows in which all columns are equal are filled without reading the curves.
extern void (*const write_mask_rows)(const std::uint16_t* boundary, const std::uint16_t* safe, int width,
                                     int first, int end, std::uint8_t* mask, std::ptrdiff_t stride,
                                     std::uint8_t* work);

/// Sets the rows first[x] .. end[x] - 1 of each of `width` columns to 255, within the rows first_row ..
/// end_row - 1 of `mask`.
extern void (*const add_mask_stretches)(const std::uint16_t* first, const std::uint16_t* end, int width,
                                        int first_row, int end_row, std::uint8_t* mask,
                                        std::ptrdiff_t stride);

} // namespace terrainseg::kernels
