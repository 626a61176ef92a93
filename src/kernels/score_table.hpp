// SPDX-License-Identifier: LGPL-2.1-or-later
// Colour to "traversable": squared distances by component, the table over the shifted colour space, and the
// loop that looks every pixel up in it.
#pragma once

#include <cstddef>
#include <cstdint>

namespace terrainseg::kernels {

inline constexpr int most_models = 8;

/// The squared Mahalanobis distance of a colour to a model is a sum over the components, so three small
/// tables a model hold it. Entries are scaled: a sum of `score_limit` is the threshold; 255 saturates.
inline constexpr int score_limit = 240;

struct ComponentScores {
  int models = 0;
  int bit_shift = 0; ///< 256 >> bit_shift entries a component
  alignas(64) std::uint8_t entries[most_models][3][256];
};

/// Smallest saturated sum over the models; 255 without a model.
std::uint8_t score_of(const ComponentScores& scores, std::uint8_t first, std::uint8_t second,
                      std::uint8_t third);

/// Bytes of a colour table: 2^(3 * (8 - bit_shift)). A colour's index is its shifted components, first to
/// third, from high bits to low.
constexpr std::size_t color_table_size(int bit_shift) {
  return std::size_t{1} << (3 * (8 - bit_shift));
}
/// Rows of a colour table: one for each pair of first and second component.
constexpr std::size_t color_table_rows(int bit_shift) {
  return std::size_t{1} << (2 * (8 - bit_shift));
}

/// Sets table[colour] to 255 where score_of() <= score_limit, to 0 elsewhere. `used` has one byte a row and
/// tells which rows hold a 255: only those are cleared first. Both are zero before the first call.
void fill_color_table(const ComponentScores& scores, std::uint8_t* table, std::uint8_t* used);

/// A row of pixels as it lies in memory. The second and third component share step and subsampling.
struct PixelRow {
  const std::uint8_t* component[3];
  int first_step;   ///< bytes between samples of the first component
  int chroma_step;  ///< bytes between samples of the others
  int chroma_shift; ///< log2 of their horizontal subsampling, 0 or 1
};

/// out[x] = table[colour of pixel x]; returns how many are 255.
std::uint32_t classify_row(const PixelRow& row, const std::uint8_t* table, int bit_shift, std::uint8_t* out,
                           int width);

} // namespace terrainseg::kernels
