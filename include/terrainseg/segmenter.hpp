// SPDX-License-Identifier: LGPL-2.1-or-later
// The complete segmentation without GStreamer: takes frames, returns estimates.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <string>
#include <utility>

#include "terrainseg/counters.hpp"
#include "terrainseg/estimate.hpp"
#include "terrainseg/frame.hpp"
#include "terrainseg/mask_target.hpp"
#include "terrainseg/settings.hpp"
#include "terrainseg/stage.hpp"
#include "terrainseg/supervision.hpp"
#include "terrainseg/terrain.hpp"

namespace terrainseg {

/// Result of a call. After an error the segmenter is unchanged.
class [[nodiscard]] Status {
 public:
  enum class Code : std::uint8_t {
    ok,
    bad_frame, ///< unknown format, missing planes, a size outside 1..32767, or a stride shorter than a row
    window_outside_frame, ///< the configured training window does not fit this frame
    bad_target,           ///< the mask target has the wrong size
    foreign_terrain, ///< the Terrain has another colour space or shape, or was learned by the other pipeline
  };
  Status() = default;
  Status(Code code, std::string message) : code_(code), message_(std::move(message)) {}
  bool ok() const { return code_ == Code::ok; }
  Code code() const { return code_; }
  const std::string& message() const { return message_; } ///< cause and remedy; empty when ok

 private:
  Code code_ = Code::ok;
  std::string message_;
};

/// The colour space in which a Segmenter with these settings learns from frames in the colour space `frames`.
/// The default pipeline converts all frames to full-range BT.601. The paper's pipeline learns in the frame's
/// own colour space.
TERRAINSEG_API ColorSpace learning_space(const Settings& settings, const ColorSpace& frames);

/// Segments frames of one camera and learns its terrain. Use one object per stream, from one thread at a
/// time.
class TERRAINSEG_API Segmenter {
 public:
  /// `settings` must have passed validate().
  explicit Segmenter(const Settings& settings);
  ~Segmenter();
  Segmenter(Segmenter&&) noexcept;
  Segmenter& operator=(Segmenter&&) noexcept;

  /// Applies other validated settings from the next frame on. Keeps the learned terrain. A smaller number of
  /// learned models drops those with the least mass. A change of the pipeline clears the terrain, because the
  /// pipelines learn in different colour spaces.
  void configure(const Settings& settings);
  const Settings& settings() const;

  /// Labels one frame and learns from it. Allocates memory only after a change of the frame's size or format
  /// or of the settings. Errors: bad_frame, window_outside_frame, bad_target.
  Status process(const Frame& frame, const Supervision& supervision = {}, const MaskTarget& target = {},
                 const Veto& veto = {});
  /// The estimate of the last successful process(). Before the first one it has flag_unknown.
  const Estimate& estimate() const;

  void reset();          ///< clears the terrain and all state that spans frames
  void reset_temporal(); ///< after a seek: clears the state of neighbouring frames, keeps the terrain

  Terrain terrain() const; ///< a copy of the learned terrain
  /// Replaces the terrain and continues to learn from it. Error: foreign_terrain.
  Status adopt(const Terrain& terrain);

  const Counters& counters() const;
  /// Duration of each stage of the last process(), in nanoseconds.
  const std::array<std::int64_t, stage_count>& stage_times() const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

} // namespace terrainseg
