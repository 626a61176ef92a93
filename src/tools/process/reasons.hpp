// SPDX-License-Identifier: LGPL-2.1-or-later
// Explains GStreamer's errors to users: cause and remedy.
#pragma once

#include <gst/gst.h>

#include <string>
#include <vector>

namespace terrainseg::process {

/// Remedy for files that GStreamer cannot read: convert them with another program.
inline constexpr const char* make_it_anew =
    "convert it with another program: ffmpeg -i INPUT -c:v ffv1 OUTPUT.mkv";

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
