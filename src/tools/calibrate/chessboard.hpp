// SPDX-License-Identifier: LGPL-2.1-or-later
// A camera's calibration from pictures of a chessboard.
#pragma once

#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "metric/camera.hpp"

namespace terrainseg::calibrate {

struct Board {
  int columns = 9, rows = 6; ///< inner corners
  double square = 1;         ///< side of a square, metres; the calibration does not depend on it
};

/// `9x6`; throws std::runtime_error.
Board parse_board(const std::string& text);

/// A picture in which the whole board was found.
struct View {
  std::string name;
  std::vector<cv::Point2f> corners;
  double error = 0; ///< root mean square of the corners, pixels
};

struct Calibration {
  metric::Camera camera;
  std::vector<View> views;
  std::vector<std::string> without_board; ///< pictures in which no whole board was found
  double error = 0;                       ///< root mean square over all views, pixels
  double coverage = 0;                    ///< share of the picture that the box around all corners covers
};

/// Calibrates from all pictures of a folder (or from one after another in any order: sorted by name). Throws
/// std::runtime_error that says what to do: fewer than five views, pictures of several sizes, no pictures.
Calibration calibrate_from_folder(const std::string& folder, const Board& board, bool fisheye);

} // namespace terrainseg::calibrate
