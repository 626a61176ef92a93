// SPDX-License-Identifier: LGPL-2.1-or-later
// What the two pipelines are to the segmenter: one frame in, its estimate written, its terrain learned.
#pragma once

#include "base/estimate_writer.hpp"
#include "base/stage_clock.hpp"
#include "base/workers.hpp"
#include "terrainseg/frame.hpp"
#include "terrainseg/settings.hpp"
#include "terrainseg/supervision.hpp"
#include "terrainseg/terrain.hpp"

namespace terrainseg {

/// Fewest cells that a Gaussian is made of (the paper's window has 8 at 1/32: too few).
inline constexpr int samples_per_model = 16;

/// A frame that was admitted, and what follows from its size and the settings.
struct FrameTask {
  const Frame& frame;
  const Supervision& supervision;
  const Settings& settings;
  Rectangle window;   ///< the training window, in frame pixels
  int grid_level = 0; ///< pyramid level that is learned on
  Workers& workers;
};

/// Owns its stages and what they keep from frame to frame; what was learned is the segmenter's.
class Pipeline {
 public:
  Pipeline() = default;
  virtual ~Pipeline() = default;
  Pipeline(const Pipeline&) = delete;
  Pipeline& operator=(const Pipeline&) = delete;

  /// Labels a frame and learns from it. `out` was started for this frame.
  virtual void process(const FrameTask& task, Terrain& terrain, EstimateWriter& out, StageClock& clock) = 0;

  /// A learned model as this frame shows it, in the colours that are learned in.
  virtual TerrainModel in_this_light(const TerrainModel& learned) const = 0;

  /// Frames of these settings and this size follow.
  virtual void adapt(const Settings& settings, int grid_level) = 0;
  virtual void forget_frames() = 0;  ///< what spans neighbouring frames
  virtual void forget_terrain() = 0; ///< what was made of the terrain: it is another one now
};

/// What this frame's window may do: flag_learned, or why it is not learned. `starved`: it has too few usable
/// cells, something stands in it, or the frame is blank.
constexpr std::uint32_t learning_flag(const Settings& settings, bool starved) {
  if (!settings.learning || !settings.near_clear)
    return flag_frozen;
  return starved ? flag_starved : flag_learned;
}

} // namespace terrainseg
