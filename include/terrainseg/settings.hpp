// SPDX-License-Identifier: LGPL-2.1-or-later
// Everything that can be set, as one plain value. Each field is the property of the same name of the
// GStreamer element `terrainseg`; ranges are those of validate().
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "terrainseg/frame.hpp"

namespace terrainseg {

enum class Preset : std::uint8_t { standard, paper }; ///< property value `default` and `paper`
enum class HorizonMode : std::uint8_t { off, paper, automatic };
enum class Negatives : std::uint8_t { off, rest, split };
enum class Temporal : std::uint8_t { automatic, off, on };

/// Limits of the settings, shared with the element's property ranges and the docs.
inline constexpr int max_models = 8;
inline constexpr int max_pyramid_levels = 6;
inline constexpr int max_mask_level = 5;
inline constexpr int max_threads = 16;

struct Settings {
  // The training window (paper, section 3.2).
  int window_width = 0;      ///< pixels; 0 = by the preset's rule
  int window_height = 0;     ///< pixels; 0 = by the preset's rule
  int window_bottom = 0;     ///< rows between the window and the bottom edge
  int window_x = -1;         ///< left edge in pixels, -1 = centred
  int window_sigma_q8 = 320; ///< pre-filter, standard deviations in Q8 (320 = 1.25), 0..1024
  bool power_of_two_window =
      false; ///< rule for 0: false 30 % x 15 % of the frame, true the paper's 2^p x 2^q
  std::vector<Rectangle> ignore_regions; ///< neither learned nor scored, mask 128

  // Scale and colour (paper, sections 3.1 and 3.3).
  int pyramid_levels = -1; ///< -1 = first level under 96 cells wide, 0..6
  int bit_shift = 4;       ///< 0..7, the perception sub-space of the paper's scoring

  // Learning (paper, section 3.4).
  int training_models = 1;      ///< K, 1..8
  int learned_models = 5;       ///< N, 1..8, above K
  int match_threshold_q8 = 256; ///< equation (13), squared distance in Q8, 0..4096
  int mass_cap = 0;             ///< frames of window samples; 0 = off
  int forget_shift = 5;         ///< masses fade by >> this every learned frame; 0 = off, 1..15
  std::uint32_t seed = 1;       ///< of the random centres
  bool learning = true;
  bool near_clear =
      true; ///< the proximity sensor: false = the window may hold an obstacle, nothing is learned

  // Scoring and the stages beyond the paper.
  int threshold_q8 = 512; ///< standard deviations in Q8, 0..4096
  HorizonMode horizon = HorizonMode::automatic;
  bool texture = true;
  bool exposure = true;
  bool row_prior = true;
  bool local_reference = true;
  bool geodesic = true;
  bool second_look = true;
  bool free_space = true;
  bool ground_behind = true;
  bool refine = true;
  Negatives negatives = Negatives::rest;
  Temporal temporal = Temporal::automatic;
  int caution = 0;         ///< -32..32, 32 = 1 nat
  int doubtful = -24;      ///< -96..96, 32 = 1 nat; -96 = off
  int mask_level = 0;      ///< 0..5: the mask is 2^level times smaller than the frame
  int blocked_below = 200; ///< permille of the columns ahead of the window that are free, 0..1000
  int n_threads = 1;       ///< 0..16, 0 = as many as help

  /// The values of a preset: the table in the documentation of `terrainseg`.
  TERRAINSEG_API static Settings of(Preset preset);

  bool operator==(const Settings&) const = default;
};

/// What is wrong with a setting, for a person: which property, its value, and the range or the rule it
/// breaks.
struct SettingsError {
  std::string property;
  std::string value;
  std::string reason;
  /// "property = value: reason"
  std::string message() const { return property + " = " + value + ": " + reason; }
};

/// The first error, or nothing. Settings that pass here never make Segmenter fail by themselves; whether a
/// window fits a frame is known only with the frame (Status::window_outside_frame).
TERRAINSEG_API std::optional<SettingsError> validate(const Settings& settings);

} // namespace terrainseg
