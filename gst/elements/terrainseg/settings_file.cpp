// SPDX-License-Identifier: LGPL-2.1-or-later
#include "elements/terrainseg/settings_file.hpp"

#include <glib.h>

namespace terrainseg {
namespace {

constexpr const char* group = "terrainseg";

} // namespace

SettingsFile read_settings_file(const std::string& path) {
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
