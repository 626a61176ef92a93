// SPDX-License-Identifier: LGPL-2.1-or-later
// Finds GStreamer's elements, and the Debian package of a missing one.
#pragma once

#include <gst/gst.h>

#include "tools/process/options.hpp"

namespace terrainseg::process {

/// Before gst_init(): adds the folder of the plugin that belongs to this program, in its build tree or
/// installation, to the plugin path. GST_PLUGIN_PATH has priority.
void point_to_own_plugin();

/// After gst_init(): throws EarlyExit with a line for each element that the options need and that is missing,
/// with its Debian package.
void check_elements(const Options& options);

/// Whether x264enc encodes the videos; otherwise openh264enc does.
bool has_x264();

/// Applies preset and settings of the options to a terrainseg and (overlay settings) to a terrainoverlay,
/// which may be null. Throws tools::UsageError.
void apply_settings(const Options& options, GstElement* terrainseg, GstElement* overlay);

/// Validates the settings, and reads the files that they refer to, before the first input is opened. Throws
/// tools::UsageError.
void check_settings(const Options& options);

} // namespace terrainseg::process
