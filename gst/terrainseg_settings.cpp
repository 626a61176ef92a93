// SPDX-License-Identifier: LGPL-2.1-or-later
#include "terrainseg_settings.hpp"

#include <cmath>
#include <span>
#include <variant>

namespace terrainseg {
namespace {

// ---- enumerations ----------------------------------------------------------------------------------------

GType register_enum(const char* name, const GEnumValue* values) {
  return g_enum_register_static(name, values);
}
constexpr GEnumValue enum_end = {0, nullptr, nullptr};
template <class Enum> constexpr GEnumValue choice(Enum value, const char* nick, const char* meaning) {
  return {static_cast<int>(value), meaning, nick};
}

GType type_of(Preset) {
  static const GEnumValue values[] = {
      choice(Preset::standard, "default", "The pipeline with all stages"),
      choice(Preset::paper, "paper", "The paper's algorithm and parameters, nothing else"), enum_end};
  static const GType type = register_enum("GstTerrainSegPreset", values);
  return type;
}
GType type_of(HorizonMode) {
  static const GEnumValue values[] = {
      choice(HorizonMode::off, "off", "No horizon is looked for"),
      choice(HorizonMode::paper, "paper", "The paper's split of the rows into two classes"),
      choice(HorizonMode::automatic, "auto", "Robust split with a null, smoothed over frames"), enum_end};
  static const GType type = register_enum("GstTerrainSegHorizon", values);
  return type;
}
GType type_of(Negatives) {
  static const GEnumValue values[] = {
      choice(Negatives::off, "off", "Nothing: distance to the terrain alone"),
      choice(Negatives::rest, "rest", "The colours of the rest of the frame"),
      choice(Negatives::split, "split", "The rest of the frame, sky and ground apart"), enum_end};
  static const GType type = register_enum("GstTerrainSegNegatives", values);
  return type;
}
GType type_of(Temporal) {
  static const GEnumValue values[] = {
      choice(Temporal::automatic, "auto", "Where frames follow each other closely"),
      choice(Temporal::off, "off", "Every frame for itself"), choice(Temporal::on, "on", "Always"), enum_end};
  static const GType type = register_enum("GstTerrainSegTemporal", values);
  return type;
}
GType type_of(ResetOn) {
  static const GEnumValue values[] = {
      choice(ResetOn::never, "never", "Only by the reset signal or another colour space"),
      choice(ResetOn::stream, "stream", "With a new stream and when the element goes to READY"),
      choice(ResetOn::discont, "discont", "As stream, and with every discontinuity"), enum_end};
  static const GType type = register_enum("GstTerrainSegResetOn", values);
  return type;
}

// ---- the table -------------------------------------------------------------------------------------------

/// A fixed-point member that users see as a fraction.
struct Fraction {
  int Settings::*q8;
};
using Member = std::variant<int Settings::*, std::uint32_t Settings::*, bool Settings::*, Fraction,
                            HorizonMode Settings::*, Negatives Settings::*, Temporal Settings::*>;

struct Row {
  const char* name;
  const char* nick;
  const char* blurb;
  Member member;
  int low = 0, high = 0; ///< of numbers; whole units of a fraction
  bool controllable = true;
};

constexpr int longest_side = 32767;
constexpr int most_frames = 1 << 20;

const Row rows[] = {
    {"window-width", "Window width",
     "Width of the training window in pixels, 0 = by the preset's rule (30 % of the frame width)",
     &Settings::window_width, 0, longest_side},
    {"window-height", "Window height",
     "Height of the training window in pixels, 0 = by the preset's rule (15 % of the frame height)",
     &Settings::window_height, 0, longest_side},
    {"window-bottom", "Window bottom",
     "Rows in pixels between the training window and the bottom edge of the frame, for a bonnet in view",
     &Settings::window_bottom, 0, longest_side},
    {"window-x", "Window x", "Left edge of the training window in pixels, -1 = centred", &Settings::window_x,
     -1, longest_side},
    {"window-sigma", "Window sigma",
     "Smoothing of the training pixels in standard deviations of coarse cells, 0 = off",
     Fraction{&Settings::window_sigma_q8}, 0, 4},
    {"pyramid-levels", "Pyramid levels",
     "Octaves by which the frame is reduced before anything is learned, -1 = first level under 96 cells wide",
     &Settings::pyramid_levels, -1, max_pyramid_levels},
    {"bit-shift", "Bit shift",
     "Bits dropped from each colour component in the perception sub-space, more = coarser colours",
     &Settings::bit_shift, 0, 7},
    {"training-models", "Training models",
     "Number K of Gaussians that each window is clustered into, must be below learned-models",
     &Settings::training_models, 1, max_models},
    {"learned-models", "Learned models",
     "Number N of Gaussians that are remembered, must be above training-models", &Settings::learned_models, 1,
     max_models},
    {"match-threshold", "Match threshold",
     "Squared distance in variances under which a training model updates a learned one, higher = fewer "
     "models",
     Fraction{&Settings::match_threshold_q8}, 0, 16},
    {"mass-cap", "Mass cap",
     "Most frames of window samples that a learned model may weigh, 0 = off, lower = adapts faster",
     &Settings::mass_cap, 0, most_frames},
    {"forget-shift", "Forget shift",
     "Each learned frame takes 1/2^n of every model's mass, 0 = off, lower = adapts faster",
     &Settings::forget_shift, 0, 15},
    {"seed", "Seed", "Number that the random centres of the clustering start from, any value is as good",
     &Settings::seed, 0, 0, false},
    {"learning", "Learning", "Whether frames are learned from, false freezes the learned terrain",
     &Settings::learning},
    {"near-clear", "Near clear",
     "Whether the near-range sensor says that the window is free of obstacles, false = nothing is learned",
     &Settings::near_clear},
    {"threshold", "Threshold",
     "Distance in standard deviations up to which a colour is terrain, higher = more is traversable",
     Fraction{&Settings::threshold_q8}, 0, 16},
    {"horizon", "Horizon", "How the horizon row is found, above which nothing is traversable",
     &Settings::horizon},
    {"texture", "Texture", "Whether local contrast is scored beside colour", &Settings::texture},
    {"exposure", "Exposure", "Whether a change of exposure is followed before frames are compared",
     &Settings::exposure},
    {"row-prior", "Row prior",
     "Whether rows near the window are more likely terrain than rows near the horizon", &Settings::row_prior},
    {"local-reference", "Local reference",
     "Whether colours are also compared with the terrain right below them, which follows shadows and "
     "gradients",
     &Settings::local_reference},
    {"geodesic", "Geodesic distance",
     "Whether the edges that lie between a place and the window count, which keeps smooth obstacles apart",
     &Settings::geodesic},
    {"second-look", "Second look",
     "Whether the boundary is searched twice, the second time with what the first parts in this very frame",
     &Settings::second_look},
    {"free-space", "Free space",
     "Whether one boundary over the whole picture parts the ground from what stands on it, false = each "
     "pixel by its own colour",
     &Settings::free_space},
    {"ground-behind", "Ground behind",
     "Whether ground that is seen behind an obstacle is traversable too, and an obstacle on open ground cut "
     "out",
     &Settings::ground_behind},
    {"refine", "Refine", "Whether the edges of the mask follow the edges of the full frame",
     &Settings::refine},
    {"negatives", "Negatives", "What stands against the terrain when a colour is scored",
     &Settings::negatives},
    {"temporal", "Temporal", "Whether scores are averaged over frames, which calms the mask",
     &Settings::temporal},
    {"caution", "Caution",
     "Bias towards not traversable in 1/32 nat, positive = fewer false free pixels and more false obstacles",
     &Settings::caution, -32, 32},
    {"doubtful", "Doubtful",
     "Score in 1/32 nat under which ground next to the boundary is marked doubtful, -96 = off",
     &Settings::doubtful, -96, 96},
    {"mask-level", "Mask level",
     "Octaves by which the mask is smaller than the frame, 0 = a mask value for every pixel",
     &Settings::mask_level, 0, max_mask_level, false},
    {"blocked-below", "Blocked below",
     "Share of free columns ahead of the window, in permille, under which the way counts as blocked",
     &Settings::blocked_below, 0, 1000},
    {"n-threads", "Threads", "Number of threads for one frame, 0 = as many as help, the result is the same",
     &Settings::n_threads, 0, max_threads, false},
};
constexpr guint row_count = std::size(rows);

/// Ids that follow the rows of the table.
enum Id : guint {
  id_preset = row_count + 1,
  id_ignore_regions,
  id_reset_on,
  id_overlay,
  id_overlay_first,
  id_overlay_last = id_overlay_first + overlay_property_count - 1,
  id_post_messages,
  id_analytics,
  id_model_location,
  id_end
};

constexpr auto plain = static_cast<GParamFlags>(G_PARAM_READWRITE | G_PARAM_STATIC_STRINGS);
constexpr auto mutable_ready = static_cast<GParamFlags>(plain | GST_PARAM_MUTABLE_READY);
constexpr auto mutable_playing = static_cast<GParamFlags>(plain | GST_PARAM_MUTABLE_PLAYING);
constexpr auto controllable = static_cast<GParamFlags>(mutable_playing | GST_PARAM_CONTROLLABLE);

template <class... Lambdas> struct Overloaded : Lambdas... { using Lambdas::operator()...; };
template <class... Lambdas> Overloaded(Lambdas...) -> Overloaded<Lambdas...>;

GParamSpec* spec_of(const Row& row) {
  const Settings defaults = Settings::of(Preset::standard);
  const GParamFlags flags = row.controllable ? controllable : mutable_playing;
  return std::visit(
      Overloaded{
          [&](int Settings::*m) {
            return g_param_spec_int(row.name, row.nick, row.blurb, row.low, row.high, defaults.*m, flags);
          },
          [&](std::uint32_t Settings::*m) {
            return g_param_spec_uint(row.name, row.nick, row.blurb, 0, G_MAXUINT32, defaults.*m, flags);
          },
          [&](bool Settings::*m) {
            return g_param_spec_boolean(row.name, row.nick, row.blurb, defaults.*m, flags);
          },
          [&](Fraction m) {
            return g_param_spec_double(row.name, row.nick, row.blurb, row.low, row.high,
                                       defaults.*m.q8 / 256.0, flags);
          },
          [&](auto m) {
            return g_param_spec_enum(row.name, row.nick, row.blurb, type_of(defaults.*m),
                                     static_cast<int>(defaults.*m), flags);
          },
      },
      row.member);
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

std::string text_of(const GValue* value) {
  gchar* text = gst_value_serialize(value);
  std::string result = text ? text : "(unreadable)";
  g_free(text);
  return result;
}

constexpr const char* regions_rule =
    "must be <<x, y, width, height>, ...> in pixels, x and y from 0, sizes from 1";

} // namespace

void SettingsBook::install(GObjectClass* object_class) {
  const auto add = [object_class](guint id, GParamSpec* spec) {
    g_object_class_install_property(object_class, id, spec);
  };
  static_assert(row_count <= capacity);
  for (guint i = 0; i < row_count; ++i)
    add(i + 1, spec_of(rows[i]));
  const ElementSettings defaults;
  add(id_preset,
      g_param_spec_enum("preset", "Preset",
                        "Values of all properties that are not set explicitly, the full pipeline or the "
                        "paper's algorithm",
                        type_of(Preset{}), static_cast<int>(Preset::standard), mutable_playing));
  add(id_ignore_regions,
      gst_param_spec_array(
          "ignore-regions", "Ignore regions",
          "Rectangles <<x, y, width, height>, ...> in pixels that are neither learned nor scored, "
          "such as a bonnet or burnt-in text",
          nullptr, mutable_playing));
  add(id_reset_on,
      g_param_spec_enum("reset-on", "Reset on", "When the learned terrain is forgotten by itself",
                        type_of(ResetOn{}), static_cast<int>(defaults.reset_on), mutable_playing));
  add(id_overlay,
      g_param_spec_boolean("overlay", "Overlay",
                           "Whether the result is drawn into the frame, which then has to be written",
                           defaults.overlay, controllable));
  install_overlay_properties(object_class, id_overlay_first);
  add(id_post_messages,
      g_param_spec_boolean(
          "post-messages", "Post messages",
          "Whether an element message 'terrainseg' is posted on the bus when the result changes",
          defaults.post_messages, mutable_playing));
#ifdef TERRAINSEG_ANALYTICS
  add(id_analytics,
      g_param_spec_boolean("analytics-meta", "Analytics metadata",
                           "Whether the standard GstAnalytics segmentation metadata is attached as well",
                           defaults.analytics, mutable_playing));
#endif
  add(id_model_location,
      g_param_spec_string(
          "model-location", "Model location",
          "Path of a file of learned terrain that is read at start, a missing or damaged one is an "
          "error",
          nullptr, mutable_ready));
}

guint SettingsBook::last_id() {
  return id_end - 1;
}

bool SettingsBook::set(guint id, const GValue* value) {
  ++sequence_;
  if (id >= 1 && id <= row_count) {
    const guint index = id - 1;
    Settings& core = settings_.core;
    std::visit(
        Overloaded{
            [&](int Settings::*m) { core.*m = g_value_get_int(value); },
            [&](std::uint32_t Settings::*m) { core.*m = g_value_get_uint(value); },
            [&](bool Settings::*m) { core.*m = g_value_get_boolean(value); },
            [&](Fraction m) {
              as_set_[index] = g_value_get_double(value);
              core.*m.q8 = static_cast<int>(std::lround(as_set_[index] * 256));
            },
            [&]<class Enum>(Enum Settings::*m) { core.*m = static_cast<Enum>(g_value_get_enum(value)); },
        },
        rows[index].member);
    explicit_.set(index);
    return true;
  }
  if (id >= id_overlay_first && id <= id_overlay_last) {
    set_overlay_property(settings_.drawing, id - id_overlay_first, value);
    return true;
  }
  switch (id) {
  case id_preset:
    choose_preset(static_cast<Preset>(g_value_get_enum(value)));
    return true;
  case id_ignore_regions:
    set_ignore_regions(value);
    return true;
  case id_reset_on:
    settings_.reset_on = static_cast<ResetOn>(g_value_get_enum(value));
    return true;
  case id_overlay:
    settings_.overlay = g_value_get_boolean(value);
    return true;
  case id_post_messages:
    settings_.post_messages = g_value_get_boolean(value);
    return true;
  case id_analytics:
    settings_.analytics = g_value_get_boolean(value);
    return true;
  case id_model_location: {
    const gchar* path = g_value_get_string(value);
    settings_.model_location = path ? path : "";
    return true;
  }
  default:
    return false;
  }
}

bool SettingsBook::get(guint id, GValue* value) const {
  if (id >= 1 && id <= row_count) {
    const guint index = id - 1;
    const Settings& core = settings_.core;
    std::visit(Overloaded{
                   [&](int Settings::*m) { g_value_set_int(value, core.*m); },
                   [&](std::uint32_t Settings::*m) { g_value_set_uint(value, core.*m); },
                   [&](bool Settings::*m) { g_value_set_boolean(value, core.*m); },
                   [&](Fraction m) {
                     g_value_set_double(value, explicit_.test(index) ? as_set_[index] : core.*m.q8 / 256.0);
                   },
                   [&](auto m) { g_value_set_enum(value, static_cast<int>(core.*m)); },
               },
               rows[index].member);
    return true;
  }
  if (id >= id_overlay_first && id <= id_overlay_last) {
    get_overlay_property(settings_.drawing, id - id_overlay_first, value);
    return true;
  }
  switch (id) {
  case id_preset:
    g_value_set_enum(value, static_cast<int>(preset_));
    return true;
  case id_ignore_regions:
    put_regions(settings_.core.ignore_regions, value);
    return true;
  case id_reset_on:
    g_value_set_enum(value, static_cast<int>(settings_.reset_on));
    return true;
  case id_overlay:
    g_value_set_boolean(value, settings_.overlay);
    return true;
  case id_post_messages:
    g_value_set_boolean(value, settings_.post_messages);
    return true;
  case id_analytics:
    g_value_set_boolean(value, settings_.analytics);
    return true;
  case id_model_location:
    g_value_set_string(value, settings_.model_location.empty() ? nullptr : settings_.model_location.c_str());
    return true;
  default:
    return false;
  }
}

void SettingsBook::set_near_clear(bool clear) {
  ++sequence_;
  settings_.core.near_clear = clear;
  for (guint i = 0; i < row_count; ++i)
    if (const auto* member = std::get_if<bool Settings::*>(&rows[i].member);
        member && *member == &Settings::near_clear)
      explicit_.set(i);
}

void SettingsBook::choose_preset(Preset preset) {
  preset_ = preset;
  Settings fresh = Settings::of(preset);
  for (guint i = 0; i < row_count; ++i) {
    if (!explicit_.test(i))
      continue;
    std::visit(Overloaded{
                   [&](Fraction m) { fresh.*m.q8 = settings_.core.*m.q8; },
                   [&](auto m) { fresh.*m = settings_.core.*m; },
               },
               rows[i].member);
  }
  fresh.ignore_regions = settings_.core.ignore_regions;
  settings_.core = std::move(fresh);
}

void SettingsBook::set_ignore_regions(const GValue* value) {
  std::vector<int> numbers;
  std::vector<Rectangle> regions;
  bool good = numbers_of(value, numbers);
  for (std::size_t i = 0; good && i + 3 < numbers.size(); i += 4) {
    const Rectangle r{numbers[i], numbers[i + 1], numbers[i + 2], numbers[i + 3]};
    good = r.x >= 0 && r.y >= 0 && !r.empty() && r.x <= longest_side && r.y <= longest_side &&
           r.width <= longest_side && r.height <= longest_side;
    regions.push_back(r);
  }
  regions_error_.reset();
  if (good)
    settings_.core.ignore_regions = std::move(regions);
  else
    regions_error_ = SettingsError{"ignore-regions", text_of(value), regions_rule};
}

std::optional<SettingsError> SettingsBook::error() const {
  return regions_error_ ? regions_error_ : validate(settings_.core);
}

} // namespace terrainseg
