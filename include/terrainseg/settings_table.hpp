// SPDX-License-Identifier: LGPL-2.1-or-later
// The settings as a table, for programs that offer them as properties, arguments, files or documentation.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "terrainseg/settings.hpp"

namespace terrainseg {

enum class SettingKind : std::uint8_t {
  whole,    ///< int
  natural,  ///< std::uint32_t, full range
  truth,    ///< bool
  fraction, ///< a decimal fraction in text, stored in 1/scale
  choice,   ///< an enumeration; in text one of `choices`
};

/// The pipelines that use a setting. none: its stage was removed; the setting is accepted and ignored for one
/// release.
enum class UsedBy : std::uint8_t { none = 0, paper = 1, free_space = 2, both = 3 };

/// One value of an enumeration. Its number is its index in the list.
struct Choice {
  const char* nick; ///< the value in text
  const char* meaning;
};

/// One row of the table. Values have the field's representation: 1/scale for a fraction, 0 or 1 for a truth,
/// the index for a choice.
struct Setting {
  const char* name;  ///< of the property and of the KEY in KEY=VALUE
  const char* nick;  ///< short title
  const char* blurb; ///< description
  SettingKind kind;
  std::int64_t low, high; ///< valid range, inclusive
  int scale;              ///< 1 unless the kind is fraction
  const char* unit;       ///< empty when it has none
  std::span<const Choice> choices;
  std::int64_t standard, paper; ///< values of the two presets
  UsedBy used_by;
  bool stage;        ///< a stage that can be switched off alone; a flag of the property `stages`
  bool controllable; ///< may change with every frame at little cost
  std::int64_t (*get)(const Settings&);
  void (*set)(Settings&, std::int64_t);
};

/// All rows of settings.def. Does not contain `ignore-regions` and `window-rect`, nor power_of_two_window,
/// which only a preset sets.
TERRAINSEG_API std::span<const Setting> setting_table();
/// Returns nullptr for an unknown name.
TERRAINSEG_API const Setting* find_setting(std::string_view name);

/// Whether the pipeline selected by `settings` uses the setting.
TERRAINSEG_API bool is_used(const Setting& setting, const Settings& settings);
/// Whether the setting has a value without effect: the selected pipeline does not use it, and the value does
/// not mean "off"; or no pipeline uses it.
TERRAINSEG_API bool is_idle(const Setting& setting, const Settings& settings);

/// Unit of decimal numbers in this interface, so that rounding needs only integers.
inline constexpr std::int64_t billion = 1'000'000'000;
/// Converts a parsed number to a field's value: the nearest multiple of 1/scale, halves away from zero. All
/// parsed numbers are rounded here.
TERRAINSEG_API std::int64_t kept_value(std::int64_t billionths, std::int64_t scale);
/// Parses a decimal number such as "-2.75" into billionths. Further digits are truncated. Returns nothing for
/// invalid text.
TERRAINSEG_API std::optional<std::int64_t> billionths_of(std::string_view text);

/// Formats a field's value as text.
TERRAINSEG_API std::string setting_text(const Setting& setting, std::int64_t value);
/// Sets the setting `name`, including `window-rect`, from text. On an error nothing is changed.
TERRAINSEG_API std::optional<SettingsError> set_from_text(Settings& settings, std::string_view name,
                                                          std::string_view text);
/// Parses "x,y,w,h" in fractions of the frame into 1/65536. Empty text gives the empty rectangle.
TERRAINSEG_API std::optional<SettingsError> parse_window_rect(std::string_view text, Rectangle& rect_q16);

} // namespace terrainseg
