// SPDX-License-Identifier: LGPL-2.1-or-later
// The default pipeline: the paper's stages and additional ones
// that find one boundary, and obstacles in the open ground below it.
#pragma once

#include "base/pipeline.hpp"
#include "base/quantities.hpp"
#include "freespace/answer/answer_writer.hpp"
#include "freespace/curve/boundary.hpp"
#include "freespace/curve/refinement.hpp"
#include "freespace/holes/hole_finders.hpp"
#include "freespace/learn/window_teacher.hpp"
#include "freespace/look/long_lines.hpp"
#include "freespace/look/view.hpp"
#include "freespace/score/cell_scorer.hpp"
#include "freespace/score/likelihood.hpp"

namespace terrainseg {

/// The complete state of the default pipeline between frames: `memory = {}` resets the pipeline. The learned
/// terrain is the segmenter's Terrain.
struct Memory {
  LastPicture last;
  std::uint32_t black = 0; ///< of the exposure, followed, Q8; 0 = not yet known
  WindowMemory window;
  CellScores average; ///< running average of the scores
  GridCurve boundary; ///< boundary of the last frame; empty = none
  LineWatch lines;
  HorizonHold horizon;
  HoleMemory holes;
};

/// The colour space in which this pipeline learns, for all formats of frames.
inline constexpr ColorSpace normalised_space{false, {ColorRange::full, ColorMatrix::bt601}};

class FreeSpacePipeline final : public Pipeline {
 public:
  void process(const FrameTask& task, Terrain& terrain, EstimateWriter& out, StageClock& clock) override;
  TerrainModel in_this_light(const TerrainModel& learned) const override;
  void adapt(const Settings& settings, int grid_level) override;
  void forget_frames() override { memory_ = {}; }
  void forget_terrain() override { tables_.forget(); }

 private:
  FrameReader reader_;
  WindowTeacher teacher_;
  TerrainTables tables_; ///< derived from the terrain
  CellScorer scorer_;
  LongLines long_lines_;
  GroundTracer tracer_;
  RefinedCurves curves_;
  HoleFinders holes_;
  AnswerWriter answer_;
  Memory memory_;
};

} // namespace terrainseg
