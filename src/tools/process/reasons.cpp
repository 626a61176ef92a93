// SPDX-License-Identifier: LGPL-2.1-or-later
#include "tools/process/reasons.hpp"

#include <gst/pbutils/missing-plugins.h>

#include <algorithm>
#include <mutex>
#include <utility>

#include "tools/process/handles.hpp"

namespace terrainseg::process {
namespace {

/// The first log messages of the elements of one input.
class Complaints {
 public:
  void add(const GObject* from, std::string text) {
    constexpr std::size_t most = 64;
    const std::lock_guard lock(mutex_);
    if (all_.size() < most)
      all_.emplace_back(from, std::move(text));
  }
  void clear() {
    const std::lock_guard lock(mutex_);
    all_.clear();
  }
  /// The first message of an element, which is usually the cause of the others; empty if there is none.
  std::string first_of(const GObject* from) {
    const std::lock_guard lock(mutex_);
    for (const auto& [object, text] : all_)
      if (object == from)
        return text;
    return {};
  }

 private:
  std::mutex mutex_;
  std::vector<std::pair<const GObject*, std::string>> all_;
};

Complaints complaints;

void on_log(GstDebugCategory*, GstDebugLevel level, const gchar*, const gchar*, gint, GObject* object,
            GstDebugMessage* message, gpointer) {
  if (level > GST_LEVEL_WARNING || !GST_IS_ELEMENT(object))
    return;
  const char* text = gst_debug_message_get(message);
  if (text && !g_str_has_prefix(text, "error: ")) // repeats the error message
    complaints.add(object, text);
}

std::string factory_of(const GstObject* element) {
  const GstElementFactory* factory =
      GST_IS_ELEMENT(element) ? gst_element_get_factory(GST_ELEMENT(element)) : nullptr;
  return factory ? GST_OBJECT_NAME(factory) : take(gst_object_get_name(GST_OBJECT(element)));
}

/// The output format of an element; empty if it has none.
std::string format_of(GstObject* element) {
  std::string text;
  if (!GST_IS_ELEMENT(element))
    return text;
  GST_OBJECT_LOCK(element);
  const GList* pads = GST_ELEMENT(element)->srcpads;
  const PadPointer pad(pads ? GST_PAD(gst_object_ref(pads->data)) : nullptr);
  GST_OBJECT_UNLOCK(element);
  if (const CapsPointer caps{pad ? gst_pad_get_current_caps(pad.get()) : nullptr})
    text = take(gst_caps_to_string(caps.get()));
  return text;
}

void trim(std::string& text) {
  while (!text.empty() && (text.back() == '\n' || text.back() == ' '))
    text.pop_back();
}

/// The text of a message for users, and the debug detail without source locations.
std::pair<std::string, std::string> said_in(GstMessage* message) {
  GError* error = nullptr;
  gchar* debug = nullptr;
  if (GST_MESSAGE_TYPE(message) == GST_MESSAGE_WARNING)
    gst_message_parse_warning(message, &error, &debug);
  else
    gst_message_parse_error(message, &error, &debug);
  std::string text = error->message, detail = take(debug);
  const bool unknown_type = g_error_matches(error, GST_STREAM_ERROR, GST_STREAM_ERROR_TYPE_NOT_FOUND);
  g_error_free(error);
  const std::size_t line = detail.find('\n');
  detail.erase(0, line == std::string::npos ? line : line + 1);
  trim(text);
  trim(detail);
  if (unknown_type)
    return {detail.find("empty") != std::string::npos
                ? "it is empty"
                : "its type is unknown: it is not a video, or its beginning is damaged",
            ""};
  return {text, detail};
}

/// The name of a codec that the demuxer does not know: its FourCC or the container's name; empty if it is
/// known.
std::string unknown_codec(const GstStructure* type) {
  const std::string name = gst_structure_get_name(type);
  const std::string prefix = "video/x-gst-fourcc-";
  if (name.starts_with(prefix))
    return name.substr(prefix.size());
  if (!name.ends_with("-unknown"))
    return {};
  gint number = 0;
  std::string letters;
  if (gst_structure_get_int(type, "fourcc", &number))
    for (int bits = 0; bits < 32; bits += 8)
      letters += static_cast<char>(static_cast<guint>(number) >> bits & 0xff);
  for (const char* field : {"fourcc", "codec-id"})
    if (const char* text = letters.empty() ? gst_structure_get_string(type, field) : nullptr)
      letters = text;
  for (char& letter : letters)
    if (!g_ascii_isprint(letter))
      letter = '?';
  trim(letters);
  return letters.empty() ? name : letters;
}

bool is_installed(const char* plugin) {
  GstPlugin* found = gst_registry_find_plugin(gst_registry_get(), plugin);
  if (found)
    gst_object_unref(found);
  return found != nullptr;
}

} // namespace

std::string text_of(GstMessage* message) {
  const auto [text, detail] = said_in(message);
  return detail.empty() ? text : text + " (" + detail + ")";
}

bool says_nothing(GstMessage* message) {
  GError* error = nullptr;
  gst_message_parse_error(message, &error, nullptr);
  bool result = false;
  if (g_error_matches(error, GST_STREAM_ERROR, GST_STREAM_ERROR_FAILED))
    for (const char* phrase :
         {"Internal data stream error", "Internal data flow error", "GStreamer encountered"})
      result = result || g_str_has_prefix(error->message, phrase);
  g_error_free(error);
  return result;
}

std::string giving_up(GstMessage* message) {
  std::string text = factory_of(message->src) + " gave up";
  const GstStructure* details = nullptr;
  gst_message_parse_error_details(message, &details);
  int flow = GST_FLOW_OK;
  if (details && gst_structure_get_int(details, "flow-return", &flow) && flow == GST_FLOW_NOT_NEGOTIATED)
    if (const std::string format = format_of(message->src); !format.empty())
      return text + ": no element after it accepts " + format;
  if (const std::string complaint = complaints.first_of(G_OBJECT(message->src)); !complaint.empty())
    return text + ": " + complaint;
  const auto [said, detail_of_it] = said_in(message);
  return text + ": " + (detail_of_it.empty() ? said : detail_of_it);
}

void listen_to_the_log(const std::vector<std::string>& arguments) {
  const bool asked_for = std::any_of(arguments.begin(), arguments.end(), [](const std::string& argument) {
    return argument.starts_with("--gst-debug");
  });
  if (asked_for || g_getenv("GST_DEBUG"))
    return;
  gst_debug_remove_log_function(gst_debug_log_default);
  gst_debug_add_log_function(on_log, nullptr, nullptr);
  gst_debug_set_active(TRUE);
  gst_debug_set_default_threshold(GST_LEVEL_WARNING);
}

void forget_the_log() {
  complaints.clear();
}

std::string no_decoder(GstMessage* message) {
  const GValue* detail = gst_structure_get_value(gst_message_get_structure(message), "detail");
  const GstCaps* caps = detail && GST_VALUE_HOLDS_CAPS(detail) ? gst_value_get_caps(detail) : nullptr;
  if (caps && gst_caps_get_size(caps) > 0)
    if (const std::string codec = unknown_codec(gst_caps_get_structure(caps, 0)); !codec.empty())
      return "GStreamer does not know the codec '" + codec + "', and no package adds it; " + make_it_anew;
  if (detail && G_VALUE_HOLDS_STRING(detail) &&
      g_strcmp0(gst_structure_get_string(gst_message_get_structure(message), "type"), "urisource") == 0)
    return std::string("no element of GStreamer reads ") + g_value_get_string(detail) +
           ":// addresses; copy the video to this machine and name the file";
  std::string text =
      "no decoder for it: " + take(gst_missing_plugin_message_get_description(message)) + " is missing; ";
  std::string packages;
  for (const auto& [plugin, package] :
       {std::pair("libav", "gstreamer1.0-libav"), std::pair("videoparsersbad", "gstreamer1.0-plugins-bad")})
    if (!is_installed(plugin))
      packages += std::string(packages.empty() ? "" : " and ") + package;
  if (!packages.empty())
    return text + "install " + packages;
  return text + "gstreamer1.0-libav and gstreamer1.0-plugins-bad, which have most of them, are installed; " +
         make_it_anew;
}

} // namespace terrainseg::process
