// SPDX-License-Identifier: LGPL-2.1-or-later
// What is known of one frame. A plain value with views into memory of its maker (Segmenter: valid until the
// next call of process(); an element that reads metadata: while the metadata's buffers are mapped).
#pragma once

#include <array>
#include <cstdint>
#include <span>

#include "terrainseg/frame.hpp"
#include "terrainseg/settings.hpp"

namespace terrainseg {

/// Values of a mask pixel.
inline constexpr std::uint8_t mask_not_traversable = 0;
inline constexpr std::uint8_t mask_doubtful = 128; ///< doubtful, ignored or unknown
inline constexpr std::uint8_t mask_traversable = 255;

/// Bits of Estimate::flags.
enum Flag : std::uint32_t {
  flag_learned = 1,       ///< this frame's window was learned
  flag_frozen = 2,        ///< nothing was learned because learning or near-clear is off
  flag_starved = 4,       ///< nothing was learned because too few window pixels were usable
  flag_unknown = 8,       ///< nothing is known: the mask is 128 everywhere
  flag_horizon_held = 16, ///< the horizon row is the last one, not this frame's
  flag_blocked = 32,      ///< free space ahead of the window is below blocked_below, or nothing is known
};

/// One learned Gaussian, in 8-bit units of the colour space it was learned in.
struct ModelSummary {
  std::array<std::uint16_t, 3> mean{};     ///< Q8: 256 = one 8-bit step
  std::array<std::uint32_t, 3> variance{}; ///< Q8 of the squared 8-bit step
  std::uint64_t mass = 0;                  ///< samples, after capping and forgetting
  std::array<std::uint8_t, 3> rgb{};       ///< the mean as full-range RGB, for drawing
};

struct Estimate {
  std::uint64_t frame = 0; ///< counts processed frames from 0
  int frame_width = 0, frame_height = 0;
  int horizon_row = -1; ///< row of the frame, 0 at the top; -1 = none
  std::uint8_t horizon_confidence = 0;
  GrayView mask;         ///< 0 not traversable, 128 doubtful or unknown, 255 traversable
  Rectangle mask_region; ///< where the mask lies in the frame, in frame pixels
  std::uint8_t confidence = 0;
  /// Per mask column: highest row (of the frame) of the free space that is reachable from the window without
  /// a break; frame height = none.
  std::span<const std::uint16_t> boundary;
  int traversable_permille = 0;       ///< share of the mask's pixels that are traversable
  Rectangle window;                   ///< the training window
  std::uint32_t model_generation = 0; ///< counts changes of what is learned
  std::uint32_t flags = flag_unknown;
  std::array<ModelSummary, max_models> models{};
  int model_count = 0;
};

} // namespace terrainseg
