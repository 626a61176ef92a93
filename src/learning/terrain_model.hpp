// SPDX-License-Identifier: LGPL-2.1-or-later
// The learned mixture of Gaussians (paper, section 3.4, equations (13) to (17)).
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "terrainseg/terrain.hpp"

namespace terrainseg {

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

/// Whether a terrain from a file or a caller has the structure and value ranges that learning and scoring
/// require.
bool well_formed(const Terrain& terrain);

} // namespace terrainseg
