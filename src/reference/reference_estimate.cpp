// SPDX-License-Identifier: LGPL-2.1-or-later
#include "reference/reference_estimate.hpp"

#include <algorithm>
#include <cmath>

namespace terrainseg::reference {

namespace {

constexpr int one_q8 = 256;

/// Per column, how far up the terrain reaches from `start_row` without a break; the height where it does not
/// begin.
void climb(const cv::Mat& mask, int start_row, std::vector<std::uint16_t>& boundary) {
  boundary.assign(static_cast<std::size_t>(mask.cols), static_cast<std::uint16_t>(mask.rows));
  std::vector<std::uint8_t> open(static_cast<std::size_t>(mask.cols), 1);
  for (int y = start_row; y >= 0; --y) {
    const auto* row = mask.ptr<std::uint8_t>(y);
    bool any = false;
    for (std::size_t x = 0; x < open.size(); ++x) {
      open[x] &= static_cast<std::uint8_t>(row[x] == mask_traversable);
      if (open[x])
        boundary[x] = static_cast<std::uint16_t>(y);
      any |= open[x] != 0;
    }
    if (!any)
      return;
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
  const double pixels = static_cast<double>(mask.total());
  estimate.traversable_permille = static_cast<int>(std::lround(cv::countNonZero(terrain) / pixels * 1000));
  const int training = cv::countNonZero(result.training);
  if (known && training > 0)
    estimate.confidence =
        static_cast<std::uint8_t>(cv::countNonZero(terrain & result.training) * 255LL / training);

  const int start_row = window.empty() ? mask.rows - 1 : window.y + window.height - 1;
  climb(mask, start_row, boundary);
  estimate.boundary = boundary;
  const int from = window.empty() ? 0 : window.x, to = window.empty() ? mask.cols : window.x + window.width;
  const int ahead = window.empty() ? mask.rows - 1 : window.y;
  int open = 0;
  for (int x = from; x < to; ++x)
    open += boundary[static_cast<std::size_t>(x)] < ahead;

  estimate.flags = 0;
  if (result.learned)
    estimate.flags |= flag_learned;
  if (result.starved)
    estimate.flags |= flag_starved;
  if (!known)
    estimate.flags |= flag_unknown;
  if (!known || open * 1000 < blocked_below * (to - from))
    estimate.flags |= flag_blocked;
  for (const Gaussian& model : result.models)
    if (!model.null() && estimate.model_count < max_models)
      estimate.models[static_cast<std::size_t>(estimate.model_count++)] = summary_of(model);
  return estimate;
}

} // namespace terrainseg::reference
