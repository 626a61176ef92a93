// SPDX-License-Identifier: LGPL-2.1-or-later
// What a colour and a texture say for or against the terrain: tables of log-likelihood ratios, made from the
// learned mixture (paper, section 3.4) and from histograms of what stands against it.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "coarse.hpp"
#include "indices.hpp"
#include "terrainseg/settings.hpp"
#include "terrainseg/terrain.hpp"

namespace terrainseg {

/// What a cell teaches.
enum class Lesson : std::uint8_t {
  against,       ///< the rest of the frame
  terrain,       ///< a cell of the window that passed the pre-filter
  nothing,       ///< the window's other cells, ignored ones
  against_little ///< Negatives::split: the last mask called it ground
};

/// Log-likelihood ratios, 32 = 1 nat, positive for the terrain.
struct EvidenceTables {
  std::array<std::int8_t, color_bins> color{};
  std::array<std::int8_t, texture_bins> texture{};
};

/// Fades the histograms by >> forget_shift (0 = never) and counts a frame: every frame weighs the same,
/// whatever the size of its grid.
void learn_histograms(const CellIndices& cells, const std::vector<Lesson>& lessons, int forget_shift,
                      Terrain& learned);

class Evidence {
 public:
  /// Tables from what is learned and from the frame's own training models, which speak with a fixed share of
  /// the mass: what has just been learned is terrain, however heavy the memory is. `taught_q8` is the share
  /// of the picture that the last lesson taught as terrain: the more it is, the less ground is left in the
  /// rest. Without negatives (Negatives::off) all colours stand against the terrain alike.
  void build(const Terrain& learned, std::span<const TerrainModel> training, int taught_q8,
             const Settings& settings, EvidenceTables& tables);

 private:
  void weigh_for(const Terrain& learned, std::span<const TerrainModel> training, int favour);
  void weigh_model(const TerrainModel& model, int log_share);
  void weigh_against(const Terrain& learned, Negatives negatives);

  std::array<std::int32_t, color_bins> positive_{}, negative_{}; ///< log2 of a probability, Q8
  std::array<std::uint32_t, color_bins> blurred_{}, half_blurred_{};
};

} // namespace terrainseg
