// SPDX-License-Identifier: LGPL-2.1-or-later
// Draws metres over a frame, to check a mount by eye.
#pragma once

#include <opencv2/core.hpp>
#include <optional>
#include <span>

#include "metric/mount.hpp"
#include "tools/calibrate/files.hpp"

namespace terrainseg::calibrate {

/// Returns the pixel of a point of the ground; nothing if the point is behind the camera or outside the valid
/// range of the lens model.
std::optional<cv::Point2d> pixel_of(const metric::Camera& camera, const metric::Mount& mount,
                                    const metric::GroundPoint& point);

/// Draws into a BGR picture of the camera's size: labelled lines across at round distances, lines ahead one
/// metre apart, the horizon, and each measured point as a cross with its distance, connected to its position
/// according to the mount.
void draw_grid(cv::Mat& picture, const metric::Camera& camera, const metric::Mount& mount,
               std::span<const MeasuredPoint> points);

} // namespace terrainseg::calibrate
