// SPDX-License-Identifier: LGPL-2.1-or-later
// Evidence of colour and texture for or against the terrain: tables of log-likelihood ratios, from the
// learned mixture (paper, section 3.4) and histograms of the rest of the frame.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "base/quantities.hpp"
#include "coarse/grid.hpp"
#include "freespace/look/color_bins.hpp"
#include "learning/terrain_model.hpp"
#include "terrainseg/frame.hpp"
#include "terrainseg/settings.hpp"
#include "terrainseg/terrain.hpp"

namespace terrainseg {

// Ground straight ahead of the window in another light: sunlit ground beyond shade, or shaded ground beyond
// sun.

/// Columns of the grid, `end` exclusive; none when both are equal.
struct Columns {
  int first = 0, end = 0;
  bool operator==(const Columns&) const = default;
};

/// The columns straight ahead of a window (in cells of the grid), centred on it and at most a third of the
/// grid's width.
Columns columns_ahead(const Rectangle& window, int grid_width);

/// Converts a model of normalised colours to the other light (color_bins.hpp: chroma does not change with
/// brightness). A model brighter than the middle is moved into the shade: half as bright. A darker one is
/// moved into the sun: twice as bright. The variance of luma is doubled.
TerrainModel in_other_light(const TerrainModel& model);

/// What a cell is learned as.
enum class Lesson : std::uint8_t {
  against,       ///< not terrain: the rest of the frame
  terrain,       ///< terrain: a cell of the window that passed the pre-filter
  nothing,       ///< not learned: the window's other cells, ignored cells
  against_little ///< not terrain, with a low weight; Negatives::split: the last mask labelled it as ground
};

/// Log-likelihood ratios, 32 = 1 nat, positive for the terrain. A colour that the terrain has in no light has
/// so low a value that texture cannot compensate it.
struct LikelihoodTables {
  std::array<std::int8_t, color_bins> color{};
  std::array<std::int8_t, color_bins> any_light{}; ///< for cells whose ground may be in another light
  std::array<std::int8_t, texture_bins> texture{};
};

/// Determines what every cell of a grid is learned as. Cells in `kept` are terrain; the rest of the `window`
/// and ignored cells are not learned; all others are not terrain. With Negatives::split, cells below the
/// `last` curve (first ground row per column; empty = none) have a low weight. Cells that are `joined` to the
/// window (1 per cell; empty = none) are terrain too.
void mark_lessons(const Grid& grid, std::span<const Cell> window, std::span<const Cell> kept,
                  std::span<const std::uint8_t> joined, Negatives negatives, const GridCurve& last,
                  std::vector<Lesson>& lessons);

/// Multiplies the histograms by 1 - 2^-forget_shift (0 = no forgetting) and adds a frame. Every frame has the
/// same weight, independent of the size of its grid.
void learn_histograms(const CellBins& cells, const std::vector<Lesson>& lessons, int forget_shift,
                      Terrain& learned);

/// Ground that is connected to the window: 1 per cell (empty = none), and the cells that vouch for it.
struct Vouched {
  std::span<const std::uint8_t> cells;
  std::span<const Cell> seeds;
};

/// Computes the score of every cell in Q4 (16 * 32 = 1 nat), positive for the terrain: the evidence of its
/// colour and texture minus its `penalty` (32 = 1 nat), limited to 1.5 nats either way, and 0 in ignored
/// cells. Vouched cells have at least three quarters of a nat, or the mean evidence of the seeds' colour and
/// texture when that is lower. In the columns `ahead` ground may be in another light; where its colour gives
/// evidence for ground there, the penalty has half of its weight.
void score_cells(const Grid& grid, const CellBins& cells, const LikelihoodTables& tables,
                 const CellPenalties& penalty, const Vouched& vouched, const Columns& ahead,
                 CellScores& score);

/// Colours are computed for the bins that a frame has: a tenth of all.
class Likelihood {
 public:
  /// Prepares the colours and computes the texture's table from the terrain and the frame's own training
  /// models. These have a fixed share of the mass, so that newly learned ground counts as terrain regardless
  /// of the mass of the learned models. `taught_q8` is the share of the picture that the last frame learned
  /// as terrain; the larger it is, the less ground is in the rest. Without negatives (Negatives::off) all
  /// other colours are equally likely.
  void build(const Terrain& learned, std::span<const TerrainModel> training, int taught_q8,
             const Settings& settings, LikelihoodTables& tables);
  /// Computes the entries of these bins that were not computed since build(). The table for any light is
  /// computed only with Settings::light_ahead.
  void compute(std::span<const std::uint16_t> colors, LikelihoodTables& tables);

 private:
  /// A model's density at the bins' centres, log2 Q8: the sum of three terms. And the distance of its chroma
  /// from them, Q8.
  struct Terms {
    std::array<std::int32_t, luma_bins> luma;
    std::array<std::int32_t, chroma_bins> u, v;
    std::array<std::int32_t, chroma_bins> away_u, away_v;
  };
  static Terms terms_of(const TerrainModel& model, int log_share);
  void weigh_for(const Terrain& learned, std::span<const TerrainModel> training, int favour);
  void weigh_against(const Terrain& learned, Negatives negatives);
  void compute(std::uint16_t color, LikelihoodTables& tables) const;

  std::array<Terms, 2 * max_models> own_, other_; ///< in their own light and in the other one
  std::size_t models_ = 0;
  std::array<std::uint32_t, color_bins> blurred_{}, half_blurred_{};
  std::uint64_t floor_ = 0; ///< added to blurred_
  int log_total_ = 0;
  bool light_ahead_ = false, vivid_colors_ = false;
  std::array<bool, color_bins> computed_{};
};

// Caches the likelihood tables of the terrain and recomputes them when it has changed.

class TerrainTables {
 public:
  /// Stores the training models of a learned window, and its share of the picture (Q8).
  void learned(const TrainingModels& training, int taught_q8);
  /// This frame's window is not learned: the tables use the terrain only.
  void rely_on_memory();
  /// The terrain was replaced.
  void forget();

  /// The tables with the entries of these colour bins; others are undefined.
  const LikelihoodTables& of(const Terrain& terrain, const Settings& settings,
                             std::span<const std::uint16_t> colors);

 private:
  Likelihood likelihood_;
  LikelihoodTables tables_;
  TrainingModels training_; ///< of the last frame; empty when its window was not learned
  int taught_q8_ = 0;
  bool old_ = true;
};

} // namespace terrainseg
