// SPDX-License-Identifier: LGPL-2.1-or-later
// The command line of terrainseg-calibrate.
#pragma once

#include <string>
#include <vector>

#include "tools/calibrate/mount_fit.hpp"
#include "tools/calibrate/points.hpp"

namespace terrainseg::calibrate {

/// `terrainseg-calibrate camera FOLDER`.
struct CameraOptions {
  std::string folder, out;
  Board board;
  bool fisheye = false;
};

/// `terrainseg-calibrate mount`.
struct MountOptions {
  std::string camera_info, out, frame, picture; ///< empty = none
  std::vector<MeasuredPoint> points;
  Known known;
};

/// `terrainseg-calibrate check [LINES]`.
struct CheckOptions {
  std::string lines, camera_info, mount, frame, picture; ///< empty = none
};

std::string help();
/// Each throws tools::UsageError, or std::runtime_error for a given file that cannot be read.
CameraOptions parse_camera(const std::vector<std::string>& words);
MountOptions parse_mount(const std::vector<std::string>& words);
CheckOptions parse_check(const std::vector<std::string>& words);

} // namespace terrainseg::calibrate
