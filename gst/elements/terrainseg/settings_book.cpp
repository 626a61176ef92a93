// SPDX-License-Identifier: LGPL-2.1-or-later
#include "elements/terrainseg/settings_book.hpp"

#include <cmath>
#include <iterator>
#include <vector>

#include "support/properties.hpp"
#include "terrainseg/estimate.hpp"
#include "terrainseg/settings_table.hpp"

namespace terrainseg {

void put_regions(const std::vector<Rectangle>& regions, GValue* array) {
  for (const Rectangle& r : regions) {
    GValue inner = G_VALUE_INIT;
    g_value_init(&inner, GST_TYPE_ARRAY);
    for (int number : {r.x, r.y, r.width, r.height}) {
      GValue value = G_VALUE_INIT;
      g_value_init(&value, G_TYPE_INT);
      g_value_set_int(&value, number);
      gst_value_array_append_and_take_value(&inner, &value);
    }
    gst_value_array_append_and_take_value(array, &inner);
  }
}

namespace {

// ---- enumerations ----------------------------------------------------------------------------------------

constexpr Choice presets[] = {
    {"default", "The default pipeline with all stages"},
    {"paper", "The paper's algorithm and parameters only"},
};
constexpr Choice resets[] = {
    {"never", "Only by the reset signal or a change of colour space"},
    {"stream", "At a new stream, and when the element goes to READY"},
    {"discont", "As stream, and at every discontinuity"},
    {"per-stream", "Never: a separate terrain is kept for each stream id"},
};

/// "row-prior" -> "GstTerrainSegRowPrior".
std::string type_name_of(const char* name) {
  std::string text = "GstTerrainSeg";
  bool capital = true;
  for (; *name; ++name) {
    if (*name != '-')
      text += capital ? g_ascii_toupper(*name) : *name;
    capital = *name == '-';
  }
  return text;
}

/// The stages of the core's table as flags, one bit a stage in the table's order.
GType stages_type() {
  static const GType type = [] {
    static std::vector<GFlagsValue> values;
    for (const Setting& setting : setting_table())
      if (setting.stage)
        values.push_back({1u << values.size(), setting.name, setting.name}); // GStreamer writes the first
    values.push_back({0, nullptr, nullptr});
    const GType made = g_flags_register_static("GstTerrainSegStages", values.data());
    gst_type_mark_as_plugin_api(made, static_cast<GstPluginAPIFlags>(0));
    return made;
  }();
  return type;
}

// ---- the tables ------------------------------------------------------------------------------------------

guint stages_of(const Settings& settings) {
  guint flags = 0, bit = 1;
  for (const Setting& setting : setting_table())
    if (setting.stage) {
      flags |= setting.get(settings) ? bit : 0;
      bit <<= 1;
    }
  return flags;
}

const Field<ElementSettings> stages_field = {
    .spec =
        [](const Property<ElementSettings>& p) {
          return g_param_spec_flags(p.name, p.nick, p.blurb, stages_type(), stages_of(Settings{}), p.flags);
        },
    .get = [](const ElementSettings& s, GValue* value) { g_value_set_flags(value, stages_of(s.core)); }};
const Field<ElementSettings> regions_field = {
    .spec =
        [](const Property<ElementSettings>& p) {
          return gst_param_spec_array(p.name, p.nick, p.blurb, nullptr, p.flags);
        },
    .get = [](const ElementSettings& s, GValue* value) { put_regions(s.core.ignore_regions, value); }};

/// The rows of own_table that are more than a field.
enum Special : guint { special_preset, special_stages, special_window_rect, special_ignore_regions };

/// The element's own.
constexpr auto drawing = overlay_rows<&ElementSettings::drawing>();
const Property<ElementSettings> own_table[] = {
    {"preset", "Preset",
     "Chooses the pipeline and the values of all settings that are not set explicitly (not of drawing, "
     "ranges and files)",
     property_playing, field<&ElementSettings::preset>("GstTerrainSegPreset", presets)},
    {"stages", "Stages", "Stages of the default pipeline that run (not used with preset=paper)",
     property_playing, stages_field},
    {"window-rect", "Window rectangle",
     "Training window as x,y,w,h in fractions of the frame, for frames of any size; empty = window-width, "
     "window-height, window-bottom and window-x in pixels",
     property_playing, field<&ElementSettings::window_rect>()},
    {"ignore-regions", "Ignore regions",
     "Rectangles <<x, y, width, height>, ...> in pixels to exclude from learning and scoring, such as a "
     "bonnet or burnt-in text",
     property_playing, regions_field},
    drawing[0],
    drawing[1],
    drawing[2],
    {"reset-on", "Reset on", "When the learned terrain is reset automatically", property_playing,
     field<&ElementSettings::reset_on>("GstTerrainSegResetOn", resets)},
    {"overlay", "Overlay", "Draw the result onto the frame; the frame is then written to",
     property_controllable, field<&ElementSettings::overlay>()},
    {"post-messages", "Post messages",
     "Post an element message 'terrainseg' on the bus when the result changes, and once a second",
     property_playing, field<&ElementSettings::post_messages>()},
    {"model-location", "Model location",
     "Path of a learned-terrain file to read at start; a missing or damaged file is an error",
     property_before_start, field<&ElementSettings::model_location>()},
    {"settings-location", "Settings location",
     "Path of a key file whose group [terrainseg] sets properties at start, except those set explicitly; a "
     "missing or invalid file is an error",
     property_before_start, field<&ElementSettings::settings_location>()},
    {"camera-info", "Camera info",
     "Path of the camera's calibration file (ROS camera_info, Kalibr or OpenCV YAML); with mount it enables "
     "ranges in metres. A missing or invalid file is an error",
     property_before_start, field<&ElementSettings::camera_info>()},
    {"mount", "Mount",
     "Pose of the camera over the ground: the path of a YAML file, or text such as height=0.5,pitch=10deg "
     "(also roll, yaw, x, y, pitch-error) in metres, and in radians or degrees",
     property_before_start, field<&ElementSettings::mount>()},
    {"range-max", "Range maximum",
     "Largest range in metres; a column that is free beyond it is reported as free, 0 = the distance at "
     "which the expected error reaches 20 %",
     property_controllable, field<&ElementSettings::range_max>(0, 10000)},
    {"start-time", "Start time",
     "Time of day of PTS 0, as ISO 8601 (2026-11-21T20:00:00Z) or nanoseconds since 1970; frames without a "
     "time of day get it as a reference time stamp",
     property_before_start, field<&ElementSettings::start_time>()},
    {"veto-roi-types", "Veto ROI types",
     "Types of GstVideoRegionOfInterestMeta whose rectangles are never traversable and are not learned, such "
     "as person,car; * = all types",
     property_playing, field<&ElementSettings::veto_roi_types>()},
#ifdef TERRAINSEG_ANALYTICS
    {"analytics-meta", "Analytics metadata", "Also attach the standard GstAnalytics segmentation metadata",
     property_playing, field<&ElementSettings::analytics>()},
#endif
};

// Ids in this order: the core's rows from 1 on, the element's own.
guint row_count() {
  return static_cast<guint>(setting_table().size());
}
guint id_of(Special special) {
  return row_count() + 1 + special;
}
bool is_row(guint id) {
  return id <= row_count();
}
const Setting& row_of(guint id) {
  return setting_table()[id - 1];
}
const Property<ElementSettings>& own_of(guint id) {
  return own_table[id - row_count() - 1];
}

/// By id; filled once, when the class is made.
std::array<GParamSpec*, SettingsBook::capacity> specs;

guint id_named(const char* name) {
  for (guint id = 1; id <= SettingsBook::last_id(); ++id)
    if (g_str_equal(specs[id]->name, name))
      return id;
  return 0;
}

GParamSpec* spec_of(const Setting& s) {
  const char* only = s.used_by == UsedBy::paper        ? " (used with preset=paper only)"
                     : s.used_by == UsedBy::free_space ? " (not used with preset=paper)"
                                                       : "";
  const char* deprecated = s.used_by == UsedBy::none           ? "Deprecated, ignored. "
                           : s.stage                           ? "Deprecated, use stages. "
                           : g_str_equal(s.name, "free-space") ? "Deprecated, use preset. "
                                                               : nullptr;
  const std::string blurb = std::string(deprecated ? deprecated : "") + s.blurb + only;
  int bits = s.controllable ? property_controllable : property_playing;
  bits &= ~G_PARAM_STATIC_BLURB; // GLib keeps a copy
  const auto flags = static_cast<GParamFlags>(bits | (deprecated ? G_PARAM_DEPRECATED : 0));
  switch (s.kind) {
  case SettingKind::natural:
    return g_param_spec_uint(s.name, s.nick, blurb.c_str(), static_cast<guint>(s.low),
                             static_cast<guint>(s.high), static_cast<guint>(s.standard), flags);
  case SettingKind::truth:
    return g_param_spec_boolean(s.name, s.nick, blurb.c_str(), s.standard != 0, flags);
  case SettingKind::fraction:
    return g_param_spec_double(s.name, s.nick, blurb.c_str(), static_cast<double>(s.low) / s.scale,
                               static_cast<double>(s.high) / s.scale,
                               static_cast<double>(s.standard) / s.scale, flags);
  case SettingKind::choice:
    return g_param_spec_enum(s.name, s.nick, blurb.c_str(),
                             choice_type(type_name_of(s.name).c_str(), s.choices),
                             static_cast<gint>(s.standard), flags);
  default:
    return g_param_spec_int(s.name, s.nick, blurb.c_str(), static_cast<gint>(s.low),
                            static_cast<gint>(s.high), static_cast<gint>(s.standard), flags);
  }
}

/// What a GValue of a row's type says, as the field keeps it.
std::int64_t kept(const Setting& setting, const GValue* value) {
  if (setting.kind == SettingKind::fraction)
    return kept_value(std::llround(g_value_get_double(value) * static_cast<double>(billion)), setting.scale);
  GValue number = G_VALUE_INIT;
  g_value_init(&number, G_TYPE_INT64);
  g_value_transform(value, &number);
  return g_value_get_int64(&number);
}

// ---- ignore-regions --------------------------------------------------------------------------------------

bool integers(const GValue* array, std::vector<int>& numbers) {
  for (guint i = 0; i < gst_value_array_get_size(array); ++i) {
    const GValue* value = gst_value_array_get_value(array, i);
    if (!G_VALUE_HOLDS_INT(value))
      return false;
    numbers.push_back(g_value_get_int(value));
  }
  return true;
}

/// Takes <<x, y, w, h>, ...> and, for one rectangle or several, the flat <x, y, w, h, ...>.
bool numbers_of(const GValue* array, std::vector<int>& numbers) {
  for (guint i = 0; i < gst_value_array_get_size(array); ++i) {
    const GValue* value = gst_value_array_get_value(array, i);
    if (!GST_VALUE_HOLDS_ARRAY(value)) // flat
      return i == 0 && integers(array, numbers) && numbers.size() % 4 == 0;
    if (gst_value_array_get_size(value) != 4 || !integers(value, numbers))
      return false;
  }
  return true;
}

} // namespace

// ---- the class -------------------------------------------------------------------------------------------

void SettingsBook::install(GObjectClass* object_class) {
  for (guint id = 1; id <= last_id(); ++id) {
    specs.at(id) = is_row(id) ? spec_of(row_of(id)) : own_of(id).field.spec(own_of(id));
    g_object_class_install_property(object_class, id, specs[id]);
  }
}

guint SettingsBook::last_id() {
  return row_count() + static_cast<guint>(std::size(own_table));
}

void SettingsBook::notify(gpointer object, const Ids& changed) {
  for (guint id = 1; id <= last_id(); ++id)
    if (changed.test(id))
      g_object_notify_by_pspec(G_OBJECT(object), specs[id]);
}

// ---- setting ---------------------------------------------------------------------------------------------

SettingsBook::Ids SettingsBook::set(guint id, const GValue* value) {
  return changed_by([&] { apply(id, value, Layer::user); });
}

/// What users read of the rows, the preset and the stages, by id.
std::array<double, SettingsBook::capacity> SettingsBook::shown() const {
  std::array<double, capacity> values{};
  for (guint id = 1; id <= row_count(); ++id) {
    const Setting& row = row_of(id);
    values[id] = pinned().test(id) && row.kind == SettingKind::fraction
                     ? as_set_[id]
                     : static_cast<double>(row.get(settings_.core)) / row.scale;
  }
  values[id_of(special_preset)] = static_cast<double>(settings_.preset);
  values[id_of(special_stages)] = stages_of(settings_.core);
  return values;
}

template <class Change> SettingsBook::Ids SettingsBook::changed_by(Change change) {
  const auto before = shown();
  change();
  ++sequence_;
  const auto after = shown();
  Ids changed;
  for (guint id = 1; id <= last_id(); ++id)
    changed.set(id, before[id] != after[id]);
  return changed;
}

void SettingsBook::apply(guint id, const GValue* value, Layer layer) {
  if (id == id_of(special_stages))
    return apply_stages(g_value_get_flags(value), layer);
  if (layer == Layer::file && explicit_.test(id))
    return;
  (layer == Layer::user ? explicit_ : from_file_).set(id);
  if (is_row(id)) {
    const Setting& row = row_of(id);
    if (row.kind == SettingKind::fraction)
      as_set_[id] = g_value_get_double(value);
    row.set(settings_.core, kept(row, value));
  } else
    store(id, value);
}

/// One of own_table, but not the stages.
void SettingsBook::store(guint id, const GValue* value) {
  if (id == id_of(special_ignore_regions))
    return set_ignore_regions(value);
  own_of(id).field.set(settings_, value);
  if (id == id_of(special_preset))
    choose_preset();
  if (id == id_of(special_window_rect))
    rect_error_ = parse_window_rect(settings_.window_rect, settings_.core.window_rect_q16);
}

void SettingsBook::apply_stages(guint flags, Layer layer) {
  GValue value = G_VALUE_INIT;
  g_value_init(&value, G_TYPE_BOOLEAN);
  guint bit = 1;
  for (guint id = 1; id <= row_count(); ++id)
    if (row_of(id).stage) {
      g_value_set_boolean(&value, (flags & bit) != 0);
      if (row_of(id).used_by == UsedBy::none && !(flags & bit))
        give_back(id); // not named: nothing to warn of
      else
        apply(id, &value, layer);
      bit <<= 1;
    }
}

void SettingsBook::choose_preset() {
  const Settings fresh = Settings::of(settings_.preset);
  settings_.core.power_of_two_window = fresh.power_of_two_window;
  for (guint id = 1; id <= row_count(); ++id)
    if (!pinned().test(id))
      row_of(id).set(settings_.core, row_of(id).get(fresh));
}

void SettingsBook::set_ignore_regions(const GValue* value) {
  std::vector<int> numbers;
  std::vector<Rectangle> regions;
  bool good = numbers_of(value, numbers);
  for (std::size_t i = 0; good && i + 3 < numbers.size(); i += 4) {
    const Rectangle r{numbers[i], numbers[i + 1], numbers[i + 2], numbers[i + 3]};
    good = r.x >= 0 && r.y >= 0 && !r.empty() && r.x <= longest_picture_side && r.y <= longest_picture_side &&
           r.width <= longest_picture_side && r.height <= longest_picture_side;
    regions.push_back(r);
  }
  regions_error_.reset();
  if (good) {
    settings_.core.ignore_regions = std::move(regions);
    return;
  }
  g_autofree gchar* text = gst_value_serialize(value);
  regions_error_ =
      SettingsError{"ignore-regions", text ? text : "(unreadable)",
                    "must be <<x, y, width, height>, ...> in pixels, x and y from 0, sizes from 1"};
}

// ---- giving back -----------------------------------------------------------------------------------------

bool SettingsBook::unset(const char* name, Ids& changed) {
  const guint only = name ? id_named(name) : 0;
  if (name && !only)
    return false;
  Ids others = pinned();
  changed |= changed_by([&] {
    for (guint id = only ? only : 1; id <= (only ? only : last_id()); ++id)
      give_back(id);
  });
  // Properties without a number are notified if they had been set.
  for (guint id = 1; id <= row_count(); ++id)
    others.reset(id);
  if (only)
    others &= Ids().set(only);
  changed |= others;
  return true;
}

void SettingsBook::give_back(guint id) {
  explicit_.reset(id);
  from_file_.reset(id);
  if (is_row(id)) {
    row_of(id).set(settings_.core, row_of(id).get(Settings::of(settings_.preset)));
  } else if (id == id_of(special_stages)) {
    for (guint row = 1; row <= row_count(); ++row)
      if (row_of(row).stage)
        give_back(row);
  } else {
    g_auto(GValue) value = G_VALUE_INIT;
    g_value_init(&value, specs[id]->value_type);
    g_param_value_set_default(specs[id], &value);
    store(id, &value);
  }
}

// ---- the settings file -----------------------------------------------------------------------------------

SettingsFile read_settings_file(const std::string& path) {
  constexpr const char* group = "terrainseg";
  SettingsFile file{path, {}, {}};
  g_autoptr(GKeyFile) keys = g_key_file_new();
  g_autoptr(GError) problem = nullptr;
  if (!g_key_file_load_from_file(keys, path.c_str(), G_KEY_FILE_NONE, &problem))
    return {path, {}, problem->message};
  g_auto(GStrv) names = g_key_file_get_keys(keys, group, nullptr, nullptr);
  if (!names)
    return {path, {}, std::string("it has no group [") + group + "]"};
  for (gchar** name = names; *name; ++name) {
    g_autofree gchar* value = g_key_file_get_string(keys, group, *name, &problem);
    if (!value)
      return {path, {}, problem->message};
    file.entries.push_back({*name, value});
  }
  return file;
}

std::optional<SettingsError> SettingsBook::take_file(const SettingsFile& file, Ids& changed) {
  SettingsBook trial = *this;
  std::optional<SettingsError> error;
  const Ids told = trial.changed_by([&] {
    const Ids earlier = trial.from_file_ & ~trial.explicit_;
    for (guint id = 1; id <= last_id(); ++id)
      if (earlier.test(id))
        trial.give_back(id);
    for (const SettingsFile::Entry& entry : file.entries)
      if (!error)
        error = trial.apply_entry(entry);
  });
  if (error)
    return error;
  // Properties without a number are notified if the file has them.
  for (guint id = row_count() + 1; id <= last_id(); ++id)
    if (trial.from_file_.test(id) || from_file_.test(id))
      changed.set(id);
  changed |= told;
  *this = trial;
  return std::nullopt;
}

std::optional<SettingsError> SettingsBook::apply_entry(const SettingsFile::Entry& entry) {
  const guint id = id_named(entry.name.c_str());
  if (!id || entry.name == "settings-location")
    return SettingsError{entry.name, entry.value, "terrainseg has no such property that a file could set"};
  if (is_row(id) || id == id_of(special_window_rect)) { // the core says best what is wrong
    Settings trial;
    if (auto error = set_from_text(trial, entry.name, entry.value))
      return error;
  }
  g_auto(GValue) value = G_VALUE_INIT;
  g_value_init(&value, specs[id]->value_type);
  if (!gst_value_deserialize_with_pspec(&value, entry.value.c_str(), specs[id]))
    return SettingsError{entry.name, entry.value,
                         std::string("cannot be read as ") + g_type_name(specs[id]->value_type)};
  if (g_param_value_validate(specs[id], &value))
    return SettingsError{entry.name, entry.value, "is out of range"};
  apply(id, &value, Layer::file);
  return regions_error_;
}

// ---- getting ---------------------------------------------------------------------------------------------

void SettingsBook::get(guint id, GValue* value) const {
  if (!is_row(id))
    return own_of(id).field.get(settings_, value);
  if (row_of(id).kind == SettingKind::fraction)
    return g_value_set_double(value, shown()[id]);
  GValue number = G_VALUE_INIT;
  g_value_init(&number, G_TYPE_INT64);
  g_value_set_int64(&number, row_of(id).get(settings_.core));
  g_value_transform(&number, value);
}

std::optional<SettingsError> SettingsBook::error() const {
  if (regions_error_)
    return regions_error_;
  return rect_error_ ? rect_error_ : validate(settings_.core);
}

std::string SettingsBook::take_unused() {
  std::string names;
  for (guint id = 1; id <= row_count(); ++id) {
    const Setting& row = row_of(id);
    if (!pinned().test(id) || told_.test(id) || !is_idle(row, settings_.core))
      continue;
    told_.set(id);
    names.append(names.empty() ? "" : ", ").append(row.name);
  }
  return names;
}

} // namespace terrainseg
