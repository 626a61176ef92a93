// SPDX-License-Identifier: LGPL-2.1-or-later
// The whole filter without GStreamer: frames in, estimates out.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <string>
#include <utility>

#include "terrainseg/estimate.hpp"
#include "terrainseg/frame.hpp"
#include "terrainseg/settings.hpp"
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

/// Where the mask goes: bytes that the caller owns, mask_extent() of the frame's width x height of them.
/// Without one the segmenter keeps its own.
struct MaskTarget {
  MutablePlane plane;
  int width = 0, height = 0;
};

/// What stage_times() tells apart, in the order of the default pipeline.
enum class Stage : std::uint8_t {
  pyramid,    ///< the octave pyramid, and in the paper's pipeline the level that trains
  features,   ///< colour, texture and exposure of the cells, their bins, which of them are joined; nothing in
              ///< the paper's pipeline
  prefilter,  ///< the window: its cells, their pre-filter, whether they are foreign
  clustering, ///< training models
  update,     ///< of what is learned: the mixture, the histograms
  horizon,    ///< the paper's
  scoring,    ///< of the cells: likelihood ratios, penalties, averaging over frames
  boundary,   ///< and what follows from it: re-estimation, ground behind, doubtful ground, refinement, odd
              ///< spots, what motion tells, reach, the horizon's row
  mask        ///< written, how much of it is traversable, and how sure it is of each cell
};
inline constexpr int stage_count = 9;
TERRAINSEG_API const char* name_of(Stage stage);

/// Counts since the start; why a frame was not learned from.
struct Counters {
  std::uint64_t frames = 0;
  std::uint64_t learned = 0;
  std::uint64_t skipped_frozen = 0;  ///< learning = false
  std::uint64_t skipped_near = 0;    ///< near_clear = false
  std::uint64_t skipped_starved = 0; ///< flag_starved: too few usable window pixels, or a reason as good
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

/// Size of the mask of a frame: ceil(size / 2^mask_level).
constexpr int mask_extent(int frame_extent, int mask_level) {
  return subsampled(frame_extent, mask_level);
}

} // namespace terrainseg
