// SPDX-License-Identifier: LGPL-2.1-or-later
#include "lab/reference/reference_estimate.hpp"

#include <algorithm>
#include <cmath>

namespace terrainseg::reference {

namespace {

constexpr int one_q8 = 256;

/// Per column the highest row that is reached from the window: sideways along its rows, then straight up,
/// over terrain alone; the height where there is none.
void climb(const cv::Mat& mask, const cv::Rect& window, std::vector<std::uint16_t>& boundary) {
  boundary.assign(static_cast<std::size_t>(mask.cols), static_cast<std::uint16_t>(mask.rows));
  const auto terrain = [&](int y, int x) { return mask.at<std::uint8_t>(y, x) == mask_traversable; };
  const auto reached = [&](int y, int x) {
    boundary[static_cast<std::size_t>(x)] = static_cast<std::uint16_t>(y);
  };
  for (int y = window.y + window.height - 1; y >= window.y; --y) {
    const int left = window.x, right = window.x + window.width;
    for (int x = left; x < right; ++x)
      if (terrain(y, x))
        reached(y, x);
    for (int x = left; x > 0 && terrain(y, x) && terrain(y, x - 1); --x)
      reached(y, x - 1);
    for (int x = right - 1; x + 1 < mask.cols && terrain(y, x) && terrain(y, x + 1); ++x)
      reached(y, x + 1);
  }
  for (int x = 0; x < mask.cols; ++x) {
    int y = boundary[static_cast<std::size_t>(x)];
    if (y == mask.rows)
      continue;
    while (y > 0 && terrain(y - 1, x))
      --y;
    reached(y, x);
  }
}

ModelSummary summary_of(const Gaussian& model) {
  ModelSummary summary;
  for (int c = 0; c < 3; ++c) {
    const int bgr = 2 - c; // models are learned in B, G, R; the summary speaks of R, G, B
    const double mean = std::clamp(model.mean[bgr], 0.0, 255.0);
    const auto component = static_cast<std::size_t>(c);
    summary.mean[component] = static_cast<std::uint16_t>(std::lround(mean * one_q8));
    summary.variance[component] =
        static_cast<std::uint32_t>(std::lround(model.covariance(bgr, bgr) * one_q8));
    summary.rgb[component] = static_cast<std::uint8_t>(std::lround(mean));
  }
  summary.mass = static_cast<std::uint64_t>(std::llround(model.mass));
  return summary;
}

} // namespace

Estimate describe(const ReferenceResult& result, std::uint64_t frame, std::uint32_t generation,
                  int blocked_below, std::vector<std::uint16_t>& boundary) {
  const cv::Mat& mask = result.mask;
  const cv::Rect& window = result.window;
  Estimate estimate;
  estimate.frame = frame;
  estimate.frame_width = mask.cols;
  estimate.frame_height = mask.rows;
  estimate.mask = {{mask.data, static_cast<std::ptrdiff_t>(mask.step)}, mask.cols, mask.rows};
  estimate.mask_region = {0, 0, mask.cols, mask.rows};
  estimate.window = {window.x, window.y, window.width, window.height};
  estimate.model_generation = generation;

  const bool known = std::any_of(result.models.begin(), result.models.end(),
                                 [](const Gaussian& model) { return !model.null(); });
  const cv::Mat terrain = mask == mask_traversable;
  const auto pixels = static_cast<double>(mask.total());
  estimate.traversable_permille = static_cast<int>(std::lround(cv::countNonZero(terrain) / pixels * 1000));
  const int training = cv::countNonZero(result.training);
  if (known && training > 0)
    estimate.confidence =
        static_cast<std::uint8_t>(cv::countNonZero(terrain & result.training) * 255LL / training);

  // Training pixels from elsewhere may lie anywhere: then the bottom row stands in for the window.
  const cv::Rect from = window.empty() ? cv::Rect(0, mask.rows - 1, mask.cols, 1) : window;
  climb(mask, from, boundary);
  estimate.boundary = boundary;
  int open = 0;
  for (int x = from.x; x < from.x + from.width; ++x)
    open += boundary[static_cast<std::size_t>(x)] < from.y;

  estimate.flags = 0;
  if (result.learned)
    estimate.flags |= flag_learned;
  if (result.starved)
    estimate.flags |= flag_starved;
  if (!known)
    estimate.flags |= flag_unknown;
  if (!known || open * 1000 < blocked_below * from.width)
    estimate.flags |= flag_blocked;
  for (const Gaussian& model : result.models)
    if (!model.null() && estimate.model_count < max_models)
      estimate.models[static_cast<std::size_t>(estimate.model_count++)] = summary_of(model);
  return estimate;
}

} // namespace terrainseg::reference
