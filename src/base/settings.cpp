// SPDX-License-Identifier: LGPL-2.1-or-later
#include "terrainseg/settings.hpp"

#include <algorithm>
#include <array>
#include <limits>
#include <type_traits>

#include "terrainseg/settings_table.hpp"

namespace terrainseg {
namespace {

// ---- the table -------------------------------------------------------------------------------------------

// The identifiers that settings.def uses.
constexpr int longest_side = 32767;
constexpr int most_frames = 1 << 20;
constexpr UsedBy none = UsedBy::none, paper = UsedBy::paper, free_space = UsedBy::free_space,
                 both = UsedBy::both;
constexpr bool smoothly = true, rarely = false;

struct Range {
  SettingKind kind;
  std::int64_t low, high;
  int scale = 1;
  const char* unit = "";
  bool stage = false;
};
constexpr Range whole(int low, int high, const char* unit) {
  return {SettingKind::whole, low, high, 1, unit};
}
constexpr Range parts(int low, int high, const char* unit) {
  return {SettingKind::fraction, low * 256, high * 256, 256, unit};
}
constexpr Range any{SettingKind::natural, 0, std::numeric_limits<std::uint32_t>::max()};
constexpr Range truth{SettingKind::truth, 0, 1};
constexpr Range stage{SettingKind::truth, 0, 1, 1, "", true};
constexpr Range choice{SettingKind::choice, 0, 0}; // the upper limit follows from the number of choices

constexpr Choice horizon_modes[] = {
    {"off", "No horizon is reported"},
    {"paper", "The paper's split of the rows into two classes; nothing above the horizon is traversable"},
    {"auto", "The row that the highest columns of the boundary reach if the mask is confident enough, else "
             "the last row with decreasing confidence; it does not limit the mask (preset=paper: as paper)"}};
constexpr Choice negatives[] = {
    {"off", "All colours alike: only the distance to the terrain counts"},
    {"rest", "The colours of the frame outside the training window and the ground connected to it"},
    {"split", "As rest, but what the previous frame labelled as ground counts a quarter"}};
constexpr Choice temporal_modes[] = {{"auto", "When a frame resembles the previous one"},
                                     {"off", "Never: each frame by itself"},
                                     {"on", "Always"}};
constexpr Choice motion_modes[] = {{"auto", "When the camera moves and the ground moves as a plane"},
                                   {"off", "Motion is not used"}};
template <class Field> constexpr std::span<const Choice> choices_of() {
  if constexpr (std::is_same_v<Field, Motion>)
    return motion_modes;
  else if constexpr (std::is_same_v<Field, HorizonMode>)
    return horizon_modes;
  else if constexpr (std::is_same_v<Field, Negatives>)
    return negatives;
  else if constexpr (std::is_same_v<Field, Temporal>)
    return temporal_modes;
  else
    return {};
}

/// The strings of a row, and the properties that follow from its field's type.
template <class Field>
constexpr Setting row(const Range& range, Field standard, Field in_paper, UsedBy used_by, bool controllable,
                      const char* name, const char* nick, const char* blurb,
                      std::int64_t (*get)(const Settings&), void (*set)(Settings&, std::int64_t)) {
  const std::span<const Choice> choices = choices_of<Field>();
  return {name,
          nick,
          blurb,
          range.kind,
          range.low,
          choices.empty() ? range.high : static_cast<std::int64_t>(choices.size()) - 1,
          range.scale,
          range.unit,
          choices,
          static_cast<std::int64_t>(standard),
          static_cast<std::int64_t>(in_paper),
          used_by,
          range.stage,
          controllable,
          get,
          set};
}

#define TERRAINSEG_SETTING(type, field, standard, in_paper, range, used_by, changes, name, nick, blurb)      \
  row<type>(                                                                                                 \
      range, standard, in_paper, used_by, changes, name, nick, blurb,                                        \
      [](const Settings& settings) { return static_cast<std::int64_t>(settings.field); },                    \
      [](Settings& settings, std::int64_t value) { settings.field = static_cast<type>(value); }),
constexpr Setting table[] = {
#include "terrainseg/settings.def"
};
#undef TERRAINSEG_SETTING

// ---- texts -----------------------------------------------------------------------------------------------

std::string_view trimmed(std::string_view text) {
  text.remove_prefix(std::min(text.find_first_not_of(' '), text.size()));
  return text.substr(0, text.find_last_not_of(' ') + 1);
}

bool all_digits(std::string_view text) {
  return text.find_first_not_of("0123456789") == text.npos;
}

std::string nicks_of(const Setting& setting) {
  std::string all;
  for (const Choice& c : setting.choices)
    all.append(all.empty() ? "" : ", ").append(c.nick);
  return all;
}

std::string range_of(const Setting& setting) {
  std::string range = setting_text(setting, setting.low) + ".." + setting_text(setting, setting.high);
  if (*setting.unit)
    range.append(" ").append(setting.unit);
  return range;
}

std::optional<SettingsError> out_of_range(const Setting& setting, std::int64_t value) {
  if (value >= setting.low && value <= setting.high)
    return std::nullopt;
  return SettingsError{setting.name, setting_text(setting, value), "outside " + range_of(setting)};
}

struct Read {
  std::int64_t value = 0;
  std::string error; ///< the reason when there is no value
};

Read read(const Setting& setting, std::string_view text) {
  if (setting.kind == SettingKind::truth) {
    if (text == "true" || text == "false")
      return {text == "true", ""};
    return {0, "not one of false, true"};
  }
  if (setting.kind == SettingKind::choice) {
    for (std::size_t i = 0; i < setting.choices.size(); ++i)
      if (text == setting.choices[i].nick)
        return {static_cast<std::int64_t>(i), ""};
    return {0, "not one of " + nicks_of(setting)};
  }
  const bool fraction = setting.kind == SettingKind::fraction;
  const auto number = billionths_of(text);
  if (!number || (!fraction && *number % billion != 0))
    return {0, fraction ? "not a number" : "not a whole number"};
  return {kept_value(*number, setting.scale), ""};
}

} // namespace

std::span<const Setting> setting_table() {
  return table;
}

const Setting* find_setting(std::string_view name) {
  const auto* const found = std::ranges::find(table, name, &Setting::name);
  return found == std::end(table) ? nullptr : found;
}

bool is_used(const Setting& setting, const Settings& settings) {
  const UsedBy running = settings.free_space ? UsedBy::free_space : UsedBy::paper;
  return setting.used_by == UsedBy::both || setting.used_by == running;
}

bool is_idle(const Setting& setting, const Settings& settings) {
  // In the preset `paper`, settings of the default pipeline have the value that switches them off.
  const bool off = setting.used_by == UsedBy::free_space &&
                   setting.get(settings) == setting.get(Settings::of(Preset::paper));
  return setting.used_by == UsedBy::none || (!off && !is_used(setting, settings));
}

std::int64_t kept_value(std::int64_t billionths, std::int64_t scale) {
  // Converts the whole and the fractional part separately, because the product of a large number would
  // overflow.
  const std::int64_t units = billionths / billion, rest = billionths % billion;
  const std::int64_t half = rest < 0 ? -billion / 2 : billion / 2;
  return units * scale + (rest * scale + half) / billion;
}

std::optional<std::int64_t> billionths_of(std::string_view text) {
  constexpr std::size_t most_digits = 10; // digits of the whole part; keeps the product within 64 bits
  text = trimmed(text);
  const bool negative = text.starts_with('-');
  if (negative || text.starts_with('+'))
    text.remove_prefix(1);
  const std::size_t point = std::min(text.find('.'), text.size());
  const std::string_view units = text.substr(0, point),
                         decimals = text.substr(std::min(point + 1, text.size()));
  if ((units.empty() && decimals.empty()) || units.size() > most_digits || !all_digits(units) ||
      !all_digits(decimals))
    return std::nullopt;
  std::int64_t value = 0;
  for (const char digit : units)
    value = 10 * value + (digit - '0');
  // Rejects numbers whose product with a billion overflows; 4,294,967,295 is accepted.
  if (value > std::numeric_limits<std::int64_t>::max() / billion - 1)
    return std::nullopt;
  std::int64_t place = billion;
  value *= billion;
  for (const char digit : decimals)
    value += (digit - '0') * (place /= 10);
  return negative ? -value : value;
}

std::string setting_text(const Setting& setting, std::int64_t value) {
  if (setting.kind == SettingKind::truth)
    return value ? "true" : "false";
  if (setting.kind == SettingKind::choice && value >= 0 &&
      value < static_cast<std::int64_t>(setting.choices.size()))
    return setting.choices[value].nick;
  const std::int64_t magnitude = value < 0 ? -value : value;
  std::string text(value < 0 ? "-" : "");
  text += std::to_string(magnitude / setting.scale);
  // 1/256 has a finite decimal expansion of eight digits.
  if (std::int64_t rest = magnitude % setting.scale; rest > 0)
    for (text += '.'; rest > 0; rest = rest * 10 % setting.scale)
      text += static_cast<char>('0' + rest * 10 / setting.scale);
  return text;
}

std::optional<SettingsError> set_from_text(Settings& settings, std::string_view name, std::string_view text) {
  if (name == "window-rect")
    return parse_window_rect(text, settings.window_rect_q16);
  const Setting* setting = find_setting(name);
  if (!setting)
    return SettingsError{std::string(name), std::string(text), "no such setting"};
  const Read result = read(*setting, text);
  if (!result.error.empty())
    return SettingsError{setting->name, std::string(text), result.error};
  if (auto error = out_of_range(*setting, result.value))
    return SettingsError{setting->name, std::string(text), error->reason};
  setting->set(settings, result.value);
  return std::nullopt;
}

std::optional<SettingsError> parse_window_rect(std::string_view text, Rectangle& rect_q16) {
  if (trimmed(text).empty()) {
    rect_q16 = {};
    return std::nullopt;
  }
  const SettingsError wrong{
      "window-rect", std::string(text),
      "must be x,y,w,h in fractions of the frame, such as 0.35,0.85,0.3,0.15, or empty"};
  std::array<int, 4> sides{};
  std::string_view rest = text;
  for (std::size_t i = 0; i < sides.size(); ++i) {
    const std::size_t comma = rest.find(',');
    if ((comma == std::string_view::npos) != (i == 3))
      return wrong;
    const auto number = billionths_of(rest.substr(0, comma));
    if (!number)
      return wrong;
    if (*number < 0 || *number > billion)
      return SettingsError{"window-rect", std::string(text), "each number must lie in 0..1"};
    sides[i] = static_cast<int>(kept_value(*number, 65536));
    rest.remove_prefix(i == 3 ? rest.size() : comma + 1);
  }
  Settings trial;
  trial.window_rect_q16 = {sides[0], sides[1], sides[2], sides[3]};
  if (trial.window_rect_q16.empty())
    return SettingsError{"window-rect", std::string(text), "width and height must be above 0"};
  if (auto error = validate(trial))
    return SettingsError{"window-rect", std::string(text), error->reason};
  rect_q16 = trial.window_rect_q16;
  return std::nullopt;
}

Settings Settings::of(Preset preset) {
  Settings settings;
  if (preset == Preset::standard)
    return settings;
  settings.power_of_two_window = true;
  for (const Setting& setting : table)
    setting.set(settings, setting.paper);
  return settings;
}

std::optional<SettingsError> validate(const Settings& s) {
  for (const Setting& setting : table)
    if (auto error = out_of_range(setting, setting.get(s)))
      return error;
  if (s.learned_models <= s.training_models)
    return SettingsError{"learned-models", std::to_string(s.learned_models),
                         "must be above training-models = " + std::to_string(s.training_models)};
  // Rounding to 1/65536 can make the sum of position and size exceed 1 by one unit.
  const Rectangle& r = s.window_rect_q16;
  constexpr int one = 65536;
  if (!r.empty() && (r.x < 0 || r.y < 0 || r.x > one || r.y > one || r.width > one || r.height > one ||
                     r.x + r.width > one + 1 || r.y + r.height > one + 1))
    return SettingsError{"window-rect",
                         std::to_string(r.x) + "," + std::to_string(r.y) + "," + std::to_string(r.width) +
                             "," + std::to_string(r.height) + " (1/65536)",
                         "reaches out of the frame: x + w and y + h must be at most 1"};
  return std::nullopt;
}

} // namespace terrainseg
