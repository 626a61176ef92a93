// SPDX-License-Identifier: LGPL-2.1-or-later
// Why an input is not complete: sorts errors into temporary (exit code 75) and permanent ones (1), and
// explains GStreamer's errors to users.
#pragma once

#include <gst/gst.h>

#include <cstdint>
#include <string>
#include <vector>

namespace terrainseg::process {

/// As scripts see them.
enum class Cause : std::uint8_t {
  none,
  damaged,     ///< its content, or a part of it, cannot be decoded
  unsupported, ///< no video in it, or no decoder for it
  stalled,     ///< the decoder delivered no frame for the time of --stall-timeout
  crashed,     ///< the process that decodes it crashed
  unwritable,  ///< the name or the folder of an output is not writable
  changed,     ///< it was modified or replaced while it was read
  missing,     ///< does not exist, or is not readable
  disk,        ///< an output could not be written
  resources,   ///< no memory, threads or descriptors; an internal error of the pipeline
  interrupted, ///< by a signal
};

/// The name of a cause in records and manifests.
inline const char* name_of(Cause cause) {
  constexpr const char* names[] = {"none",    "damaged",    "unsupported", "stalled",
                                   "crashed", "unwritable", "changed",     "missing",
                                   "disk",    "resources",  "interrupted"};
  return names[static_cast<int>(cause)];
}

/// Whether the same command may succeed later without a change of the input.
inline bool may_pass_later(Cause cause) {
  return cause >= Cause::changed;
}

/// The message and its cause. No cause: no fault.
struct Fault {
  Cause cause = Cause::none;
  std::string text;
  explicit operator bool() const { return cause != Cause::none; }
};

/// For an errno while writing: Cause::disk if temporary, Cause::unwritable if permanent.
Cause cause_of_writing(int error);
/// For an errno while reading an input: Cause::missing if temporary, Cause::unsupported if permanent.
Cause cause_of_reading(int error);
Cause cause_of_reading(const GError* error); ///< for the domain G_FILE_ERROR
/// "cannot WHAT PATH: text of the errno", with the cause for writing.
Fault cannot(const std::string& what, const std::string& path, int error);

/// For an error message of the source: of the reading element, or of a demuxer or decoder.
Cause cause_in_source(GstMessage* error);
/// For an error message of an element after the source. `writes`: it writes an output.
Cause cause_behind_source(GstMessage* error, bool writes);

/// Remedy for files that GStreamer cannot read: convert them with another program.
inline constexpr const char* make_it_anew =
    "convert it with another program: ffmpeg -i INPUT -c:v ffv1 OUTPUT.mkv";

/// The name of an element's factory; its own name if it has none.
std::string factory_of(const GstObject* element);

/// The text of an error or warning: the message and the debug detail, without source locations.
std::string text_of(GstMessage* message);

/// Whether an error only reports that a stream ended in it ("Internal data stream error.").
bool says_nothing(GstMessage* error);

/// Explains such an error: the element that failed and its earlier log message, or the format that no element
/// accepts.
std::string giving_up(GstMessage* error);

/// Captures what elements write to GStreamer's log, which has the cause of such an error. Prints nothing.
/// Does nothing if the log was requested by the environment or the `arguments` of the program.
void listen_to_the_log(const std::vector<std::string>& arguments);
void forget_the_log();

/// Why a stream has no decoder, from a missing-plugin message.
std::string no_decoder(GstMessage* missing);

} // namespace terrainseg::process
