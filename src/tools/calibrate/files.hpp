// SPDX-License-Identifier: LGPL-2.1-or-later
// Files that the tool reads and writes. Every function throws std::runtime_error that names the file.
#pragma once

#include <string>

#include "metric/mount.hpp"

namespace terrainseg::calibrate {

std::string read_file(const std::string& path);
/// Whole or not at all.
void write_file(const std::string& path, const std::string& bytes);

metric::Camera read_camera(const std::string& path);
/// A mount file, or its text: `height=0.5,pitch=10deg`.
metric::Mount read_mount_argument(const std::string& argument);

/// The calibration for pictures of another size of the same proportions; throws when they differ: a cut is no
/// scaling.
metric::Camera fitted(const metric::Camera& camera, int width, int height);

} // namespace terrainseg::calibrate
