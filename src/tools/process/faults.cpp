// SPDX-License-Identifier: LGPL-2.1-or-later
#include "tools/process/faults.hpp"

#include <cerrno>
#include <cstring>
#include <optional>

#include "tools/process/handles.hpp"

namespace terrainseg::process {
namespace {

/// Whether an errno is temporary, for writing and for reading. Others are permanent, such as a long name, a
/// read-only file system, a file size limit, or a loop of links.
constexpr struct {
  int error;
  bool writing, reading;
} errors_that_pass[] = {
    // The machine lacks a resource.
    {ENOSPC, true, true},
    {EDQUOT, true, true},
    {ENOMEM, true, true},
    {ENOBUFS, true, true},
    {EMFILE, true, true},
    {ENFILE, true, true},
    {EAGAIN, true, true},
    {ENOLCK, true, true},
    {EDEADLK, true, true},
    {EBUSY, true, true},
    {EINTR, true, true},
    {ETXTBSY, true, true},
    {EUSERS, true, true},
    {ENOSR, true, true},
    // The disk or its connection.
    {EIO, true, true},
    {EREMOTEIO, true, true},
    {ESTALE, true, true},
    {ETIMEDOUT, true, true},
    {ETIME, true, true},
    {ENOMEDIUM, true, true},
    {ENXIO, true, true},
    {ENODEV, true, true},
    {ENOTCONN, true, true},
    {ECONNREFUSED, true, true},
    {ECONNRESET, true, true},
    {ECONNABORTED, true, true},
    {ENETDOWN, true, true},
    {ENETUNREACH, true, true},
    {ENETRESET, true, true},
    {EHOSTDOWN, true, true},
    {EHOSTUNREACH, true, true},
    {ENOLINK, true, true},
    {ECOMM, true, true},
    {ESHUTDOWN, true, true},
    {EPIPE, true, true},
    {ECANCELED, true, true},
    {EOWNERDEAD, true, true},
    // Writing: the folder was removed. Reading: the input does not exist yet.
    {ENOENT, true, true},
    {EACCES, false, true},
    {EPERM, false, true},
    {EKEYEXPIRED, true, true}};

enum class Side { reader, decoder, output, filter };

/// Errors of GStreamer's RESOURCE domain, for the source and for the other elements.
constexpr struct {
  GstResourceError code;
  Cause reader, decoder, output, filter;
} resource_errors[] = {
    {GST_RESOURCE_ERROR_FAILED, Cause::missing, Cause::damaged, Cause::disk, Cause::resources},
    {GST_RESOURCE_ERROR_TOO_LAZY, Cause::missing, Cause::damaged, Cause::disk, Cause::resources},
    {GST_RESOURCE_ERROR_NOT_FOUND, Cause::missing, Cause::damaged, Cause::disk, Cause::resources},
    {GST_RESOURCE_ERROR_BUSY, Cause::missing, Cause::resources, Cause::disk, Cause::resources},
    {GST_RESOURCE_ERROR_OPEN_READ, Cause::missing, Cause::damaged, Cause::disk, Cause::resources},
    {GST_RESOURCE_ERROR_OPEN_WRITE, Cause::missing, Cause::resources, Cause::disk, Cause::resources},
    {GST_RESOURCE_ERROR_OPEN_READ_WRITE, Cause::missing, Cause::resources, Cause::disk, Cause::resources},
    {GST_RESOURCE_ERROR_CLOSE, Cause::missing, Cause::damaged, Cause::disk, Cause::resources},
    {GST_RESOURCE_ERROR_READ, Cause::missing, Cause::damaged, Cause::disk, Cause::resources},
    {GST_RESOURCE_ERROR_WRITE, Cause::missing, Cause::resources, Cause::disk, Cause::resources},
    {GST_RESOURCE_ERROR_SEEK, Cause::missing, Cause::damaged, Cause::disk, Cause::resources},
    {GST_RESOURCE_ERROR_SYNC, Cause::missing, Cause::damaged, Cause::disk, Cause::resources},
    {GST_RESOURCE_ERROR_SETTINGS, Cause::unsupported, Cause::unsupported, Cause::unsupported,
     Cause::unsupported},
    {GST_RESOURCE_ERROR_NO_SPACE_LEFT, Cause::missing, Cause::resources, Cause::disk, Cause::resources},
    // A wrong password is permanent.
    {GST_RESOURCE_ERROR_NOT_AUTHORIZED, Cause::unsupported, Cause::unsupported, Cause::unwritable,
     Cause::unsupported}};

Cause cause_of(const GError* error, Side side) {
  if (error->domain == GST_RESOURCE_ERROR)
    for (const auto& row : resource_errors)
      if (row.code == error->code)
        return side == Side::reader    ? row.reader
               : side == Side::decoder ? row.decoder
               : side == Side::output  ? row.output
                                       : row.filter;
  if (error->domain == GST_CORE_ERROR && error->code == GST_CORE_ERROR_THREAD)
    return Cause::resources;
  // CORE, LIBRARY and STREAM: the content of the stream, a setting, or a missing feature of an element.
  return side == Side::reader || side == Side::decoder ? Cause::damaged : Cause::unsupported;
}

/// Whether a reading element stopped without its own error (such as souphttpsrc when refused).
bool source_gave_up(GstMessage* message) {
  const GstStructure* details = nullptr;
  gst_message_parse_error_details(message, &details);
  int flow = GST_FLOW_OK;
  return details && gst_structure_get_int(details, "flow-return", &flow) && flow == GST_FLOW_ERROR;
}

/// The errno whose text ends a message: GStreamer's sinks report it only there.
std::optional<int> errno_in(const std::string& text) {
  constexpr int most = 134;
  for (int error = 1; error < most; ++error)
    if (text.ends_with(g_strerror(error)))
      return error;
  return std::nullopt;
}

} // namespace

Cause cause_of_writing(int error) {
  for (const auto& row : errors_that_pass)
    if (row.error == error && row.writing)
      return Cause::disk;
  return Cause::unwritable;
}

Cause cause_of_reading(int error) {
  for (const auto& row : errors_that_pass)
    if (row.error == error && row.reading)
      return Cause::missing;
  return Cause::unsupported;
}

Cause cause_of_reading(const GError* error) {
  for (const auto& row : errors_that_pass)
    if (row.reading && static_cast<gint>(g_file_error_from_errno(row.error)) == error->code &&
        error->code != G_FILE_ERROR_FAILED)
      return Cause::missing;
  return Cause::unsupported;
}

Fault cannot(const std::string& what, const std::string& path, int error) {
  return {cause_of_writing(error), "cannot " + what + " " + path + ": " + std::strerror(error)};
}

Cause cause_in_source(GstMessage* message) {
  const bool reads =
      GST_IS_ELEMENT(message->src) && GST_OBJECT_FLAG_IS_SET(message->src, GST_ELEMENT_FLAG_SOURCE);
  if (reads && source_gave_up(message))
    return Cause::missing;
  GError* error = nullptr;
  gst_message_parse_error(message, &error, nullptr);
  const std::unique_ptr<GError, Releaser<g_error_free>> owner(error);
  return cause_of(error, reads ? Side::reader : Side::decoder);
}

Cause cause_behind_source(GstMessage* message, bool writes) {
  GError* error = nullptr;
  gchar* debug = nullptr;
  gst_message_parse_error(message, &error, &debug);
  const std::unique_ptr<GError, Releaser<g_error_free>> owner(error);
  const std::string detail = take(debug);
  if (writes && error->domain == GST_RESOURCE_ERROR)
    if (const auto number = errno_in(detail))
      return cause_of_writing(*number);
  return cause_of(error, writes ? Side::output : Side::filter);
}

} // namespace terrainseg::process
