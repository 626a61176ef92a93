// SPDX-License-Identifier: LGPL-2.1-or-later
#include "color_histogram.hpp"

#include "indices.hpp"

namespace terrainseg {
namespace {

constexpr int luma_bins = 256 >> luma_bin_shift, chroma_bins = 256 >> chroma_bin_shift;

// Along one axis: `count` neighbours `slice` bins apart in every block.
void blur(std::span<const std::uint32_t> in, std::span<std::uint32_t> out, int slice, int count) {
  const int block = slice * count;
  for (int start = 0; start < color_bins; start += block) {
    const std::uint32_t* from = &in[static_cast<std::size_t>(start)];
    std::uint32_t* to = &out[static_cast<std::size_t>(start)];
    for (int i = 0; i < slice; ++i)
      to[i] = (3 * from[i] + from[i + slice]) >> 2;
    for (int i = slice; i < block - slice; ++i)
      to[i] = (from[i - slice] + 2 * from[i] + from[i + slice]) >> 2;
    for (int i = block - slice; i < block; ++i)
      to[i] = (from[i - slice] + 3 * from[i]) >> 2;
  }
}

} // namespace

void blur_colors(std::span<const std::uint32_t> in, std::span<std::uint32_t> between,
                 std::span<std::uint32_t> out) {
  blur(in, out, chroma_bins * chroma_bins, luma_bins);
  blur(out, between, chroma_bins, chroma_bins);
  blur(between, out, 1, chroma_bins);
}

} // namespace terrainseg
