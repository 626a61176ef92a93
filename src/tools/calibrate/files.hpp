// SPDX-License-Identifier: LGPL-2.1-or-later
// Reads and writes the tool's files. Every function throws std::runtime_error with the file's name.
#pragma once

#include <string>

#include "metric/mount.hpp"

namespace terrainseg::calibrate {

std::string read_file(const std::string& path);
/// Writes a file atomically.
void write_file(const std::string& path, const std::string& bytes);

metric::Camera read_camera(const std::string& path);
/// Reads a mount file, or parses its text: `height=0.5,pitch=10deg`.
metric::Mount read_mount_argument(const std::string& argument);

/// Scales a calibration to pictures of another size with the same proportions. Throws if the proportions
/// differ, because the pictures were then cropped.
metric::Camera fitted(const metric::Camera& camera, int width, int height);

} // namespace terrainseg::calibrate
