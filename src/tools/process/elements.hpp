// SPDX-License-Identifier: LGPL-2.1-or-later
// Finds GStreamer's elements, and the Debian package of a missing one.
#pragma once

#include <gst/gst.h>

#include <optional>
#include <string>

#include "tools/process/options.hpp"

namespace terrainseg::process {

/// Before gst_init(): adds the folder of the plugin that belongs to this program, in its build tree or
/// installation, to the plugin path. GST_PLUGIN_PATH has priority.
void point_to_own_plugin();

/// After gst_init(): returns a line for each element that the options need and that is missing, with its
/// Debian package; nothing if all exist.
std::optional<std::string> missing_elements(const Options& options);

/// "x264enc" if it exists, otherwise "openh264enc".
const char* h264_encoder();
/// Longest side of a picture for that encoder, pixels.
int most_encoded_side();

/// Sets a property from text as gst-launch-1.0 does. Refuses unknown, unreadable and read-only properties and
/// values out of range; the error lists valid ones.
std::optional<std::string> set_property(GstElement* element, const std::string& name,
                                        const std::string& value);

/// Applies preset and settings of the options to a terrainseg and (overlay settings) to a terrainoverlay.
/// Either may be null.
std::optional<std::string> apply_settings(const Options& options, GstElement* terrainseg,
                                          GstElement* overlay);

/// Returns why an element with valid settings does not start (such as a missing file); nothing if it starts.
std::optional<std::string> start_problem(GstElement* element);

} // namespace terrainseg::process
