// SPDX-License-Identifier: LGPL-2.1-or-later
// Loops of the octave pyramid: the 1-4-6-4-1 reduction of the paper's equations (1) and (2), one row at a
// time. A row of the finer level is read once; its contributions to rows that are not finished are in
// `Waiting`.
//
// No function reads or writes past the ends of a row, whatever its length and alignment. All vector variants
// and the plain one give the same bits.
#pragma once

#include <cstddef>
#include <cstdint>

namespace terrainseg::kernels {

/// Number of interleaved bytes per pixel in a row. `three` is read as three and written as four; the fourth
/// is 0.
enum class Interleave : std::uint8_t { one = 1, two = 2, three = 3, four = 4 };

/// Number of bytes of a written pixel.
constexpr int written_step(Interleave i) {
  return i == Interleave::three ? 4 : static_cast<int>(i);
}

/// The row or pixel that is read at `i`, which may lie beyond the `size` rows or pixels: reflected at the
/// first and the last one (reflect-101).
constexpr int reflect_101(int i, int size) {
  if (size == 1)
    return 0;
  while (i < 0 || i >= size)
    i = i < 0 ? -i : 2 * size - 2 - i;
  return i;
}

/// The unfinished sums of one level, one element per written byte.
struct Waiting {
  std::uint16_t* partial = nullptr; ///< h[2y-2] + 4 h[2y-1] + 6 h[2y] of the next row y
  std::uint16_t* held = nullptr;    ///< h[2y]; h is the horizontal sum of a finer row
};

/// Takes the finer rows 2y+1 (`odd`) and 2y+2 (`even`) of `width` pixels and finishes row y: ceil(width / 2)
/// pixels of (s + 128) >> 8 with reflect-101 borders. To start at row y, pass (any, 2y-2) and (2y-1, 2y) and
/// ignore the output. `ahead`: bytes from these rows to the next ones, which are prefetched; 0 = they are in
/// the cache. The next rows need not exist.
extern void (*const reduce_pair)(Interleave interleave, const std::uint8_t* odd, const std::uint8_t* even,
                                 int width, std::ptrdiff_t ahead, const Waiting& waiting, std::uint8_t* out);

/// Reduces one row in the horizontal direction only: (s + 8) >> 4, `ahead` as above.
extern void (*const reduce_horizontally)(Interleave interleave, const std::uint8_t* row, int width,
                                         std::ptrdiff_t ahead, std::uint8_t* out);

/// reduce_pair() in the vertical direction only, for `bytes` bytes: (s + 8) >> 4.
extern void (*const reduce_pair_vertically)(const std::uint8_t* odd, const std::uint8_t* even, int bytes,
                                            const Waiting& waiting, std::uint8_t* out);

/// Splits a row of packed 4:2:2 of `width` pixels into luma and interleaved chroma (2 * ceil(width / 2)
/// bytes, in the order of the row), `ahead` as above. `luma_first`: YUY2 and YVYU rather than UYVY and VYUY.
/// The row holds 4 * ceil(width / 2) bytes.
extern void (*const split_422)(const std::uint8_t* row, int width, bool luma_first, std::ptrdiff_t ahead,
                               std::uint8_t* luma, std::uint8_t* chroma);

/// The upper 8 bits of `count` samples of two bytes, the lower first: (sample >> shift) & 255, `ahead` as
/// above. shift is 0..8.
extern void (*const narrow)(const std::uint8_t* row, int shift, int count, std::ptrdiff_t ahead,
                            std::uint8_t* out);

/// A component at full width: sample offset + step * (x >> shift) of the row for every x below `width`. step
/// is 1..4, shift 0 or 1.
extern void (*const spread)(const std::uint8_t* row, int offset, int step, int shift, int width,
                            std::uint8_t* out);

} // namespace terrainseg::kernels
