// SPDX-License-Identifier: LGPL-2.1-or-later
// What a Segmenter keeps, and its housekeeping. The order of the stages is in segmenter.cpp.
#pragma once

#include <optional>
#include <vector>

#include "clustering.hpp"
#include "default_path.hpp"
#include "horizon.hpp"
#include "pyramid.hpp"
#include "scoring.hpp"
#include "stage_clock.hpp"
#include "terrainseg/segmenter.hpp"
#include "window.hpp"
#include "workers.hpp"

namespace terrainseg {

struct Segmenter::State {
  explicit State(const Settings& initial);

  Status admit(const Frame& frame, const MaskTarget& target) const;
  void adapt(const Frame& frame);
  void forget();
  Grid grid_at(int pyramid_level) const;
  std::uint32_t gate(bool starved);
  void find_free_space(const Frame& frame, const Supervision& supervision);
  std::optional<GroundColor> ground_color(const Moments& window) const;
  TrainingModels cluster_window(const Grid& grid);
  void update(const TrainingModels& training);
  void start_estimate(const Frame& frame, const MaskTarget& target);
  void label_by_score(const Frame& frame, const Grid& grid, const Horizon& horizon, StageClock& clock);
  void label_free_space(const Frame& frame, StageClock& clock);
  void label_unknown();
  void describe_models();

  // What was asked for, and what follows from it for frames of one size.
  Settings settings;
  int width = 0, height = 0;
  std::optional<ColorSpace> space; ///< of the last frame
  bool stale = true;               ///< settings changed: adapt() starts anew
  int level = 0;                   ///< of the grid
  PyramidPlan plan;
  Rectangle window;

  // What lasts.
  Terrain terrain;
  Counters counters;
  std::array<std::int64_t, stage_count> times{};

  // Room for one frame.
  std::optional<Workers> workers;
  int threads = -1; ///< that `workers` was asked for
  Pyramid pyramid;
  DefaultPath path;
  FreeSpace free_space;
  std::vector<Cell> window_cells;
  Prefiltered kept;
  ClusterScratch clusters;
  ScoreTable table;
  bool table_is_old = true;
  std::vector<std::uint8_t> scores, mask;
  std::vector<std::int16_t> top;
  std::vector<std::uint16_t> boundary;
  MutablePlane mask_plane;
  Estimate estimate;
};

} // namespace terrainseg
