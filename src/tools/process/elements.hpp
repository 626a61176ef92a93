// SPDX-License-Identifier: LGPL-2.1-or-later
// Finding GStreamer's elements, and saying which package holds one that is missing.
#pragma once

#include <gst/gst.h>

#include <optional>
#include <string>

#include "tools/process/options.hpp"

namespace terrainseg::process {

/// Before gst_init(): lets GStreamer find the plugin that belongs to this very program, in the build tree it
/// was built in or in the installation it was installed with. What GST_PLUGIN_PATH already says comes first.
void point_to_own_plugin();

/// After gst_init(): one line for each element that the options need and that is not there, with the Debian
/// package that has it; nothing when all are there.
std::optional<std::string> missing_elements(const Options& options);

/// "x264enc" where it is there, else "openh264enc".
const char* h264_encoder();
/// The longest side of a picture that it encodes.
int most_encoded_side();

/// Sets a property from its text form, as gst-launch-1.0 does, but refuses what is unknown, unreadable,
/// read-only or out of range, and says what would be right.
std::optional<std::string> set_property(GstElement* element, const std::string& name,
                                        const std::string& value);

/// Gives the preset and the settings of the options to a terrainseg and (its overlay ones) a terrainoverlay;
/// either may be null.
std::optional<std::string> apply_settings(const Options& options, GstElement* terrainseg,
                                          GstElement* overlay);

/// Why an element whose settings are sound by themselves does not start (a file that they name, say); nothing
/// when it does.
std::optional<std::string> start_problem(GstElement* element);

} // namespace terrainseg::process
