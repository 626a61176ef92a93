// SPDX-License-Identifier: LGPL-2.1-or-later
#include "tools/process/faults.hpp"

#include <algorithm>
#include <cerrno>
#include <cstddef>
#include <cstring>
#include <optional>

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

template <std::size_t count> bool has(const int (&errors)[count], int error) {
  return std::find(errors, errors + count, error) != errors + count;
}

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

/// Whether a reading element stopped without its own error (such as souphttpsrc when refused).
bool source_gave_up(GstMessage* message) {
  const GstStructure* details = nullptr;
  gst_message_parse_error_details(message, &details);
  int flow = GST_FLOW_OK;
  return details && gst_structure_get_int(details, "flow-return", &flow) && flow == GST_FLOW_ERROR;
}

/// The errno whose text ends a message: GStreamer's sinks report it only there.
std::optional<int> errno_in(const std::string& text) {
  for (int error = 1; error < errno_end; ++error)
    if (text.ends_with(g_strerror(error)))
      return error;
  return std::nullopt;
}

} // namespace

Cause cause_of_writing(int error) {
  return has(errors_that_pass, error) ? Cause::disk : Cause::unwritable;
}

Cause cause_of_reading(int error) {
  const bool passes = has(errors_that_pass, error) || has(reading_errors_that_pass, error);
  return passes ? Cause::missing : Cause::unsupported;
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
