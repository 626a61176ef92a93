// SPDX-License-Identifier: LGPL-2.1-or-later
// The whole filter without GStreamer: frames in, estimates out.
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

/// How a call ended. Errors leave the segmenter as it was.
class [[nodiscard]] Status {
 public:
  enum class Code : std::uint8_t {
    ok,
    bad_frame, ///< no known format, no planes, a size outside 1..32767, or a stride shorter than a row
    window_outside_frame, ///< the window that was set does not fit this frame
    bad_target,           ///< a mask target of the wrong size
    foreign_terrain,      ///< a Terrain of another colour space or shape, or that the other pipeline learned
  };
  Status() = default;
  Status(Code code, std::string message) : code_(code), message_(std::move(message)) {}
  bool ok() const { return code_ == Code::ok; }
  Code code() const { return code_; }
  const std::string& message() const { return message_; } ///< cause and what to do; empty when ok

 private:
  Code code_ = Code::ok;
  std::string message_;
};

/// The colour space that a Segmenter of these settings learns in from frames of `frames`: the default
/// pipeline brings all frames to full-range BT.601, the paper's learns in the colours that it is given.
TERRAINSEG_API ColorSpace learning_space(const Settings& settings, const ColorSpace& frames);

class TERRAINSEG_API Segmenter {
 public:
  /// `settings` must have passed validate().
  explicit Segmenter(const Settings& settings);
  ~Segmenter();
  Segmenter(Segmenter&&) noexcept;
  Segmenter& operator=(Segmenter&&) noexcept;

  /// Takes other validated settings from the next frame on. What was learned stays; fewer learned models drop
  /// the lightest, the other pipeline, which learns in other colours, starts anew.
  void configure(const Settings& settings);
  const Settings& settings() const;

  /// Labels one frame and learns from it. Allocates only when the frame's size, format or the settings
  /// changed.
  Status process(const Frame& frame, const Supervision& supervision = {}, const MaskTarget& target = {});
  const Estimate& estimate() const; ///< of the last successful process(); before it: unknown

  void reset();          ///< forgets the terrain and everything that spans frames
  void reset_temporal(); ///< after a seek: forgets what spans neighbouring frames, keeps the terrain

  Terrain terrain() const;              ///< a copy of what is learned
  Status adopt(const Terrain& terrain); ///< continues from it

  const Counters& counters() const;
  /// Nanoseconds that each stage of the last process() took.
  const std::array<std::int64_t, stage_count>& stage_times() const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

} // namespace terrainseg
