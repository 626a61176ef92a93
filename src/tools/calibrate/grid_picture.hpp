// SPDX-License-Identifier: LGPL-2.1-or-later
// Metres drawn over a frame, by which a person sees whether a mount is right.
#pragma once

#include <opencv2/core.hpp>
#include <optional>
#include <span>

#include "metric/mount.hpp"
#include "tools/calibrate/points.hpp"

namespace terrainseg::calibrate {

/// The pixel that shows a point of the ground; nothing behind the camera, or where the lens model shows other
/// rays.
std::optional<cv::Point2d> pixel_of(const metric::Camera& camera, const metric::Mount& mount,
                                    const metric::GroundPoint& point);

/// Draws into a BGR picture of the camera's size: lines across at round metres ahead with their figures,
/// lines ahead one metre apart, the horizon, and each measured point as a cross with its metres, joined to
/// where the mount has it.
void draw_grid(cv::Mat& picture, const metric::Camera& camera, const metric::Mount& mount,
               std::span<const MeasuredPoint> points);

} // namespace terrainseg::calibrate
