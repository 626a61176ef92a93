// SPDX-License-Identifier: LGPL-2.1-or-later
// All settings as one plain value. Each row of settings.def is a field here and a property of the GStreamer
// element `terrainseg`; the row documents its meaning and range. Names and units may differ: the field
// window_sigma_q8 is in 1/256, the property `window-sigma` is a decimal fraction. The fields below the rows
// are not in the table: the properties `window-rect` and `ignore-regions` use other notations, and `preset`
// sets power_of_two_window.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "terrainseg/frame.hpp"

namespace terrainseg {

enum class Preset : std::uint8_t { standard, paper }; ///< property values `default` and `paper`
/// paper: each pixel is labelled by its own colour. free_space: one boundary across the frame (default).
enum class PipelineKind : std::uint8_t { paper, free_space };
// Values of the settings of the same names; settings_table.hpp has their meanings (Setting::choices).
enum class HorizonMode : std::uint8_t { off, paper, automatic };
enum class Negatives : std::uint8_t { off, rest, split };
enum class Temporal : std::uint8_t { automatic, off, on };
enum class Motion : std::uint8_t { automatic, off };

/// Limits of the settings, also used for the ranges of the element's properties and in the documentation.
inline constexpr int max_models = 8;
inline constexpr int max_pyramid_levels = 6;
inline constexpr int max_mask_level = 5;
inline constexpr int max_threads = 16;

struct Settings {
  // One field per row of the table, initialised with the value of preset `default`. Fields that end in _q8
  // are in 1/256.
#define TERRAINSEG_SETTING(type, field, standard, ...) type field = standard;
#include "terrainseg/settings.def"
#undef TERRAINSEG_SETTING

  bool power_of_two_window = false; ///< window sides that are 0 follow the paper's rule 2^p x 2^q (section
                                    ///< 3.2)
  /// The training window in 1/65536 of the frame's width and height; fits every frame. When it is not empty,
  /// it replaces window_width, window_height, window_bottom and window_x.
  Rectangle window_rect_q16;
  std::vector<Rectangle> ignore_regions; ///< rectangles in pixels that are neither learned nor scored; the
                                         ///< mask is 128 there

  /// Returns the values of a preset, as listed in the documentation of `terrainseg`.
  TERRAINSEG_API static Settings of(Preset preset);

  /// The pipeline that runs. Only `free_space` selects it.
  constexpr PipelineKind pipeline() const {
    return free_space ? PipelineKind::free_space : PipelineKind::paper;
  }

  bool operator==(const Settings&) const = default;
};

/// An invalid setting, in readable form: the property, its value, and the range or rule that it violates.
struct SettingsError {
  std::string property;
  std::string value;
  std::string reason;
  /// "property = value: reason"
  std::string message() const { return property + " = " + value + ": " + reason; }
};

/// Returns the first error, or nothing. Validated settings alone never make Segmenter fail. Whether a window
/// fits a frame is checked with the frame (Status::Code::window_outside_frame).
TERRAINSEG_API std::optional<SettingsError> validate(const Settings& settings);

/// Returns the settings with a training window that fits a frame of this size: its sides are limited to the
/// frame's, then it is moved by the smallest distance. Use it to avoid Status::Code::window_outside_frame.
TERRAINSEG_API Settings with_fitting_window(Settings settings, int frame_width, int frame_height);

} // namespace terrainseg
