// SPDX-License-Identifier: LGPL-2.1-or-later
// Reads the files of the properties `camera-info` and `mount`.
#pragma once

#include <glib.h>
#include <gst/gst.h>

#include <cerrno>
#include <fstream>
#include <optional>
#include <string>

#include "metric/camera_info.hpp"
#include "metric/mount.hpp"
#include "terrainseg/settings.hpp"

namespace terrainseg {

inline constexpr std::streamsize longest_file = 1 << 20; // maximum size of a calibration file, bytes

/// Returns the text of a file. Returns nothing and sets the reason if it cannot be read.
inline std::optional<std::string> text_of(const std::string& path, std::string& error) {
  if (g_file_test(path.c_str(), G_FILE_TEST_IS_DIR)) {
    error = "it is a folder";
    return std::nullopt;
  }
  errno = 0;
  std::ifstream file(path, std::ios::binary);
  if (!file) {
    error = g_strerror(errno ? errno : ENOENT);
    return std::nullopt;
  }
  std::string text(static_cast<std::size_t>(longest_file) + 1, '\0');
  file.read(text.data(), longest_file + 1);
  text.resize(static_cast<std::size_t>(file.gcount()));
  return text;
}

/// Returns the calibration in a file. Returns nothing and sets the reason if it is invalid.
inline std::optional<metric::Camera> camera_of(const std::string& path, std::string& error) {
  const auto text = text_of(path, error);
  return text ? metric::read_camera_info(*text, error) : std::nullopt;
}

/// Returns the mount from a file or from text. Returns nothing and sets the reason if it is invalid.
inline std::optional<metric::Mount> mount_of(const std::string& value, std::string& error) {
  if (value.find('=') != std::string::npos && !g_file_test(value.c_str(), G_FILE_TEST_EXISTS))
    return metric::parse_mount(value, error);
  const auto text = text_of(value, error);
  return text ? metric::read_mount(*text, error) : std::nullopt;
}

/// Reads camera-info, and mount (a file, or text such as `height=..,pitch=..`); empty = none.
inline std::optional<SettingsError> read_calibration(const std::string& camera_info, const std::string& mount,
                                                     std::optional<metric::Camera>& camera,
                                                     std::optional<metric::Mount>& mounted) {
  std::string error;
  if (!camera_info.empty() && !(camera = camera_of(camera_info, error)))
    return SettingsError{"camera-info", camera_info, error};
  if (!mount.empty() && !(mounted = mount_of(mount, error)))
    return SettingsError{"mount", mount, error};
  return std::nullopt;
}

/// Posts the flaw as an element error.
inline void post_error(gpointer element, const SettingsError& flaw) {
  GST_ELEMENT_ERROR(
      element, RESOURCE, SETTINGS,
      ("\"%s\" of property %s cannot be used: %s.", flaw.value.c_str(), flaw.property.c_str(),
       flaw.reason.c_str()),
      ("property %s, value \"%s\": %s", flaw.property.c_str(), flaw.value.c_str(), flaw.reason.c_str()));
}

} // namespace terrainseg
