// SPDX-License-Identifier: LGPL-2.1-or-later
// The settings as a table, for whoever offers them to people: properties, arguments, files, documentation.
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
  natural,  ///< std::uint32_t, the whole range
  truth,    ///< bool
  fraction, ///< written as a decimal fraction, kept in 1/scale
  choice,   ///< an enumeration, written as one of `choices`
};

/// Which pipeline a setting changes anything in.
enum class UsedBy : std::uint8_t { paper = 1, free_space = 2, both = 3 };

/// One value of an enumeration; its number is its place in the list.
struct Choice {
  const char* nick;
  const char* meaning;
};

/// One row of the table. Values are as the field keeps them: 1/scale of a fraction, 0 or 1 of a truth, the
/// place of a choice.
struct Setting {
  const char* name;
  const char* nick;
  const char* blurb;
  SettingKind kind;
  std::int64_t low, high;
  int scale;
  const char* unit; ///< empty where there is none
  std::span<const Choice> choices;
  std::int64_t standard, paper; ///< of the presets
  UsedBy used_by;
  bool stage;        ///< can be switched off by itself; a flag of the property `stages`
  bool controllable; ///< cheap enough to change with every frame
  std::int64_t (*get)(const Settings&);
  void (*set)(Settings&, std::int64_t);
};

/// All rows of settings.def: not `ignore-regions` and `window-rect`, nor power_of_two_window, which a preset
/// sets and nothing else.
TERRAINSEG_API std::span<const Setting> setting_table();
/// nullptr when there is none of that name.
TERRAINSEG_API const Setting* find_setting(std::string_view name);

/// Whether the pipeline that `settings` choose uses it.
TERRAINSEG_API bool is_used(const Setting& setting, const Settings& settings);
/// Whether its value says something that the pipeline does not do: it is not used, and not merely switched
/// off.
TERRAINSEG_API bool is_idle(const Setting& setting, const Settings& settings);

/// Decimal numbers travel in this unit, so that nothing but integers is needed to round them.
inline constexpr std::int64_t billion = 1'000'000'000;
/// The only place where a number that was written becomes a field: the nearest 1/scale, halves away from
/// zero.
TERRAINSEG_API std::int64_t kept_value(std::int64_t billionths, std::int64_t scale);
/// "-2.75" in billionths, further digits cut off; nothing when it is no such number.
TERRAINSEG_API std::optional<std::int64_t> billionths_of(std::string_view text);

/// A kept value as people write it.
TERRAINSEG_API std::string setting_text(const Setting& setting, std::int64_t value);
/// Sets what `name` names, `window-rect` too, from its text. On an error nothing is set.
TERRAINSEG_API std::optional<SettingsError> set_from_text(Settings& settings, std::string_view name,
                                                          std::string_view text);
/// "x,y,w,h" in fractions of the frame into 1/65536; empty text is the empty rectangle.
TERRAINSEG_API std::optional<SettingsError> parse_window_rect(std::string_view text, Rectangle& rect_q16);

} // namespace terrainseg
