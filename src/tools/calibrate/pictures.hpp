// SPDX-License-Identifier: LGPL-2.1-or-later
// Draws metres over a picture file. Every function throws std::runtime_error with the file's name, or with an
// explanation in a build without OpenCV.
#pragma once

#include <span>
#include <string>

#include "metric/mount.hpp"
#include "tools/calibrate/points.hpp"

namespace terrainseg::calibrate {

struct PictureSize {
  int width = 0, height = 0;
};

PictureSize size_of_picture(const std::string& path);

/// Reads `frame`, draws the grid for a camera of that size and writes `picture` (.png or .jpg).
void draw_over(const std::string& frame, const metric::Camera& camera, const metric::Mount& mount,
               std::span<const MeasuredPoint> points, const std::string& picture);

} // namespace terrainseg::calibrate
