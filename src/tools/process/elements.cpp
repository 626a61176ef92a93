// SPDX-License-Identifier: LGPL-2.1-or-later
#include "tools/process/elements.hpp"

#include <filesystem>
#include <set>

#include "tools/command_line.hpp"
#include "tools/process/handles.hpp"

namespace terrainseg::process {

using tools::UsageError;

namespace {

namespace fs = std::filesystem;

constexpr const char* plugin_file = "libgstterrainseg.so";

constexpr const char* own_package =
    "gstreamer1.0-terrainseg, or set GST_PLUGIN_PATH to the folder of libgstterrainseg.so";

bool exists(const char* element) {
  return FactoryPointer(gst_element_factory_find(element)) != nullptr;
}

/// What helps against a missing recorder: its plugin is a file of its own, beside that of terrainseg.
std::string recorder_package() {
  constexpr const char* package = "gstreamer1.0-terrainseg";
  const FactoryPointer terrainseg(gst_element_factory_find("terrainseg"));
  g_autoptr(GstPlugin) plugin =
      terrainseg ? gst_plugin_feature_get_plugin(GST_PLUGIN_FEATURE(terrainseg.get())) : nullptr;
  const char* name = plugin ? gst_plugin_get_filename(plugin) : nullptr;
  const fs::path file = name ? fs::path(name).replace_filename("libgstterrainmcap.so") : fs::path();
  std::error_code ignored;
  if (file.empty())
    return package;
  if (!fs::exists(file, ignored))
    return std::string(package) + ", or build it: " + file.string() +
           " is not there. In a build folder type ninja; where `meson setup` left it out, install "
           "libzstd-dev first";
  g_autoptr(GError) error = nullptr;
  if (GstPlugin* loaded = gst_plugin_load_file(file.c_str(), &error))
    gst_object_unref(loaded);
  const std::string reason = error ? error->message : "it holds another plugin";
  return std::string(package) + " again: " + file.string() + " is there and does not load (" + reason + ")";
}

std::string range_of(GParamSpec* spec) {
  const auto numbers = [](const auto* of, const char* format) {
    return number_text(format, of->minimum) + ".." + number_text(format, of->maximum);
  };
  const auto nicks = [](const char* begin, const auto* values, guint count) {
    std::string text = begin;
    for (guint i = 0; i < count; ++i)
      text += (i ? ", " : "") + std::string(values[i].value_nick);
    return text;
  };
  if (G_IS_PARAM_SPEC_INT(spec))
    return numbers(G_PARAM_SPEC_INT(spec), "%.0f");
  if (G_IS_PARAM_SPEC_UINT(spec))
    return numbers(G_PARAM_SPEC_UINT(spec), "%.0f");
  if (G_IS_PARAM_SPEC_DOUBLE(spec))
    return numbers(G_PARAM_SPEC_DOUBLE(spec), "%g");
  if (G_IS_PARAM_SPEC_FLOAT(spec))
    return numbers(G_PARAM_SPEC_FLOAT(spec), "%g");
  if (G_IS_PARAM_SPEC_BOOLEAN(spec))
    return "true or false";
  if (G_IS_PARAM_SPEC_ENUM(spec)) {
    const GEnumClass* all = G_PARAM_SPEC_ENUM(spec)->enum_class;
    return nicks("one of ", all->values, all->n_values);
  }
  if (G_IS_PARAM_SPEC_FLAGS(spec)) {
    const GFlagsClass* all = G_PARAM_SPEC_FLAGS(spec)->flags_class;
    return nicks("any of ", all->values, all->n_values) + ", with + between them, or 0 for none";
  }
  if (g_str_equal(spec->name, "ignore-regions"))
    return "rectangles in pixels, as <<x,y,width,height>,<x,y,width,height>>";
  return std::string("a ") + g_type_name(spec->value_type);
}

/// Sets a property from text as gst-launch-1.0 does. Refuses unknown, unreadable and read-only properties and
/// values out of range; the error lists valid ones.
void set_property(GstElement* element, const std::string& name, const std::string& value) {
  const std::string type = gst_plugin_feature_get_name(GST_PLUGIN_FEATURE(gst_element_get_factory(element)));
  GParamSpec* spec = g_object_class_find_property(G_OBJECT_GET_CLASS(element), name.c_str());
  if (!spec || !(spec->flags & G_PARAM_WRITABLE) || spec->owner_type == GST_TYPE_OBJECT)
    throw UsageError(type + " has no property '" + name + "' that can be set (gst-inspect-1.0 " + type +
                     " lists them)");
  GValue converted = G_VALUE_INIT;
  g_value_init(&converted, spec->value_type);
  const bool read = gst_value_deserialize_with_pspec(&converted, value.c_str(), spec);
  // Validation would clamp the value to the range; that is an error here.
  const bool fits = read && !g_param_value_validate(spec, &converted);
  if (fits)
    g_object_set_property(G_OBJECT(element), name.c_str(), &converted);
  g_value_unset(&converted);
  if (!fits)
    throw UsageError(name + " = '" + value + "': must be " + range_of(spec));
}

} // namespace

void point_to_own_plugin() {
  std::error_code error;
  const fs::path program = fs::read_symlink("/proc/self/exe", error);
  if (error)
    return;
  // In a build tree: BUILD/gst for BUILD/src/tools/terrainseg-process. Installed: the configured plugin
  // folder, also relative to the program in case the prefix was moved.
  const fs::path here = program.parent_path();
  const fs::path candidates[] = {
      here / "../../gst", here / fs::path(TERRAINSEG_PLUGINS_DIR).lexically_relative(TERRAINSEG_BINDIR),
      TERRAINSEG_PLUGINS_DIR};
  for (const fs::path& candidate : candidates) {
    if (!fs::is_regular_file(candidate / plugin_file, error))
      continue;
    std::string path = fs::canonical(candidate, error).string();
    const char* versioned = g_getenv("GST_PLUGIN_PATH_1_0");
    const char* name = versioned && *versioned ? "GST_PLUGIN_PATH_1_0" : "GST_PLUGIN_PATH";
    if (const char* given = g_getenv(name); given && *given)
      path.insert(0, std::string(given) + ":");
    g_setenv(name, path.c_str(), TRUE);
    return;
  }
}

bool has_x264() {
  return exists("x264enc");
}

void check_elements(const Options& options) {
  const bool annotated = options.wants(Output::annotated), masks = options.wants(Output::masks),
             mcap = options.wants(Output::mcap), openh264 = (annotated || mcap) && !has_x264();
  const struct {
    bool needed;
    const char* element;
    std::string package;
  } all[] = {{true, "terrainseg", own_package},
             {true, "uridecodebin", "gstreamer1.0-plugins-base"},
             {true, "decodebin", "gstreamer1.0-plugins-base"},
             {true, "appsrc", "gstreamer1.0-plugins-base"},
             {true, "videoconvert", "gstreamer1.0-plugins-base"},
             {true, "deinterlace", "gstreamer1.0-plugins-good"},
             {true, "videoflip", "gstreamer1.0-plugins-good"},
             {annotated, "terrainoverlay", own_package},
             {annotated, "videoscale", "gstreamer1.0-plugins-base"},
             {annotated, "videobox", "gstreamer1.0-plugins-good"},
             {annotated, "mp4mux", "gstreamer1.0-plugins-good"},
             {masks || options.wants(Output::json), "terrainextract", own_package},
             {masks, "avenc_ffv1", "gstreamer1.0-libav"},
             {masks, "matroskamux", "gstreamer1.0-plugins-good"},
             {mcap, "terrainmcapsink", mcap && !exists("terrainmcapsink") ? recorder_package() : ""},
             {mcap, "videoscale", "gstreamer1.0-plugins-base"},
             {mcap, "h264parse", "gstreamer1.0-plugins-bad"},
             {openh264, "openh264enc", "gstreamer1.0-plugins-ugly (for x264enc) or gstreamer1.0-plugins-bad"},
             {openh264, "h264parse", "gstreamer1.0-plugins-bad"}};

  std::set<std::string> named;
  std::string text;
  for (const auto& each : all) {
    if (!each.needed || exists(each.element) || !named.insert(each.element).second)
      continue;
    text += text.empty() ? "the GStreamer element '" : "\nthe GStreamer element '";
    text += each.element;
    text += "' is missing: install ";
    text += each.package;
  }
  text += "\n('gst-inspect-1.0 --print-blacklist' lists plugins that are installed but do not load)";
  if (!named.empty())
    throw EarlyExit{Exit::environment, text};
}

void apply_settings(const Options& options, GstElement* terrainseg, GstElement* overlay) {
  if (!options.preset.empty())
    set_property(terrainseg, "preset", options.preset);
  for (const auto& [name, value] : options.settings) {
    // terrainseg must not draw: masks and lines are made from unchanged frames.
    const bool drawing = name == "overlay" || name.starts_with("overlay-");
    if (name == "overlay")
      throw UsageError("overlay = '" + value +
                       "': the annotated video is always drawn on; choose with --outputs");
    if (GstElement* target = drawing ? overlay : terrainseg)
      set_property(target, name, value);
  }
}

void check_settings(const Options& options) {
  const auto make = [](const char* factory) {
    return ElementPointer(GST_ELEMENT(gst_object_ref_sink(gst_element_factory_make(factory, nullptr))));
  };
  const ElementPointer overlay = options.wants(Output::annotated) ? make("terrainoverlay") : nullptr,
                       terrainseg = make("terrainseg");
  apply_settings(options, terrainseg.get(), overlay.get());
  const BusPointer bus(gst_bus_new());
  gst_element_set_bus(terrainseg.get(), bus.get());
  const bool failed = gst_element_set_state(terrainseg.get(), GST_STATE_PAUSED) == GST_STATE_CHANGE_FAILURE;
  std::string text = "does not start";
  if (const MessagePointer message{gst_bus_pop_filtered(bus.get(), GST_MESSAGE_ERROR)})
    text = error_in(message.get())->message;
  gst_element_set_state(terrainseg.get(), GST_STATE_NULL);
  if (failed)
    throw UsageError(text);
}

} // namespace terrainseg::process
