// SPDX-License-Identifier: LGPL-2.1-or-later
// Which pixels train: a window in front of the rover, or what a range image shows to be near floor (paper,
// section 4.2, equations (18) and (19)). Masks are CV_8UC1 of the frame's size, 255 = trains.
#pragma once

#include <optional>

#include <opencv2/core.hpp>

namespace terrainseg::reference {

/// Place of the training window, in pixels; the rules for 0 and -1 are those of `terrainseg`.
struct WindowPlace {
  int width = 0, height = 0; ///< 0 = by the rule
  int bottom = 0;            ///< rows between the window and the bottom edge
  int x = -1;                ///< left edge, -1 = centred
  bool power_of_two_window =
      true; ///< rule: true the paper's 2^p x 2^(p-1) not above width / 5, false 30 % x 15 %
};

/// The window in a frame of this size, clipped to the frame; empty when nothing of it lies in the frame.
cv::Rect window_in(cv::Size frame, const WindowPlace& place);

/// The pixels of the window; with `sigma` above 0 only those whose every channel lies within that many
/// standard deviations of the window's mean (paper, figure 5).
void window_pixels(const cv::Mat& bgr, const cv::Rect& window, double sigma, cv::Mat& mask);

/// The floor's depth in metres as a function of the row, equation (18): a * exp(b * height above the bottom
/// edge), the height as a fraction of the frame's.
struct FloorProfile {
  double a = 0, b = 0;
  double depth_at(double height) const;
};

/// Least squares of log depth over the valid pixels of `region`, then five more times over all pixels of the
/// lower half that lie within `tolerance` (a fraction) of the last fit. `depth` is CV_16UC1 in millimetres, 0
/// = none. Nothing when the region has fewer than 64 valid pixels or fewer than 4 rows of them.
std::optional<FloorProfile> fit_floor(const cv::Mat& depth, const cv::Rect& region, double tolerance);

/// Equation (19): pixels that lie on the floor (within `tolerance` of the profile) and nearer than `near`
/// metres.
cv::Mat floor_pixels(const cv::Mat& depth, const FloorProfile& floor, double tolerance, double near);

} // namespace terrainseg::reference
