// SPDX-License-Identifier: LGPL-2.1-or-later
// What GStreamer says of a failure, for a person: why, and what to do.
#pragma once

#include <gst/gst.h>

#include <string>
#include <vector>

namespace terrainseg::process {

/// Another program may read what GStreamer does not.
inline constexpr const char* make_it_anew =
    "make it anew with another program: ffmpeg -i INPUT -c:v ffv1 OUTPUT.mkv";

/// The text of an error or a warning: what GStreamer says to users and the detail it keeps for developers,
/// without the places in its sources.
std::string text_of(GstMessage* message);

/// Whether an error says no more than that a stream ended in it ("Internal data stream error.").
bool says_nothing(GstMessage* error);

/// Such an error in words: the element that gave up, and what it complained of before, or the format that
/// nobody takes.
std::string giving_up(GstMessage* error);

/// Keeps in mind what elements complain of in GStreamer's log, which is where the cause of such an error
/// stands. Nothing of it is printed. Where somebody asked for that log, in the environment or among the
/// `arguments` of the program, it is left as it is.
void listen_to_the_log(const std::vector<std::string>& arguments);
void forget_the_log();

/// Why there is no decoder for a stream, of a missing-plugin message.
std::string no_decoder(GstMessage* missing);

} // namespace terrainseg::process
