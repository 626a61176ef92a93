// SPDX-License-Identifier: LGPL-2.1-or-later
// Stage C: k-means in the bit-shifted perception sub-space (paper, section 3.3, equations (6) to (8)), and
// the learned mixture of Gaussians (section 3.4, equations (13) to (17)).
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

struct LearningRule {
  std::uint32_t match_threshold_q8 = 256; ///< equation (13): largest squared distance of a match
  std::uint64_t mass_cap = 0;             ///< largest mass of a model, in samples (Q8); 0 = no cap
  int forget_shift = 0;                   ///< each frame reduces every mass by mass >> this; 0 = never
};

/// Left side of equation (13) with diagonal covariances, in Q16: sum over the components of
/// (mean_a - mean_b)^2 / (variance_a + variance_b). Neither variance may be 0.
std::uint64_t squared_distance(const TerrainModel& a, const TerrainModel& b);

/// Index of the nearest model that is not null and not farther than the threshold, or -1.
int nearest_match(std::span<const TerrainModel> learned, const TerrainModel& training,
                  std::uint32_t match_threshold_q8);

/// Equations (14) to (16): moves the mean and variance of `learned` towards `training` by its share of the
/// mass. Each step is rounded away from zero, so that a learned model of any mass finally reaches the
/// training model. With rounding to nearest it would stop before: an eighth of a grey level away at a share
/// of 1/65, and farther away with a larger mass.
void absorb(TerrainModel& learned, const TerrainModel& training);

/// Index of the model that equation (17) replaces: the first null one, otherwise the lightest. Models whose
/// bit is set in `kept` are excluded; -1 when all are.
int slot_to_replace(std::span<const TerrainModel> learned, std::uint32_t kept = 0);

/// Learns one frame. Reduces all masses by forget_shift. Then each training model, in order of decreasing
/// mass, is absorbed by its match, or replaces a slot that this frame has not filled. Then caps the masses.
void learn(std::span<TerrainModel> learned, std::span<const TerrainModel> training, const LearningRule& rule);

/// The rule that the settings give for a window of `cells` cells.
LearningRule learning_rule(const Settings& settings, std::size_t cells);

/// Index of the heaviest model, or -1 while all are null.
int heaviest(std::span<const TerrainModel> learned);

/// Changes the number of slots: adds null models or removes the lightest ones.
void resize_mixture(std::vector<TerrainModel>& learned, int slots);

} // namespace terrainseg
