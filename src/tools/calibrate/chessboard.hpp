// SPDX-License-Identifier: LGPL-2.1-or-later
// Calibrates a camera from pictures of a chessboard.
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
  double error = 0; ///< root mean square of the corner residuals, pixels
};

struct Calibration {
  metric::Camera camera;
  std::vector<View> views;
  std::vector<std::string> without_board; ///< pictures without a complete board
  double error = 0;                       ///< root mean square over all views, pixels
  double coverage = 0;                    ///< share of the picture covered by the bounding box of all corners
};

/// Calibrates from all pictures of a folder, sorted by name. Throws std::runtime_error with the remedy if
/// there are no pictures, pictures of several sizes, fewer than five views, or no OpenCV in this build.
Calibration calibrate_from_folder(const std::string& folder, const Board& board, bool fisheye);

} // namespace terrainseg::calibrate
