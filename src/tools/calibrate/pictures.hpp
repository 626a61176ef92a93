// SPDX-License-Identifier: LGPL-2.1-or-later
// What needs OpenCV: calibrates a camera from pictures of a chessboard, and draws metres over a picture file.
// Every function throws std::runtime_error with the file's name, or with an explanation in a build without
// OpenCV.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "metric/mount.hpp"
#include "tools/calibrate/files.hpp"

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

/// fitted() for the size of a picture file.
metric::Camera fitted_to_picture(const metric::Camera& camera, const std::string& path);

/// Returns the pixel of a point of the ground; nothing if the point is behind the camera or outside the valid
/// range of the lens model. Only in a build with OpenCV.
std::optional<metric::ImagePoint> pixel_of(const metric::Camera& camera, const metric::Mount& mount,
                                           const metric::GroundPoint& point);

/// Reads `frame`, draws the grid for a camera of that size and writes `picture` (.png or .jpg): labelled
/// lines across at round distances, lines ahead one metre apart, the horizon, and each measured point as a
/// cross with its distance, connected to its position according to the mount.
void draw_over(const std::string& frame, const metric::Camera& camera, const metric::Mount& mount,
               std::span<const MeasuredPoint> points, const std::string& picture);

} // namespace terrainseg::calibrate
