// SPDX-License-Identifier: LGPL-2.1-or-later
// How right the boundary is in metres, on rendered drives: the truth is the scene's own.
#pragma once

#include <array>
#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "lab/eval/range_errors.hpp"
#include "scene/scene.hpp"

namespace terrainseg::eval {

/// Where the boundary's rows come from, and what is known of the camera's attitude.
struct MetricCase {
  enum class Attitude : std::uint8_t {
    pose,      ///< that of each frame
    slow_pose, ///< that of every second frame, and in between a straight line: 15 a second
    mount,     ///< that of the vehicle standing
    too_low,   ///< each frame's, half a degree lower than the camera looks: reads too short
    too_high,  ///< half a degree higher: reads too long
  };
  const char* name;
  bool true_boundary; ///< the labels', else the filter's
  Attitude attitude;
};
inline constexpr std::array<MetricCase, 9> metric_cases{{
    {"true boundary, pose", true, MetricCase::Attitude::pose},
    {"true boundary, pose 15 times a second", true, MetricCase::Attitude::slow_pose},
    {"true boundary, mount only", true, MetricCase::Attitude::mount},
    {"true boundary, pose 0.5 degrees too low", true, MetricCase::Attitude::too_low},
    {"true boundary, pose 0.5 degrees too high", true, MetricCase::Attitude::too_high},
    {"filter, pose", false, MetricCase::Attitude::pose},
    {"filter, mount only", false, MetricCase::Attitude::mount},
    {"filter, pose 0.5 degrees too low", false, MetricCase::Attitude::too_low},
    {"filter, pose 0.5 degrees too high", false, MetricCase::Attitude::too_high},
}};
using MetricErrors = std::array<RangeErrors, metric_cases.size()>;

/// Metres over ground, from below the camera, of what pixel (u, v) shows of the ground; infinite at and above
/// the horizon. Worked out from the camera's axes, apart from src/metric.
double ground_range(const scene::View& view, double u, double v);

/// What the labels say of a column: where the ground that begins at the picture's lower edge ends.
struct TrueEnd {
  int row = 0;  ///< highest row of the ground; the picture's height = none
  int seen = 0; ///< the same with what is not labelled below the end counted as ground: `row` or above it
};
TrueEnd true_end(const GrayView& labels, int column);

/// A drive: some frames to learn from, then some that are measured.
struct MetricDrive {
  scene::Settings scene;
  int width = 640, height = 360;
  std::size_t warm_up = 60, frames = 30, step = 3; ///< every `step`th of `frames` is measured
};
MetricErrors measure(const MetricDrive& drive);

/// `terrainseg-eval metres`: tables of rendered drives, straight and bumpy. Throws UsageError.
void run_metres(const std::vector<std::string>& words);

} // namespace terrainseg::eval
