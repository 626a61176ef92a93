// SPDX-License-Identifier: LGPL-2.1-or-later
// What the properties `camera-info` and `mount` name.
#pragma once

#include <gst/gst.h>

#include <optional>
#include <string>

#include "metric/mount.hpp"

namespace terrainseg {

/// What was asked for and cannot be used: the property, its value, and why.
struct SettingFlaw {
  const char* property;
  std::string value, reason;
};

/// Reads the file of camera-info, and that of mount (or a mount as `height=..,pitch=..`); empty = none.
std::optional<SettingFlaw> read_calibration(const std::string& camera_info, const std::string& mount,
                                            std::optional<metric::Camera>& camera,
                                            std::optional<metric::Mount>& mounted);

/// Posts the flaw as an error of the element.
void post_error(GstElement* element, const SettingFlaw& flaw);

} // namespace terrainseg
