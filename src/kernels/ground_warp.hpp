// SPDX-License-Identifier: LGPL-2.1-or-later
// The loops of motion that touch every pixel of a level of 400 to 800 pixels.
#pragma once

#include <cstddef>
#include <cstdint>

namespace terrainseg::kernels {

/// out = clamp(128 + (in - mean over (2 radius + 1)^2) * gain, 1, 255), borders repeated; radius 5 or 6.
/// `work` has 2 * width + 2 * radius elements. 0 is never written: it stands for "outside".
void high_pass(const std::uint8_t* in, std::ptrdiff_t stride, int width, int height, int radius, int gain,
               std::uint8_t* out, std::uint16_t* work);

/// keys[x] = max(keys[x], slope * 16 + rank) where ground[x] is 255; slope = |horizontal| + |vertical|
/// difference over two pixels, at most 255; x in 1..width - 2. `above`, `here`, `under` are three rows of a
/// picture.
void steepest(const std::uint8_t* above, const std::uint8_t* here, const std::uint8_t* under,
              const std::uint8_t* ground, int width, int rank, std::uint16_t* keys);

/// out[i] = mean of the 4 x 4 pixels from column 4 i on, rounded.
void mean_of_quarters(const std::uint8_t* in, std::ptrdiff_t stride, int count, std::uint8_t* out);

/// A picture whose rows follow each other without gaps, with 4 readable bytes after the last.
struct WarpSource {
  const std::uint8_t* pixels;
  int width, height;
};

/// Rows `first`..`end` - 1 of nodes: node k of a row is (u, v) in Q16 of the pixel 16 k; between two nodes of
/// a row positions are linear. `nodes` = segments + 1 pairs a row.
void warp_rows(const WarpSource& source, const std::int32_t* nodes, int segments, int rows, std::uint8_t* out,
               std::ptrdiff_t out_stride);

/// Hypotheses a cell is compared for.
inline constexpr int most_offsets = 16;
/// In place of an offset: not compared, the sum is the greatest there is.
inline constexpr std::int32_t no_offset = INT32_MIN;
inline constexpr std::uint16_t most_difference = 16 * 40;

/// Four cells of 4 x 4 pixels side by side, which have the offsets in common. sums[k * plane + c] = sum over
/// cell c of min(|frame - warped at offsets[k]|, 40); whole[c] = whether no pixel of `warped` at offset 0 is
/// 0.
void compare_cells(const std::uint8_t* frame, std::ptrdiff_t frame_stride, const std::uint8_t* warped,
                   std::ptrdiff_t warped_stride, const std::int32_t* offsets, std::uint16_t* sums,
                   std::ptrdiff_t plane, std::uint8_t* whole);

/// Which hypotheses are what; the first is the ground.
struct HypothesisOrder {
  int first_control, end_control, even_grey, first_standing, end_standing;
};
/// Per cell of a row, over the 3 x 3 cells around it: of the ground, the cheapest control, even grey, the
/// cheapest standing hypothesis and its number from first_standing on (the first of equals).
struct WindowCosts {
  std::uint16_t *ground, *control, *even_grey, *standing, *which;
};
/// Three rows of cells as compare_cells() wrote them, planes of columns + 2 cells, those at both ends beside
/// the picture; sums of nine keep to 16 bits. `work` has 2 * columns + 2 elements.
void window_costs(const std::uint16_t* above, const std::uint16_t* here, const std::uint16_t* under,
                  int columns, std::ptrdiff_t plane, const HypothesisOrder& order, const WindowCosts& out,
                  std::uint16_t* work);

/// Rows of cells without gaps, four numbers each.
struct SumSource {
  const std::int16_t* sums;
  int columns, rows;
};
/// A row of cells taken from where they were, bilinear to a 64th of a cell, times `keep` / 256, rounded.
/// Node k is where the middle of cell 4 k was, in Q8 pixels from the middle of the first cell; positions are
/// linear between two nodes, of which there are columns / 4 + 2. What lies a cell outside is 0.
void moved_sums(const SumSource& source, const std::int32_t* nodes, int columns, int keep, std::int16_t* out);

/// Of the first two of four numbers each (quality, count): evidence[i] = quality * 256 / max(count, 8192),
/// towards 0; |quality| <= 32767.
void evidence_of_sums(const std::int16_t* sums, int count, std::int16_t* evidence);

} // namespace terrainseg::kernels
