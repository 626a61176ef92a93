// SPDX-License-Identifier: LGPL-2.1-or-later
// What a colour and a texture say for or against the terrain: tables of log-likelihood ratios, made from the
// learned mixture (paper, section 3.4) and from histograms of what stands against it.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "base/quantities.hpp"
#include "coarse/grid.hpp"
#include "freespace/look/color_bins.hpp"
#include "freespace/score/light_ahead.hpp"
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

/// Log-likelihood ratios, 32 = 1 nat, positive for the terrain. A colour that is none of the terrain in any
/// light has less than any texture makes up for.
struct LikelihoodTables {
  std::array<std::int8_t, color_bins> color{};
  std::array<std::int8_t, color_bins> any_light{}; ///< of colours whose ground may lie in another light
  std::array<std::int8_t, texture_bins> texture{};
};

/// What every cell of a grid teaches: those that `kept` says are terrain; the rest of the `window` and what
/// is ignored nothing; all others stand against it. With Negatives::split those below the `last` curve (first
/// ground row per column; empty = none) little. Cells that are `joined` to the window (1 per cell; empty =
/// none) are terrain, too.
void mark_lessons(const Grid& grid, std::span<const Cell> window, std::span<const Cell> kept,
                  std::span<const std::uint8_t> joined, Negatives negatives, const GridCurve& last,
                  std::vector<Lesson>& lessons);

/// Fades the histograms by >> forget_shift (0 = never) and counts a frame: every frame weighs the same,
/// whatever the size of its grid.
void learn_histograms(const CellBins& cells, const std::vector<Lesson>& lessons, int forget_shift,
                      Terrain& learned);

/// Ground that is joined to the window: 1 per cell (empty = none), and the cells that vouch for it.
struct Vouched {
  std::span<const std::uint8_t> cells;
  std::span<const Cell> seeds;
};

/// Score of every cell in Q4 (16 * 32 = 1 nat), positive for the terrain: what its colour and its texture
/// say, less its `penalty` (32 = 1 nat); no more than 1.5 nats either way, and 0 where ignored. Cells that
/// are vouched for have three quarters of a nat at least, or what colour and texture say of the seeds in the
/// mean where that is less. In the columns `ahead` the ground may lie in another light, and where its colour
/// speaks for it there the penalty counts half.
void score_cells(const Grid& grid, const CellBins& cells, const LikelihoodTables& tables,
                 const CellPenalties& penalty, const Vouched& vouched, const Columns& ahead,
                 CellScores& score);

class Likelihood {
 public:
  /// Tables from what is learned and from the frame's own training models, which speak with a fixed share of
  /// the mass: what has just been learned is terrain, however heavy the memory is. `taught_q8` is the share
  /// of the picture that the last lesson taught as terrain: the more it is, the less ground is left in the
  /// rest. Without negatives (Negatives::off) all colours stand against the terrain alike. The table for any
  /// light is made with Settings::light_ahead only.
  void build(const Terrain& learned, std::span<const TerrainModel> training, int taught_q8,
             const Settings& settings, LikelihoodTables& tables);

 private:
  void weigh_for(const Terrain& learned, std::span<const TerrainModel> training, int favour);
  void weigh_model(const TerrainModel& model, int log_share);
  void weigh_other_light(const Terrain& learned, std::span<const TerrainModel> training, int favour);
  template <typename Weigh>
  static void each_model(const Terrain& learned, std::span<const TerrainModel> training, int favour,
                         const Weigh& weigh);
  void compare(std::array<std::int8_t, color_bins>& table) const;
  static void refuse_other_chroma(const Terrain& learned, std::span<const TerrainModel> training,
                                  LikelihoodTables& tables);
  void weigh_against(const Terrain& learned, Negatives negatives);

  std::array<std::int32_t, color_bins> positive_{}, negative_{}; ///< log2 of a probability, Q8
  std::array<std::uint32_t, color_bins> blurred_{}, half_blurred_{};
};

} // namespace terrainseg
