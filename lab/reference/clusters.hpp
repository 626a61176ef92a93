// SPDX-License-Identifier: LGPL-2.1-or-later
// Training pixels and their grouping into training models (k-means, equations (6) to (8)).
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include <opencv2/core.hpp>

#include "lab/reference/gaussian.hpp"

namespace terrainseg::reference {

/// Colours of the training pixels, one array a channel (B, G, R) so that loops over them run on vectors.
struct TrainingColors {
  std::vector<double> channel[3];
  std::size_t size() const { return channel[0].size(); }
  void clear();
  void reserve(std::size_t count);
  void push_back(double b, double g, double r);
};

/// Reads the pixels of `bgr` (CV_8UC3) at which `mask` (CV_8UC1, same size) is not 0.
void gather(const cv::Mat& bgr, const cv::Mat& mask, TrainingColors& colors);

struct Clustering {
  std::vector<Gaussian> clusters;    ///< only those that own a pixel; the covariance is the sample's own
  std::vector<std::uint8_t> members; ///< per pixel, the index of its cluster
};

/// Lloyd's algorithm, squared Euclidean distance, ties to the lowest index, until nothing changes or
/// `max_iterations` is reached. The first centre is the mean; each other is drawn from the pixels with a
/// probability that grows with its squared distance from the centres so far. `k` is 1..255; the same `seed`
/// gives the same clusters on every platform.
Clustering cluster(const TrainingColors& colors, int k, int max_iterations, std::uint32_t seed);

} // namespace terrainseg::reference
