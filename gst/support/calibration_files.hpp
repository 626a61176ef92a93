// SPDX-License-Identifier: LGPL-2.1-or-later
// Reads the files of the properties `camera-info` and `mount`.
#pragma once

#include <gst/gst.h>

#include <optional>
#include <string>

#include "metric/mount.hpp"

namespace terrainseg {

/// A setting that cannot be used: the property, its value, and the reason.
struct SettingFlaw {
  const char* property;
  std::string value, reason;
};

/// Reads camera-info, and mount (a file, or text such as `height=..,pitch=..`); empty = none.
std::optional<SettingFlaw> read_calibration(const std::string& camera_info, const std::string& mount,
                                            std::optional<metric::Camera>& camera,
                                            std::optional<metric::Mount>& mounted);

/// Posts the flaw as an element error.
void post_error(GstElement* element, const SettingFlaw& flaw);

} // namespace terrainseg
