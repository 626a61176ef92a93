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
  flag_learned = 1, ///< this frame's window was learned
  flag_frozen = 2,  ///< nothing was learned because learning or near-clear is off
  flag_starved = 4, ///< nothing was learned: too few usable window pixels, something stands in the window,
                    ///< or the frame is blank: of one colour, but for some noise
  flag_unknown = 8, ///< nothing is known: the mask is 128 everywhere
  flag_horizon_held = 16, ///< this frame shows no horizon: the row is the last one, less sure with each frame
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
  int horizon_row = -1;                ///< row of the frame, 0 at the top; -1 = none
  std::uint8_t horizon_confidence = 0; ///< 0 (none) to 255
  std::int32_t vanishing_row = -1;    ///< of the ground's vanishing line, Q16 rows of the frame; -1 = unknown
  std::int32_t speed_over_height = 0; ///< forward speed in camera heights, Q16 1/s; 0 = still or unknown
  GrayView mask;                      ///< 0 not traversable, 128 doubtful or unknown, 255 traversable
  Rectangle mask_region;              ///< where the mask lies in the frame, in frame pixels
  std::uint8_t confidence = 0;        ///< 0 (none) to 255: how far the whole mask can be trusted
  /// How sure the mask's label is of each cell of the grid, spread over the mask's region: 255 * (2 p - 1), p
  /// = the share of right labels to expect. 0 everywhere while nothing is known. Empty where free_space is
  /// off.
  GrayView confidence_map;
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

/// Longest side of a frame or of a mask, in pixels.
inline constexpr int longest_picture_side = 32767;

/// What an estimate that came from outside (metadata of a program, KLV from a link) holds that none can hold;
/// nullptr when it is sound. The mask's pixels are not looked at: only its size.
inline const char* flaw_of(const Estimate& e) {
  const auto is_side = [](int length) { return length >= 1 && length <= longest_picture_side; };
  const auto is_inside = [&](const Rectangle& r) {
    return r.x >= 0 && r.y >= 0 && r.width >= 0 && r.height >= 0 && r.width <= e.frame_width &&
           r.height <= e.frame_height && r.x <= e.frame_width - r.width && r.y <= e.frame_height - r.height;
  };
  if (!is_side(e.frame_width) || !is_side(e.frame_height))
    return "the frame's width and height must be 1..32767";
  if (e.horizon_row < -1 || e.horizon_row >= e.frame_height)
    return "the horizon lies outside the frame";
  if (e.vanishing_row < -1 || e.vanishing_row >= e.frame_height << 16)
    return "the ground's vanishing line lies outside the frame";
  if (!is_inside(e.mask_region) || !is_inside(e.window))
    return "the mask or the window lies outside the frame";
  const bool has_mask = e.mask.width != 0 || e.mask.height != 0;
  if (has_mask && (!is_side(e.mask.width) || !is_side(e.mask.height)))
    return "the mask's width and height must be 1..32767";
  const bool has_map = e.confidence_map.width != 0 || e.confidence_map.height != 0;
  if (has_map && (!is_side(e.confidence_map.width) || !is_side(e.confidence_map.height)))
    return "the confidence map's width and height must be 1..32767";
  if (e.boundary.size() > longest_picture_side ||
      (has_mask && !e.boundary.empty() && e.boundary.size() != static_cast<std::size_t>(e.mask.width)))
    return "the boundary does not have one row for every mask column";
  for (const std::uint16_t row : e.boundary)
    if (row > e.frame_height)
      return "the boundary holds rows outside the frame";
  if (e.model_count < 0 || e.model_count > max_models || e.traversable_permille < 0 ||
      e.traversable_permille > 1000)
    return "the models or the traversable share cannot be as many";
  return nullptr;
}

} // namespace terrainseg
