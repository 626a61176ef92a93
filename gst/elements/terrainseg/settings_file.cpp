// SPDX-License-Identifier: LGPL-2.1-or-later
#include "elements/terrainseg/settings_file.hpp"

#include <glib.h>

#include <memory>

namespace terrainseg {
namespace {

constexpr const char* group = "terrainseg";

struct Free {
  void operator()(GKeyFile* file) const { g_key_file_unref(file); }
  void operator()(GError* error) const { g_error_free(error); }
  void operator()(gchar* text) const { g_free(text); }
  void operator()(gchar** texts) const { g_strfreev(texts); }
};
using KeyFile = std::unique_ptr<GKeyFile, Free>;
using Error = std::unique_ptr<GError, Free>;

} // namespace

SettingsFile read_settings_file(const std::string& path) {
  SettingsFile file;
  file.path = path;
  const KeyFile keys(g_key_file_new());
  GError* problem = nullptr;
  if (!g_key_file_load_from_file(keys.get(), path.c_str(), G_KEY_FILE_NONE, &problem)) {
    file.error = Error(problem)->message;
    return file;
  }
  const std::unique_ptr<gchar*, Free> names(g_key_file_get_keys(keys.get(), group, nullptr, nullptr));
  if (!names) {
    file.error = std::string("it has no group [") + group + "]";
    return file;
  }
  for (gchar** name = names.get(); *name; ++name) {
    const std::unique_ptr<gchar, Free> value(g_key_file_get_string(keys.get(), group, *name, &problem));
    if (!value) {
      file.error = Error(problem)->message;
      return file;
    }
    file.entries.push_back({*name, value.get()});
  }
  return file;
}

} // namespace terrainseg
