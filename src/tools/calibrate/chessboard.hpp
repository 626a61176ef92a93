// SPDX-License-Identifier: LGPL-2.1-or-later
// A camera's calibration from pictures of a chessboard.
#pragma once

#include <array>
#include <string>
#include <vector>

#include "metric/camera.hpp"
#include "tools/calibrate/points.hpp"

namespace terrainseg::calibrate {

/// A picture in which the whole board was found.
struct View {
  std::string name;
  double error = 0; ///< root mean square of the corners, pixels
};

struct Calibration {
  metric::Camera camera;
  std::vector<View> views;
  std::vector<std::string> without_board; ///< pictures in which no whole board was found
  double error = 0;                       ///< root mean square over all views, pixels
  double coverage = 0;                    ///< share of the picture that the box around all corners covers
};

/// Calibrates from all pictures of a folder, sorted by name. Throws std::runtime_error that says what to do:
/// fewer than five views, pictures of several sizes, no pictures, a build without OpenCV.
Calibration calibrate_from_folder(const std::string& folder, const Board& board, bool fisheye);

} // namespace terrainseg::calibrate
