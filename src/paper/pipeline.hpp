// SPDX-License-Identifier: LGPL-2.1-or-later
// The paper's pipeline (figure 2): stages A to E as printed. Where the paper leaves something open, the
// stage's source states the decision.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "base/pipeline.hpp"
#include "coarse/grid.hpp"
#include "coarse/pyramid.hpp"
#include "coarse/window.hpp"
#include "learning/terrain_model.hpp"
#include "paper/scoring.hpp"

namespace terrainseg {

/// The free space that is connected to the training window, which is the boundary that a planner uses: per
/// column of the grid, the highest free cell that is reached from the window: sideways along the window's
/// rows, then straight up, through free cells only. -1 = none. `free_cells` has one byte per cell, 0 = not
/// free.
void find_reachable(std::span<const std::uint8_t> free_cells, int width, const Rectangle& window_cells,
                    std::vector<std::int16_t>& top);

/// Converts `top` to rows of the frame per mask column. Within the cell above the top one, uses the row that
/// best separates traversable pixels from others. `frame_height` = no free space.
void refine_reachable(const Grid& grid, std::span<const std::int16_t> top, const GrayView& mask,
                      int mask_level, int frame_height, std::span<std::uint16_t> boundary);

class PaperPipeline final : public Pipeline {
 public:
  void process(const FrameTask& task, Terrain& terrain, EstimateWriter& out, StageClock& clock) override;
  TerrainModel in_this_light(const TerrainModel& learned) const override { return learned; }
  void adapt(const Settings& settings, int grid_level) override;
  void forget_frames() override {} // no stage depends on earlier frames
  void forget_terrain() override { table_is_old_ = true; }

 private:
  void label(const FrameTask& task, const Grid& grid, const Rectangle& window_cells, const Horizon& horizon,
             const VetoArea& veto, EstimateWriter& out, StageClock& clock);
  void find_reach(const Grid& grid, const Rectangle& window_cells, const Horizon& horizon,
                  const VetoArea& veto, const Settings& settings, EstimateWriter& out);

  PyramidPlan plan_;
  Pyramid pyramid_;
  std::vector<Cell> window_cells_;
  Prefiltered kept_;
  ClusterScratch clusters_;
  ScoreTable table_;
  bool table_is_old_ = true;
  std::vector<std::uint8_t> scores_;
  std::vector<std::int16_t> top_;
};

} // namespace terrainseg
