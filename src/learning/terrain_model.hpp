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
  std::uint64_t mass_cap = 0;             ///< samples in Q8 that one model may weigh; 0 = no cap
  int forget_shift = 0;                   ///< before learning every mass fades by >> this; 0 = never
};

/// Left side of equation (13) with diagonal covariances, in Q16: sum over the components of
/// (mean_a - mean_b)^2 / (variance_a + variance_b). Neither variance may be 0.
std::uint64_t squared_distance(const TerrainModel& a, const TerrainModel& b);

/// Index of the nearest model that is not null and not farther than the threshold, or -1.
int nearest_match(std::span<const TerrainModel> learned, const TerrainModel& training,
                  std::uint32_t match_threshold_q8);

/// Equations (14) to (16): the mean and variance of `learned` move towards `training` by its share of the
/// mass. Each step is rounded away from zero: however heavy the learned model is, it reaches the training
/// model in the end. Rounding to nearest stalls: at a weight of 1/65 an eighth of a grey level away, and
/// farther with every frame of mass.
void absorb(TerrainModel& learned, const TerrainModel& training);

/// Index of the model that equation (17) gives up: the first null one, else the lightest, but none of those
/// whose bit is set in `kept`; -1 when all are kept.
int slot_to_replace(std::span<const TerrainModel> learned, std::uint32_t kept = 0);

/// One frame's learning: fades, then every training model (they come in order of falling mass) is absorbed by
/// its match or replaces a slot (not one that this frame filled), then masses are capped.
void learn(std::span<TerrainModel> learned, std::span<const TerrainModel> training, const LearningRule& rule);

/// What the settings make of it for a window of `cells` cells.
LearningRule learning_rule(const Settings& settings, std::size_t cells);

/// Index of the heaviest model, or -1 while all are null.
int heaviest(std::span<const TerrainModel> learned);

/// Gives the mixture `slots` slots: null ones are added, or the lightest models are dropped.
void resize_mixture(std::vector<TerrainModel>& learned, int slots);

/// Whether a terrain from elsewhere has the shape and the ranges that learning and scoring rely on.
bool well_formed(const Terrain& terrain);

} // namespace terrainseg
