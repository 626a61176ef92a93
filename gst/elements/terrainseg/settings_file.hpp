// SPDX-License-Identifier: LGPL-2.1-or-later
// A settings file: a key file with the group [terrainseg] whose keys are the names of properties.
#pragma once

#include <glib.h>

#include <string>
#include <vector>

namespace terrainseg {

struct SettingsFile {
  struct Entry {
    std::string name, value; ///< the value as gst-launch would take it
  };
  std::string path;
  std::vector<Entry> entries; ///< in the order of the file
  std::string error;          ///< why it cannot be read; empty when it could
};

inline SettingsFile read_settings_file(const std::string& path) {
  constexpr const char* group = "terrainseg";
  SettingsFile file;
  file.path = path;
  g_autoptr(GKeyFile) keys = g_key_file_new();
  g_autoptr(GError) problem = nullptr;
  if (!g_key_file_load_from_file(keys, path.c_str(), G_KEY_FILE_NONE, &problem)) {
    file.error = problem->message;
    return file;
  }
  g_auto(GStrv) names = g_key_file_get_keys(keys, group, nullptr, nullptr);
  if (!names) {
    file.error = std::string("it has no group [") + group + "]";
    return file;
  }
  for (gchar** name = names; *name; ++name) {
    g_autofree gchar* value = g_key_file_get_string(keys, group, *name, &problem);
    if (!value) {
      file.error = problem->message;
      return file;
    }
    file.entries.push_back({*name, value});
  }
  return file;
}

} // namespace terrainseg
