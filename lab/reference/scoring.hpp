// SPDX-License-Identifier: LGPL-2.1-or-later
// Labels every pixel by its distance to the learned models, then cleans the labels up.
#pragma once

#include <cstdint>
#include <vector>

#include <opencv2/core.hpp>

#include "lab/reference/gaussian.hpp"

namespace terrainseg::reference {

/// The least squared Mahalanobis distance of every pixel of `bgr` (CV_8UC3) to any of `models`, compared with
/// `threshold` sigmas: CV_8UC1, 255 = terrain. All 0 without models. Models need positive definite
/// covariances.
void label_pixels(const cv::Mat& bgr, const std::vector<Gaussian>& models, double threshold, cv::Mat& mask);

/// What is done to the labels; keeps its buffers from frame to frame.
class CleanUp {
 public:
  /// 3x3 squares: so many dilations, then so many erosions, in place.
  void smooth(cv::Mat& mask, int dilations, int erosions);
  /// Clears the 8-connected areas of `mask` that share no pixel with `training`.
  void keep_connected(cv::Mat& mask, const cv::Mat& training);

 private:
  cv::Mat other_, areas_;
  std::vector<std::uint8_t> kept_;
};

} // namespace terrainseg::reference
