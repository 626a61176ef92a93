// SPDX-License-Identifier: LGPL-2.1-or-later
// A settings file: a key file with the group [terrainseg] whose keys are the names of properties.
#pragma once

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

SettingsFile read_settings_file(const std::string& path);

} // namespace terrainseg
