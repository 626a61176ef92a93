// SPDX-License-Identifier: LGPL-2.1-or-later
// Classification of colours as traversable: squared distances by component, the table over the shifted colour
// space, and the loop that looks up every pixel.
#pragma once

#include <cstddef>
#include <cstdint>

namespace terrainseg::kernels {

inline constexpr int most_models = 8;

/// Squared Mahalanobis distances of colours to models, as three small tables per model, because the distance
/// is a sum over the components. Entries are scaled: a sum of `score_limit` is the threshold; they saturate
/// at 255.
inline constexpr int score_limit = 240;

struct ComponentScores {
  int models = 0;
  int bit_shift = 0; ///< 256 >> bit_shift entries per component
  alignas(64) std::uint8_t entries[most_models][3][256];
};

/// The smallest saturated sum of all models; 255 without models.
std::uint8_t score_of(const ComponentScores& scores, std::uint8_t first, std::uint8_t second,
                      std::uint8_t third);

/// Size of a colour table in bytes: 2^(3 * (8 - bit_shift)). The index of a colour consists of its shifted
/// components; the first one is in the highest bits.
constexpr std::size_t color_table_size(int bit_shift) {
  return std::size_t{1} << (3 * (8 - bit_shift));
}
/// Number of rows of a colour table: one for each pair of first and second component.
constexpr std::size_t color_table_rows(int bit_shift) {
  return std::size_t{1} << (2 * (8 - bit_shift));
}

/// Sets table[colour] to 255 where score_of() <= score_limit, otherwise to 0. `used` has one byte per row: 1
/// when the row has a 255, so that only such rows are cleared. Both are zero before the first call.
void fill_color_table(const ComponentScores& scores, std::uint8_t* table, std::uint8_t* used);

/// A row of pixels in memory. The second and third component have the same step and subsampling.
struct PixelRow {
  const std::uint8_t* component[3];
  int first_step;   ///< bytes between samples of the first component
  int chroma_step;  ///< bytes between samples of the others
  int chroma_shift; ///< log2 of their horizontal subsampling, 0 or 1
};

/// out[x] = table[colour of pixel x]; returns how many are 255.
std::uint32_t classify_row(const PixelRow& row, const std::uint8_t* table, int bit_shift, std::uint8_t* out,
                           int width);

// The score of every pixel without a colour table: with 16 or 32 bins per component, the three small tables
// of a model fit vector registers, and one or two byte shuffles look up 16 to 64 pixels.

/// True when classify_row_by_parts() is faster than classify_row(): with vectors, for bit shifts 3 to 7.
extern bool (*const parts_are_faster)(int bit_shift);

/// Same result as classify_row() with the table of `scores`: 255 where score_of() <= score_limit, otherwise
/// 0. Returns how many are 255. `scores.bit_shift` is 3..7.
extern std::uint32_t (*const classify_row_by_parts)(const PixelRow& row, const ComponentScores& scores,
                                                    std::uint8_t* out, int width);

} // namespace terrainseg::kernels
