// SPDX-License-Identifier: LGPL-2.1-or-later
// The loops of motion over all pixels of its level, which is 400 to 800 pixels wide.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "kernels/point_fit.hpp"

namespace terrainseg::kernels {

/// out = clamp(128 + (in - mean over (2 radius + 1)^2) * gain, 1, 255), borders repeated; radius 5 or 8. The
/// mean is rounded down, by at most 1.2. `work` has 3 * (width + 2 * radius) elements. Never writes 0, which
/// means "outside".
extern void (*const high_pass)(const std::uint8_t* in, std::ptrdiff_t stride, int width, int height,
                               int radius, int gain, std::uint8_t* out, std::uint16_t* work);

/// keys[x] = max(keys[x], slope * 16 + rank) where ground[x] is 255; slope = |horizontal| + |vertical|
/// difference over two pixels, at most 255; x in 1..width - 2. `above`, `here`, `under` are three rows of a
/// picture.
extern void (*const steepest)(const std::uint8_t* above, const std::uint8_t* here, const std::uint8_t* under,
                              const std::uint8_t* ground, int width, int rank, std::uint16_t* keys);

/// out[i] = mean of the 4 x 4 pixels from column 4 i on, rounded.
extern void (*const mean_of_quarters)(const std::uint8_t* in, std::ptrdiff_t stride, int count,
                                      std::uint8_t* out);

/// Rows `first`..`end` - 1 of nodes. Node k of a row is the position (u, v), Q16, of pixel 16 k; positions
/// are linear between two nodes. `nodes` has segments + 1 pairs per row.
extern void (*const warp_rows)(const Picture& source, const std::int32_t* nodes, int segments, int rows,
                               std::uint8_t* out, std::ptrdiff_t out_stride);

/// Largest number of hypotheses per cell.
inline constexpr int most_offsets = 16;
/// An offset that is not compared: its sum is the largest possible.
inline constexpr std::int32_t no_offset = INT32_MIN;
inline constexpr std::uint16_t most_difference = 16 * 40;

/// Where a hypothesis puts a pixel: `along` and `aside` are halves of a pixel along the ground's translation
/// and across it, for translations of at least `least_reach`.
struct HypothesisShifts {
  std::array<std::int32_t, most_offsets> along, aside, least_reach;
};
/// The offsets of all hypotheses in a picture with `stride` bytes a row, for a unit vector (x, y) in Q14:
/// no_offset for rows above -`above` or below `below`, and for hypotheses that need more reach.
extern void (*const place_hypotheses)(const HypothesisShifts& shifts, int x, int y, int reach, int above,
                                      int below, int stride, std::int32_t* offsets);

/// Compares four neighbouring cells of 4 x 4 pixels at the same offsets. sums[k * plane + c] = sum over cell
/// c of min(|frame - warped at offsets[k]|, 40). whole[c] = whether no pixel of `warped` at offset 0 is 0.
extern void (*const compare_cells)(const std::uint8_t* frame, std::ptrdiff_t frame_stride,
                                   const std::uint8_t* warped, std::ptrdiff_t warped_stride,
                                   const std::int32_t* offsets, std::uint16_t* sums, std::ptrdiff_t plane,
                                   std::uint8_t* whole);

/// Order of the hypotheses; the first one is the ground.
struct HypothesisOrder {
  int first_control, end_control, even_grey, first_standing, end_standing;
};
/// Costs per cell of a row, over the 3 x 3 cells around it: of the ground, of the best control, of uniform
/// grey, and of the best standing hypothesis, with its number from first_standing on (the first of equals).
struct WindowCosts {
  std::uint16_t *ground, *control, *even_grey, *standing, *which;
};
/// Adds three rows of cells that compare_cells() has written. A plane has columns + 2 cells; the first and
/// the last one are outside the picture. Sums of nine cells fit 16 bits. `work` has columns + 2 elements.
extern void (*const window_costs)(const std::uint16_t* above, const std::uint16_t* here,
                                  const std::uint16_t* under, int columns, std::ptrdiff_t plane,
                                  const HypothesisOrder& order, const WindowCosts& out, std::uint16_t* work);

/// Cells without padding between rows, four numbers each.
struct SumSource {
  const std::int16_t* sums;
  int columns, rows;
};
/// Reads a row of cells from their earlier positions, bilinear in 1/64 of a cell, times `keep` / 256,
/// rounded. Node k is the earlier position of the centre of cell 4 k, in Q8 pixels from the centre of the
/// first cell. Positions are linear between two of the columns / 4 + 2 nodes. Cells more than one cell
/// outside are 0.
extern void (*const moved_sums)(const SumSource& source, const std::int32_t* nodes, int columns, int keep,
                                std::int16_t* out);

/// From the first two of each four numbers (quality, count): evidence[i] = quality * 256 / max(count, 8192),
/// rounded towards 0; |quality| <= 32767.
extern void (*const evidence_of_sums)(const std::int16_t* sums, int count, std::int16_t* evidence);

} // namespace terrainseg::kernels
