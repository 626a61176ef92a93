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

/// What a shifted value stands for in 8-bit units: the centre of its bin. Shifted values are never compared
/// with unshifted ones.
constexpr std::uint8_t bin_centre(int value, int bit_shift) {
  return static_cast<std::uint8_t>((value >> bit_shift << bit_shift) + (1 << bit_shift >> 1));
}

/// Least variance of a cluster (Q8). Inside a bin nothing is known: its own variance is 2^(2b) / 12, and 16
/// keeps a cluster of one colour from having none at all.
constexpr std::uint32_t variance_floor(int bit_shift) {
  return (16u << 8) + ((256u << (2 * bit_shift)) + 6) / 12;
}

struct ClusterRule {
  int clusters = 3; ///< K, 1..8
  std::array<int, 3> bit_shift{3, 3, 3};
  std::array<std::uint32_t, 3> variance_floor{}; ///< Q8, per component
  std::uint32_t seed = 1;                        ///< of the random centres
};

/// The training models of one frame, in order of falling mass (= samples, Q8).
struct TrainingModels {
  std::array<TerrainModel, max_models> models{};
  int count = 0;
  std::span<const TerrainModel> span() const { return {models.data(), static_cast<std::size_t>(count)}; }
};

/// Room to work in that is kept from frame to frame.
struct ClusterScratch {
  std::vector<Color> samples;
  std::vector<std::uint8_t> cluster_of;
  /// For all cells of the window: what the pre-filter keeps of them differs from frame to frame.
  void reserve(std::size_t cells) {
    samples.reserve(cells);
    cluster_of.reserve(cells);
  }
};

/// Clusters the colours of `cells`. At most K models: clusters that run empty are dropped. The same cells,
/// rule and seed give the same models. None without a cell.
TrainingModels cluster(const Grid& grid, std::span<const Cell> cells, const ClusterRule& rule,
                       ClusterScratch& scratch);

} // namespace terrainseg
