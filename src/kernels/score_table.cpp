// SPDX-License-Identifier: LGPL-2.1-or-later
#include "kernels/score_table.hpp"

#include <algorithm>
#include <cstring>

namespace terrainseg::kernels {
namespace {

/// A template argument of 0 means that the step is read from the row; other steps are compile-time constants.
template <int FirstStep, int ChromaStep, int ChromaShift>
std::uint32_t classify(const PixelRow& row, const std::uint8_t* table, int bit_shift, std::uint8_t* out,
                       int width) {
  const int bits = 8 - bit_shift;
  const std::ptrdiff_t first_step = FirstStep ? FirstStep : row.first_step,
                       chroma_step = ChromaStep ? ChromaStep : row.chroma_step;
  const std::uint8_t *first = row.component[0], *second = row.component[1], *third = row.component[2];
  const auto chroma_index = [&](std::ptrdiff_t i) {
    return static_cast<unsigned>(second[i * chroma_step] >> bit_shift) << bits |
           static_cast<unsigned>(third[i * chroma_step] >> bit_shift);
  };
  const auto look_up = [&](std::ptrdiff_t x, unsigned chroma) {
    return table[static_cast<unsigned>(first[x * first_step] >> bit_shift) << (2 * bits) | chroma];
  };
  std::uint32_t count = 0;
  int x = 0;
  if constexpr (ChromaShift == 1) {
    for (; x + 1 < width; x += 2) {
      const unsigned chroma = chroma_index(x >> 1);
      const std::uint8_t left = look_up(x, chroma), right = look_up(x + 1, chroma);
      out[x] = left;
      out[x + 1] = right;
      count += (left & 1u) + (right & 1u);
    }
  }
  for (; x < width; ++x) {
    out[x] = look_up(x, chroma_index(x >> ChromaShift));
    count += out[x] & 1u;
  }
  return count;
}

} // namespace

std::uint8_t score_of(const ComponentScores& scores, std::uint8_t first, std::uint8_t second,
                      std::uint8_t third) {
  const int b = scores.bit_shift;
  int least = 255;
  for (int n = 0; n < scores.models; ++n) {
    const auto& entry = scores.entries[n];
    least = std::min(least, entry[0][first >> b] + entry[1][second >> b] + entry[2][third >> b]);
  }
  return static_cast<std::uint8_t>(least);
}

void fill_color_table(const ComponentScores& scores, std::uint8_t* table, std::uint8_t* used) {
  const int side = 256 >> scores.bit_shift;
  const std::size_t rows = color_table_rows(scores.bit_shift);
  for (std::size_t row = 0; row < rows; ++row)
    if (used[row]) {
      std::memset(table + row * side, 0, side);
      used[row] = 0;
    }
  for (int n = 0; n < scores.models; ++n) {
    const auto& entry = scores.entries[n];
    for (int i = 0; i < side; ++i) {
      if (entry[0][i] > score_limit)
        continue;
      for (int j = 0; j < side; ++j) {
        const int room = score_limit - entry[0][i] - entry[1][j];
        if (room < 0)
          continue;
        const std::size_t row = static_cast<std::size_t>(i) * side + j;
        std::uint8_t* colors = table + row * side;
        for (int k = 0; k < side; ++k)
          colors[k] |= entry[2][k] <= room ? 255 : 0;
        used[row] = 1;
      }
    }
  }
}

std::uint32_t classify_row(const PixelRow& row, const std::uint8_t* table, int bit_shift, std::uint8_t* out,
                           int width) {
  if (row.chroma_shift == 1) {
    if (row.first_step == 1 && row.chroma_step == 1)
      return classify<1, 1, 1>(row, table, bit_shift, out, width);
    if (row.first_step == 1 && row.chroma_step == 2)
      return classify<1, 2, 1>(row, table, bit_shift, out, width);
    return classify<0, 0, 1>(row, table, bit_shift, out, width);
  }
  if (row.first_step == 1 && row.chroma_step == 1)
    return classify<1, 1, 0>(row, table, bit_shift, out, width);
  return classify<0, 0, 0>(row, table, bit_shift, out, width);
}

} // namespace terrainseg::kernels
