// SPDX-License-Identifier: LGPL-2.1-or-later
// Everything that can be set, as one plain value. A row of settings.def is a field here and a property of the
// GStreamer element `terrainseg`, and says what it means and may be. Their names and units may differ:
// window_sigma_q8, in 1/256, is `window-sigma`, a decimal fraction. What stands below the rows has no row:
// `window-rect` and `ignore-regions` are written otherwise there, power_of_two_window comes with `preset`.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "terrainseg/frame.hpp"

namespace terrainseg {

enum class Preset : std::uint8_t { standard, paper }; ///< property value `default` and `paper`
enum class PipelineKind : std::uint8_t { paper, free_space };
enum class HorizonMode : std::uint8_t { off, paper, automatic };
enum class Negatives : std::uint8_t { off, rest, split };
enum class Temporal : std::uint8_t { automatic, off, on };
enum class Motion : std::uint8_t { automatic, off };

/// Limits of the settings, shared with the element's property ranges and the docs.
inline constexpr int max_models = 8;
inline constexpr int max_pyramid_levels = 6;
inline constexpr int max_mask_level = 5;
inline constexpr int max_threads = 16;

struct Settings {
  // One field for each row of the table, with the value of preset `default`. Fields that end in _q8 are kept
  // in 1/256.
#define TERRAINSEG_SETTING(type, field, standard, ...) type field = standard;
#include "terrainseg/settings.def"
#undef TERRAINSEG_SETTING

  bool power_of_two_window = false; ///< rule of window sides that are 0: the paper's 2^p x 2^q
  /// The window in 1/65536 of the frame's width and height; where not empty it is used instead of
  /// window_width, window_height, window_bottom and window_x, and fits every frame.
  Rectangle window_rect_q16;
  std::vector<Rectangle> ignore_regions; ///< neither learned nor scored, mask 128

  /// The values of a preset: the table in the documentation of `terrainseg`.
  TERRAINSEG_API static Settings of(Preset preset);

  /// Which of the two pipelines runs: the only one that tells is `free_space`.
  constexpr PipelineKind pipeline() const {
    return free_space ? PipelineKind::free_space : PipelineKind::paper;
  }

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

/// The same settings with a window that fits a frame of this size: its sides cut to the frame's, then moved
/// by no more than it takes. For those who would rather go on than be told Status::window_outside_frame.
TERRAINSEG_API Settings with_fitting_window(Settings settings, int frame_width, int frame_height);

} // namespace terrainseg
