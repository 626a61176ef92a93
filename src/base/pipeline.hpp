// SPDX-License-Identifier: LGPL-2.1-or-later
// Interface of the two pipelines: takes one frame, writes its estimate, updates the terrain.
#pragma once

#include <array>
#include <chrono>
#include <cstdint>
#include <string>

#include "base/estimate_writer.hpp"
#include "base/workers.hpp"
#include "terrainseg/frame.hpp"
#include "terrainseg/mask_target.hpp"
#include "terrainseg/settings.hpp"
#include "terrainseg/stage.hpp"
#include "terrainseg/supervision.hpp"
#include "terrainseg/terrain.hpp"

namespace terrainseg {

/// Smallest number of cells for a Gaussian. The paper's window has 8 at scale 1/32, which is too few.
inline constexpr int samples_per_model = 16;

/// Returns the error of an invalid frame and its remedy, or an empty text.
std::string flaw_of(const Frame& frame);

/// Returns the error of a mask target for this frame, or an empty text. An empty target is valid.
std::string flaw_of(const MaskTarget& target, const Frame& frame, int mask_level);

/// A valid frame, and the values that follow from its size and the settings.
struct FrameTask {
  const Frame& frame;
  const Supervision& supervision;
  const Veto& veto;
  const Settings& settings;
  Rectangle window;   ///< the training window, in pixels of the frame
  int grid_level = 0; ///< the pyramid level for learning
  Workers& workers;
};

/// Measures the stages: accumulates nanoseconds per stage. All times start at zero.
class StageClock {
 public:
  explicit StageClock(std::array<std::int64_t, stage_count>& times) : times_(times) { times_.fill(0); }
  /// Adds the time since the last lap to `stage`.
  void lap(Stage stage) {
    const auto now = std::chrono::steady_clock::now();
    times_[static_cast<std::size_t>(stage)] +=
        std::chrono::duration_cast<std::chrono::nanoseconds>(now - last_).count();
    last_ = now;
  }

 private:
  std::array<std::int64_t, stage_count>& times_;
  std::chrono::steady_clock::time_point last_ = std::chrono::steady_clock::now();
};

/// Owns its stages and their state between frames. The segmenter owns the terrain.
class Pipeline {
 public:
  Pipeline() = default;
  virtual ~Pipeline() = default;
  Pipeline(const Pipeline&) = delete;
  Pipeline& operator=(const Pipeline&) = delete;

  /// Labels a frame and learns from it. `out` must have been started for this frame.
  virtual void process(const FrameTask& task, Terrain& terrain, EstimateWriter& out, StageClock& clock) = 0;

  /// Converts a learned model to the colours of the current frame, in the learning colour space.
  virtual TerrainModel in_this_light(const TerrainModel& learned) const = 0;

  /// Prepares for frames of this size with these settings.
  virtual void adapt(const Settings& settings, int grid_level) = 0;
  virtual void forget_frames() = 0;  ///< clears the state of neighbouring frames
  virtual void forget_terrain() = 0; ///< clears what was derived from the terrain, because the terrain was
                                     ///< replaced
};

/// Returns flag_learned, or the flag for the reason why the window is not learned. `starved`: the window has
/// too few usable cells or contains an obstacle, or the frame is blank.
constexpr std::uint32_t learning_flag(const Settings& settings, bool starved) {
  if (!settings.learning || !settings.near_clear)
    return flag_frozen;
  return starved ? flag_starved : flag_learned;
}

} // namespace terrainseg
