// SPDX-License-Identifier: LGPL-2.1-or-later
#include "tools/process/faults.hpp"

#include <gst/pbutils/missing-plugins.h>

#include <algorithm>
#include <cerrno>
#include <cstddef>
#include <cstring>
#include <mutex>
#include <optional>
#include <utility>

#include "tools/process/handles.hpp"

namespace terrainseg::process {
namespace {

/// The errors that are temporary, for writing and for reading. Others are permanent, such as a long name, a
/// read-only file system, a file size limit, or a loop of links.
constexpr int errors_that_pass[] = {
    // The machine lacks a resource.
    ENOSPC, EDQUOT, ENOMEM, ENOBUFS, EMFILE, ENFILE, EAGAIN, ENOLCK, EDEADLK, EBUSY, EINTR, ETXTBSY, EUSERS,
    ENOSR,
    // The disk or its connection.
    EIO, EREMOTEIO, ESTALE, ETIMEDOUT, ETIME, ENOMEDIUM, ENXIO, ENODEV, ENOTCONN, ECONNREFUSED, ECONNRESET,
    ECONNABORTED, ENETDOWN, ENETUNREACH, ENETRESET, EHOSTDOWN, EHOSTUNREACH, ENOLINK, ECOMM, ESHUTDOWN, EPIPE,
    ECANCELED, EOWNERDEAD,
    // Writing: the folder was removed. Reading: the input does not exist yet.
    ENOENT};
/// The errors that are temporary only for reading.
constexpr int reading_errors_that_pass[] = {EACCES, EPERM, EKEYEXPIRED};

constexpr int errno_end = 134; ///< above all errors of Linux

enum class Side { reader, decoder, output, filter };

/// The cause of an error of GStreamer's RESOURCE domain.
Cause cause_of_resource(int code, Side side) {
  if (code == GST_RESOURCE_ERROR_SETTINGS)
    return Cause::unsupported;
  if (code == GST_RESOURCE_ERROR_NOT_AUTHORIZED) // a wrong password is permanent
    return side == Side::output ? Cause::unwritable : Cause::unsupported;
  if (side != Side::decoder)
    return side == Side::reader ? Cause::missing : side == Side::output ? Cause::disk : Cause::resources;
  for (const int lacking : {GST_RESOURCE_ERROR_BUSY, GST_RESOURCE_ERROR_OPEN_WRITE, GST_RESOURCE_ERROR_WRITE,
                            GST_RESOURCE_ERROR_OPEN_READ_WRITE, GST_RESOURCE_ERROR_NO_SPACE_LEFT})
    if (code == lacking)
      return Cause::resources;
  return Cause::damaged;
}

Cause cause_of(const GError* error, Side side) {
  if (error->domain == GST_RESOURCE_ERROR)
    return cause_of_resource(error->code, side);
  if (g_error_matches(error, GST_CORE_ERROR, GST_CORE_ERROR_THREAD))
    return Cause::resources;
  // CORE, LIBRARY and STREAM: the content of the stream, a setting, or a missing feature of an element.
  return side == Side::reader || side == Side::decoder ? Cause::damaged : Cause::unsupported;
}

/// The result of the last buffer of an element that stopped without its own error.
int flow_in(GstMessage* message) {
  const GstStructure* details = nullptr;
  gst_message_parse_error_details(message, &details);
  int flow = GST_FLOW_OK;
  if (details)
    gst_structure_get_int(details, "flow-return", &flow);
  return flow;
}

/// The errno whose text ends a message: GStreamer's sinks report it only there.
std::optional<int> errno_in(const std::string& text) {
  for (int error = 1; error < errno_end; ++error)
    if (text.ends_with(g_strerror(error)))
      return error;
  return std::nullopt;
}

/// The first log messages of the elements of one input.
std::mutex log_mutex;
std::vector<std::pair<const GObject*, std::string>> logged;

void on_log(GstDebugCategory*, GstDebugLevel level, const gchar*, const gchar*, gint, GObject* object,
            GstDebugMessage* message, gpointer) {
  if (level > GST_LEVEL_WARNING || !GST_IS_ELEMENT(object))
    return;
  constexpr std::size_t most = 64;
  const char* text = gst_debug_message_get(message);
  const std::lock_guard lock(log_mutex);
  if (text && !g_str_has_prefix(text, "error: ") && logged.size() < most) // "error: " repeats the message
    logged.emplace_back(object, text);
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
  text.erase(text.find_last_not_of("\n ") + 1);
}

/// The text of a message for users, and the debug detail without source locations.
std::pair<std::string, std::string> said_in(GstMessage* message) {
  gchar* debug = nullptr;
  const ErrorPointer error = error_in(message, &debug);
  std::string text = error->message, detail = take(debug);
  const std::size_t line = detail.find('\n');
  detail.erase(0, line == std::string::npos ? line : line + 1);
  trim(text);
  trim(detail);
  if (g_error_matches(error.get(), GST_STREAM_ERROR, GST_STREAM_ERROR_TYPE_NOT_FOUND))
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
  std::ranges::replace_if(
      letters, [](char letter) { return !g_ascii_isprint(letter); }, '?');
  trim(letters);
  return letters.empty() ? name : letters;
}

} // namespace

Cause cause_of_writing(int error) {
  return std::ranges::count(errors_that_pass, error) > 0 ? Cause::disk : Cause::unwritable;
}

Cause cause_of_reading(int error) {
  const auto passes =
      std::ranges::count(errors_that_pass, error) + std::ranges::count(reading_errors_that_pass, error);
  return passes > 0 ? Cause::missing : Cause::unsupported;
}

Cause cause_of_reading(const GError* error) {
  for (int each = 1; each < errno_end && error->code != G_FILE_ERROR_FAILED; ++each)
    if (static_cast<gint>(g_file_error_from_errno(each)) == error->code)
      return cause_of_reading(each);
  return Cause::unsupported;
}

Fault cannot(const std::string& what, const std::string& path, int error) {
  return {cause_of_writing(error), "cannot " + what + " " + path + ": " + std::strerror(error)};
}

Cause cause_in_source(GstMessage* message) {
  const bool reads =
      GST_IS_ELEMENT(message->src) && GST_OBJECT_FLAG_IS_SET(message->src, GST_ELEMENT_FLAG_SOURCE);
  if (reads && flow_in(message) == GST_FLOW_ERROR) // such as souphttpsrc when refused
    return Cause::missing;
  return cause_of(error_in(message).get(), reads ? Side::reader : Side::decoder);
}

Cause cause_behind_source(GstMessage* message, bool writes) {
  gchar* debug = nullptr;
  const ErrorPointer error = error_in(message, &debug);
  const std::string detail = take(debug);
  if (writes && error->domain == GST_RESOURCE_ERROR)
    if (const auto number = errno_in(detail))
      return cause_of_writing(*number);
  return cause_of(error.get(), writes ? Side::output : Side::filter);
}

std::string factory_of(const GstObject* element) {
  const GstElementFactory* factory =
      GST_IS_ELEMENT(element) ? gst_element_get_factory(GST_ELEMENT(element)) : nullptr;
  return factory ? GST_OBJECT_NAME(factory) : take(gst_object_get_name(GST_OBJECT(element)));
}

std::string text_of(GstMessage* message) {
  const auto [text, detail] = said_in(message);
  return detail.empty() ? text : text + " (" + detail + ")";
}

bool says_nothing(GstMessage* message) {
  const ErrorPointer error = error_in(message);
  for (const char* phrase :
       {"Internal data stream error", "Internal data flow error", "GStreamer encountered"})
    if (g_error_matches(error.get(), GST_STREAM_ERROR, GST_STREAM_ERROR_FAILED) &&
        g_str_has_prefix(error->message, phrase))
      return true;
  return false;
}

std::string giving_up(GstMessage* message) {
  std::string text = factory_of(message->src) + " gave up";
  if (flow_in(message) == GST_FLOW_NOT_NEGOTIATED)
    if (const std::string format = format_of(message->src); !format.empty())
      return text + ": no element after it accepts " + format;
  const auto [said, detail_of_it] = said_in(message);
  // The first message in the log is usually the cause of the others.
  const std::lock_guard lock(log_mutex);
  for (const auto& [object, line] : logged)
    if (object == G_OBJECT(message->src))
      return text.append(": ").append(line);
  return text.append(": ").append(detail_of_it.empty() ? said : detail_of_it);
}

void listen_to_the_log(const std::vector<std::string>& arguments) {
  const bool asked_for = std::ranges::any_of(
      arguments, [](const std::string& argument) { return argument.starts_with("--gst-debug"); });
  if (asked_for || g_getenv("GST_DEBUG"))
    return;
  gst_debug_remove_log_function(gst_debug_log_default);
  gst_debug_add_log_function(on_log, nullptr, nullptr);
  gst_debug_set_active(TRUE);
  gst_debug_set_default_threshold(GST_LEVEL_WARNING);
}

void forget_the_log() {
  const std::lock_guard lock(log_mutex);
  logged.clear();
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
       {std::pair("libav", "gstreamer1.0-libav"), std::pair("videoparsersbad", "gstreamer1.0-plugins-bad")}) {
    g_autoptr(GstPlugin) installed = gst_registry_find_plugin(gst_registry_get(), plugin);
    if (!installed)
      packages += std::string(packages.empty() ? "" : " and ") + package;
  }
  if (!packages.empty())
    return text + "install " + packages;
  return text + "gstreamer1.0-libav and gstreamer1.0-plugins-bad, which have most of them, are installed; " +
         make_it_anew;
}

} // namespace terrainseg::process
