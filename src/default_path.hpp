// SPDX-License-Identifier: LGPL-2.1-or-later
// The rooms of the default pipeline and what they hand on to each other. Segmenter calls the steps in this
// order.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "boundary.hpp"
#include "clustering.hpp"
#include "coarse.hpp"
#include "evidence.hpp"
#include "exposure.hpp"
#include "free_space.hpp"
#include "geodesic.hpp"
#include "ground_behind.hpp"
#include "indices.hpp"
#include "local_reference.hpp"
#include "refinement.hpp"
#include "second_look.hpp"
#include "temporal.hpp"
#include "terrainseg/settings.hpp"
#include "terrainseg/terrain.hpp"
#include "texture.hpp"
#include "window_guard.hpp"

namespace terrainseg {

/// Colours that the default pipeline learns in, whatever the frames come in.
inline constexpr ColorSpace normalised_space{false, {ColorRange::full, ColorMatrix::bt601}};

class DefaultPath {
 public:
  /// The frame as indices: colour and texture of every cell, freed of the light. The exposure follows the
  /// frame unless `frozen`.
  void look(const Frame& frame, const Pyramid& pyramid, int level, const Settings& settings, bool frozen,
            Terrain& terrain);

  /// The normalised colours of the cells, to be clustered.
  Grid colors() const;

  /// Whether the window holds something that is not the terrain to its left and right.
  bool window_is_foreign(const Rectangle& window_cells, const Settings& settings, const Terrain& terrain);

  /// Counts colours and textures for and against the terrain: `kept` trains, the rest of `window` teaches
  /// nothing. `training` are the models made of it.
  void learn(const std::vector<Cell>& window, const std::vector<Cell>& kept, const TrainingModels& training,
             const Settings& settings, Terrain& terrain);

  /// This frame's window is not learned: only what was learned before speaks.
  void rely_on_memory();

  /// Score of every cell. `trusted` are the cells whose colour starts the local reference; without one the
  /// heaviest model does.
  void score(const std::vector<Cell>& trusted, std::int64_t pts, const Settings& settings,
             const Terrain& terrain);

  /// The boundary and the doubtful ground below it; the slow horizon follows it. Rows above `horizon_limit`
  /// (of the grid) cannot be ground.
  void find_boundary(const Settings& settings, int horizon_limit, Terrain& terrain);

  /// Both curves at the mask's columns.
  const FreeSpaceCurves& refine(const Pyramid& pyramid, const Frame& frame, const Settings& settings);

  struct HorizonRow {
    int row = -1;
    std::uint8_t confidence = 0;
  };
  /// Uppermost row (of the frame) of the ground, less outliers; -1 = null: the boundary touches the top or
  /// the bottom, or separates nothing that differs (a wall, a turn over unknown ground).
  HorizonRow horizon(int frame_height, int mask_level);

  std::uint8_t confidence() const { return confidence_; }
  /// A learned model in the frame's own light, full-range BT.601.
  TerrainModel in_this_light(const TerrainModel& learned) const;

  void forget_frames();  ///< what spans neighbouring frames
  void forget_terrain(); ///< tables made from what was learned

 private:
  std::array<int, 3> reference_color(const std::vector<Cell>& trusted, const Terrain& terrain) const;
  void refresh_tables(const Settings& settings, const Terrain& terrain);

  ColorTransform transform_;
  CoarseGrid grid_;
  TextureReader texture_reader_;
  std::vector<std::uint16_t> texture_;
  ExposureTables exposure_;
  std::optional<std::uint32_t> exposure_of_tables_;
  CellIndices cells_;
  WindowGuard guard_;
  std::vector<Lesson> lessons_;
  TrainingModels training_; ///< of this frame
  int taught_q8_ = 0;       ///< share of the picture that the last lesson taught
  Evidence evidence_;
  EvidenceTables tables_;
  bool tables_are_old_ = true;
  ColorSteps steps_;
  LocalReference local_reference_;
  GeodesicPenalty geodesic_;
  std::vector<std::int8_t> penalty_;
  std::vector<std::int16_t> score_, average_, revised_, prior_;
  ScoreAverage averaging_;
  bool continued_ = false;
  BoundarySearch search_;
  SecondLook second_look_;
  std::vector<std::uint16_t> boundary_, before_, safe_, scratch_;
  GroundBehindSearch behind_search_;
  GroundBehind behind_;
  Refinement refinement_;
  FreeSpaceCurves curves_;
  std::uint8_t confidence_ = 0;
};

} // namespace terrainseg
