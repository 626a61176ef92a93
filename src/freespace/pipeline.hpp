// SPDX-License-Identifier: LGPL-2.1-or-later
// The default pipeline: the paper's stages, and those beyond it that make a mask out of them that can be
// driven by.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "base/pipeline.hpp"
#include "base/quantities.hpp"
#include "coarse/grid_reader.hpp"
#include "coarse/window.hpp"
#include "freespace/answer/evidence.hpp"
#include "freespace/answer/free_space.hpp"
#include "freespace/answer/horizon_row.hpp"
#include "freespace/curve/boundary.hpp"
#include "freespace/curve/ground_behind.hpp"
#include "freespace/curve/reestimation.hpp"
#include "freespace/curve/refinement.hpp"
#include "freespace/holes/odd_spots.hpp"
#include "freespace/holes/standing_things.hpp"
#include "freespace/holes/stone_field.hpp"
#include "freespace/learn/own_shadow.hpp"
#include "freespace/look/color_bins.hpp"
#include "freespace/look/connected_ground.hpp"
#include "freespace/look/exposure.hpp"
#include "freespace/look/texture.hpp"
#include "freespace/memory.hpp"
#include "freespace/score/geodesic.hpp"
#include "freespace/score/likelihood.hpp"
#include "freespace/score/local_reference.hpp"
#include "learning/clustering.hpp"

namespace terrainseg {

/// Colours that this pipeline learns in, whatever the frames come in.
inline constexpr ColorSpace normalised_space{false, {ColorRange::full, ColorMatrix::bt601}};

class FreeSpacePipeline final : public Pipeline {
 public:
  void process(const FrameTask& task, Terrain& terrain, EstimateWriter& out, StageClock& clock) override;
  TerrainModel in_this_light(const TerrainModel& learned) const override;
  void adapt(const Settings& settings, int grid_level) override;
  void forget_frames() override;
  void forget_terrain() override;

 private:
  // Steps of process(), in its order.
  void read_cells(const FrameTask& task, Terrain& terrain);
  bool window_is_foreign(const FrameTask& task, const Rectangle& window, const Terrain& terrain);
  void learn_window(const Settings& settings, const Grid& colors, Terrain& terrain, StageClock& clock);
  void rely_on_memory();
  void weigh_cells(const Settings& settings, std::span<const Cell> trusted, const Columns& ahead,
                   const Terrain& terrain);
  void find_boundary(const FrameTask& task, bool continued, Terrain& terrain);
  void refine_curves(const FrameTask& task, int mask_level, FreeSpaceCurves& curves);
  const FreeSpaceCurves& curves_at(const FrameTask& task, int level);
  void find_spots(const FrameTask& task, const Rectangle& window, std::uint32_t slow_horizon);
  bool find_standing(const FrameTask& task, Estimate& estimate);
  void tell_confidence(const Settings& settings, bool stands, const Estimate& estimate,
                       const MutablePlane& map);

  const LikelihoodTables& likelihoods(const Settings& settings, const Terrain& terrain);
  std::array<int, 3> reference_color(std::span<const Cell> trusted, const Terrain& terrain) const;

  // The frame, coarse: cells, and what is seen of them.
  Pyramid pyramid_;
  ColorTransform transform_;
  GridReader grid_reader_;
  Grid grid_; ///< of this frame
  TextureReader texture_reader_;
  std::vector<std::uint16_t> texture_;
  ExposureTables exposure_;
  std::optional<std::uint32_t> exposure_of_tables_; ///< mean luma that `exposure_` was made for
  CellBins cells_;
  ConnectedGround connected_;

  // The window and what it teaches.
  std::vector<Cell> window_cells_, lit_cells_;
  Prefiltered kept_;
  ClusterScratch clusters_;
  TrainingModels training_; ///< of this frame; none while its window is not learned
  int taught_q8_ = 0;       ///< share of the picture that the last lesson taught
  std::vector<Lesson> lessons_;

  // What the cells say.
  Likelihood likelihood_;
  LikelihoodTables tables_;
  bool tables_are_old_ = true;
  LocalReference local_reference_;
  ColorSteps steps_;
  GeodesicPenalty geodesic_;
  std::span<const std::uint8_t> vouched_; ///< of this frame; held by connected_
  CellPenalties penalty_;
  CellScores score_, revised_;

  // What the picture says: curves.
  RowPriors prior_;
  BoundarySearch search_;
  Reestimation reestimation_;
  GroundBehindSearch behind_search_;
  GroundBehind behind_;
  GridCurve before_, safe_;
  std::vector<std::uint16_t> scratch_;
  Refinement refinement_;
  FreeSpaceCurves curves_;
  FreeSpaceCurves fine_curves_; ///< the same for small masks: a column per cell that is searched for spots
  /// In the whole picture, and in finer cells where things are far away.
  struct SpotSearch {
    OddSpots spots;
    bool found = false; ///< in this frame
  };
  std::array<SpotSearch, 2> spot_searches_;
  StoneField stone_field_;
  bool in_stones_ = false; ///< there is a field of stones in this frame
  StandingThings standing_;
  FrameCurve below_things_; ///< the safe curve where nothing stands in the open below it
  FreeSpace free_space_;
  Evidence evidence_;

  Memory memory_;
};

} // namespace terrainseg
