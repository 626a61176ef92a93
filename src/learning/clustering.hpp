// SPDX-License-Identifier: LGPL-2.1-or-later
// Stage C: k-means in the bit-shifted perception sub-space (paper, section 3.3, equations (6) to (8)).
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "coarse/grid.hpp"
#include "terrainseg/terrain.hpp"

namespace terrainseg {

/// The 8-bit value that represents a bin: its centre. Shifted values are never compared with unshifted ones.
constexpr std::uint8_t bin_centre(int value, int bit_shift) {
  return static_cast<std::uint8_t>((value >> bit_shift << bit_shift) + (1 << bit_shift >> 1));
}

/// Smallest variance of a cluster (Q8): that of a uniform distribution over a bin, 2^(2b) / 12, plus 16, so
/// that a cluster of one colour has a variance too.
constexpr std::uint32_t variance_floor(int bit_shift) {
  return (16u << 8) + ((256u << (2 * bit_shift)) + 6) / 12;
}

struct ClusterRule {
  int clusters = 3; ///< K, 1..8
  std::array<int, 3> bit_shift{3, 3, 3};
  std::array<std::uint32_t, 3> variance_floor{}; ///< Q8, per component
  std::uint32_t seed = 1;                        ///< seed of the random centres
};

/// The training models of one frame, in order of decreasing mass (number of samples, Q8).
struct TrainingModels {
  std::array<TerrainModel, max_models> models{};
  int count = 0;
  std::span<const TerrainModel> span() const { return {models.data(), static_cast<std::size_t>(count)}; }
};

/// Working memory that is kept from frame to frame.
struct ClusterScratch {
  std::vector<Color> samples;
  std::vector<std::uint8_t> cluster_of;
  /// Reserves memory for all cells of the window, because the pre-filter keeps a varying number of them.
  void reserve(std::size_t cells) {
    samples.reserve(cells);
    cluster_of.reserve(cells);
  }
};

/// Clusters the colours of `cells` into at most K models, fewer when clusters become empty, none without
/// cells. The same cells, rule and seed give the same models.
TrainingModels cluster(const Grid& grid, std::span<const Cell> cells, const ClusterRule& rule,
                       ClusterScratch& scratch);

} // namespace terrainseg
