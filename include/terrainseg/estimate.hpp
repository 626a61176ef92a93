// SPDX-License-Identifier: LGPL-2.1-or-later
// The result for one frame. A plain value whose views point into memory of its producer. An estimate of
// Segmenter is valid until the next call of process(). An estimate that was read from metadata is valid while
// the metadata's buffers are mapped.
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
  flag_learned = 1, ///< the training window of this frame was learned
  flag_frozen = 2,  ///< not learned: learning or near-clear is false
  flag_starved = 4, ///< not learned: too few usable window pixels, an obstacle in the window, or a frame of a
                    ///< single colour apart from noise
  flag_unknown = 8, ///< no terrain is known: the mask is 128 everywhere
  flag_horizon_held = 16, ///< no horizon was found in this frame: the row of an earlier frame is kept, and
                          ///< its confidence decreases with each frame
  flag_blocked = 32,      ///< the share of free columns ahead of the window is below blocked_below, or no
                          ///< terrain is known
  flag_window_still = 64, ///< the picture above the training window changes, but the window does not: it
                          ///< shows the vehicle or a still picture. The confidence is a quarter
};

/// Summary of one learned model, in 8-bit units of the colour space in which it was learned.
struct ModelSummary {
  std::array<std::uint16_t, 3> mean{};     ///< Q8: 256 = one 8-bit step
  std::array<std::uint32_t, 3> variance{}; ///< Q8 of the squared 8-bit step
  std::uint64_t mass = 0;                  ///< samples, after mass-cap and forget-shift were applied
  std::array<std::uint8_t, 3> rgb{};       ///< the mean as full-range RGB, for drawing
};

/// The result for one frame.
struct Estimate {
  std::uint64_t frame = 0;               ///< number of the processed frame, from 0
  int frame_width = 0, frame_height = 0; ///< pixels
  int horizon_row = -1;                  ///< row of the frame, 0 at the top; -1 = not found
  std::uint8_t horizon_confidence = 0;   ///< 0 (not found) to 255
  std::int32_t vanishing_row = -1;       ///< row of the vanishing line, Q16 rows of the frame; -1 = unknown
  std::int32_t speed_over_height = 0;    ///< forward speed in camera heights, Q16 1/s; 0 = still or unknown
  GrayView mask;                         ///< 0 not traversable, 128 doubtful or unknown, 255 traversable
  Rectangle mask_region;       ///< the part of the frame that the mask covers, in pixels of the frame
  std::uint8_t confidence = 0; ///< 0 to 255: confidence of the whole mask
  /// Confidence of the mask's label per cell of the grid, stretched over mask_region: 255 * (2 p - 1), where
  /// p is the expected share of correct labels. 0 everywhere while no terrain is known. Empty where
  /// Settings::free_space is false.
  GrayView confidence_map;
  /// Per mask column: the highest row of the frame that belongs to free space connected to the training
  /// window. The frame's height = no free space.
  std::span<const std::uint16_t> boundary;
  int traversable_permille = 0;       ///< share of traversable mask pixels, 0..1000
  Rectangle window;                   ///< the training window, in pixels of the frame
  std::uint32_t model_generation = 0; ///< incremented at each change of the learned models
  std::uint32_t flags = flag_unknown;
  std::array<ModelSummary, max_models> models{};
  int model_count = 0;
};

/// Longest side of a frame or of a mask, in pixels.
inline constexpr int longest_picture_side = 32767;

/// Checks an estimate that comes from metadata of a program or from a KLV link. Returns a description of the
/// first invalid field, or nullptr when the estimate is valid. Checks the size of the mask, not its pixels.
inline const char* flaw_of(const Estimate& e) {
  const auto is_side = [](int length) { return length >= 1 && length <= longest_picture_side; };
  const auto is_inside = [&](const Rectangle& r) {
    return r.x >= 0 && r.y >= 0 && r.width >= 0 && r.height >= 0 && r.width <= e.frame_width &&
           r.height <= e.frame_height && r.x <= e.frame_width - r.width && r.y <= e.frame_height - r.height;
  };
  if (!is_side(e.frame_width) || !is_side(e.frame_height))
    return "the frame's width and height must be 1..32767";
  if (e.horizon_row < -1 || e.horizon_row >= e.frame_height)
    return "the horizon is outside the frame";
  if (e.vanishing_row < -1 || e.vanishing_row >= e.frame_height << 16)
    return "the ground's vanishing line is outside the frame";
  if (!is_inside(e.mask_region) || !is_inside(e.window))
    return "the mask or the window is outside the frame";
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
    return "the number of models or the traversable share is out of range";
  return nullptr;
}

} // namespace terrainseg
