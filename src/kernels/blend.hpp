// SPDX-License-Identifier: LGPL-2.1-or-later
// The loops of the overlay: blend samples with a colour in place, with a coverage of 0..256 per pixel:
// (sample * (256 - coverage) + ink * coverage + 128) >> 8.
#pragma once

#include <array>
#include <cstdint>

namespace terrainseg::kernels {

using Coverage = std::uint16_t;

/// Coverage of mask values: `full` from 192 on, `half` from 64 on, otherwise 0.
extern void (*const cover_mask)(const std::uint8_t* mask, int count, Coverage full, Coverage half,
                                Coverage* out);

/// Returns false when all values are 0.
extern bool (*const covers)(const Coverage* coverage, int count);

/// Mean coverage of the pixels that share a chroma sample: two neighbours in one row, or four in two rows
/// (`bottom` not null). A last pixel without a neighbour counts alone. Writes ceil(pixels / 2) values.
extern void (*const pool_coverage)(const Coverage* top, const Coverage* bottom, int pixels, Coverage* out);

/// One byte a pixel.
extern void (*const blend_plane)(std::uint8_t* samples, const Coverage* coverage, int count,
                                 std::uint8_t ink);

/// Two bytes a pixel (interleaved chroma).
extern void (*const blend_pairs)(std::uint8_t* samples, const Coverage* coverage, int count,
                                 const std::array<std::uint8_t, 2>& ink);

/// Samples of two bytes, little-endian, with `shift` unused lower bits (0..8), which are set to 0: one per
/// pixel, and two per pixel (interleaved chroma). `ink` is a value without the unused bits.
extern void (*const blend_words)(std::uint8_t* samples, const Coverage* coverage, int count, int shift,
                                 std::uint16_t ink);
extern void (*const blend_word_pairs)(std::uint8_t* samples, const Coverage* coverage, int count, int shift,
                                      const std::array<std::uint16_t, 2>& ink);

/// Three bytes a pixel.
extern void (*const blend_triples)(std::uint8_t* samples, const Coverage* coverage, int count,
                                   const std::array<std::uint8_t, 3>& ink);

/// Four bytes per pixel; the one at `untouched` is not changed.
extern void (*const blend_quads)(std::uint8_t* samples, const Coverage* coverage, int count,
                                 const std::array<std::uint8_t, 4>& ink, int untouched);

/// Packed 4:2:2 from an even pixel on: luma is the first byte of each pixel (YUY2) or the second (UYVY).
/// `ink` is luma and the two chroma bytes in the order of the row. Chroma is blended with the mean coverage
/// of its pixels.
extern void (*const blend_422)(std::uint8_t* samples, const Coverage* coverage, int count,
                               const std::array<std::uint8_t, 3>& ink, bool luma_first);

} // namespace terrainseg::kernels
