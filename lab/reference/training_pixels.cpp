// SPDX-License-Identifier: LGPL-2.1-or-later
#include "lab/reference/training_pixels.hpp"

#include <algorithm>
#include <cmath>

namespace terrainseg::reference {

namespace {

int largest_power_of_two(int limit) {
  int power = 1;
  while (power * 2 <= limit)
    power *= 2;
  return power;
}

/// Height of a row's centre above the bottom edge, as a fraction of the frame's height.
double height_of(int row, int rows) {
  return (rows - 0.5 - row) / rows;
}

/// Sums of a line fit; log depth against height.
struct Line {
  double n = 0, x = 0, y = 0, xx = 0, xy = 0;
  int rows = 0;

  void add_row(const std::uint16_t* depth, int from, int to, double height, double low, double high) {
    bool any = false;
    for (int c = from; c < to; ++c) {
      if (depth[c] == 0 || depth[c] < low || depth[c] > high)
        continue;
      const double value = std::log(depth[c] / 1000.0);
      n += 1;
      x += height;
      y += value;
      xx += height * height;
      xy += height * value;
      any = true;
    }
    rows += any;
  }

  std::optional<FloorProfile> solve() const {
    constexpr double fewest_pixels = 64;
    constexpr int fewest_rows = 4;
    if (n < fewest_pixels || rows < fewest_rows)
      return std::nullopt;
    const double slope = (n * xy - x * y) / (n * xx - x * x);
    return FloorProfile{std::exp((y - slope * x) / n), slope};
  }
};

} // namespace

cv::Rect window_in(cv::Size frame, const WindowPlace& place) {
  const int power = largest_power_of_two(std::max(1, frame.width / 5));
  const int auto_width = place.power_of_two_window ? power : frame.width * 30 / 100;
  const int auto_height = place.power_of_two_window ? power / 2 : frame.height * 15 / 100;
  const int width = place.width > 0 ? place.width : std::max(1, auto_width);
  const int height = place.height > 0 ? place.height : std::max(1, auto_height);
  const int x = place.x >= 0 ? place.x : (frame.width - width) / 2;
  return cv::Rect(x, frame.height - place.bottom - height, width, height) & cv::Rect({0, 0}, frame);
}

void window_pixels(const cv::Mat& bgr, const cv::Rect& window, double sigma, cv::Mat& mask) {
  mask.create(bgr.size(), CV_8UC1);
  mask.setTo(0);
  if (window.empty())
    return;
  cv::Mat chosen = mask(window);
  if (sigma <= 0) {
    chosen.setTo(255);
    return;
  }
  cv::Scalar mean, deviation;
  cv::meanStdDev(bgr(window), mean, deviation);
  for (int c = 0; c < 3; ++c)
    // A window of one colour has no deviation; half a step keeps its pixels.
    deviation[c] = std::max(deviation[c] * sigma, 0.5);
  cv::inRange(bgr(window), mean - deviation, mean + deviation, chosen);
}

double FloorProfile::depth_at(double height) const {
  return a * std::exp(b * height);
}

std::optional<FloorProfile> fit_floor(const cv::Mat& depth, const cv::Rect& region, double tolerance) {
  CV_Assert(depth.type() == CV_16UC1);
  const cv::Rect inside = region & cv::Rect({0, 0}, depth.size());
  Line start;
  for (int y = inside.y; y < inside.y + inside.height; ++y)
    start.add_row(depth.ptr<std::uint16_t>(y), inside.x, inside.x + inside.width, height_of(y, depth.rows), 0,
                  65535);
  std::optional<FloorProfile> floor = start.solve();
  for (int round = 0; floor && round < 5; ++round) {
    Line line;
    for (int y = depth.rows / 2; y < depth.rows; ++y) {
      const double height = height_of(y, depth.rows), expected = 1000 * floor->depth_at(height);
      line.add_row(depth.ptr<std::uint16_t>(y), 0, depth.cols, height, expected * (1 - tolerance),
                   expected * (1 + tolerance));
    }
    const std::optional<FloorProfile> better = line.solve();
    if (!better)
      break;
    floor = better;
  }
  return floor;
}

cv::Mat floor_pixels(const cv::Mat& depth, const FloorProfile& floor, double tolerance, double near) {
  CV_Assert(depth.type() == CV_16UC1);
  cv::Mat mask = cv::Mat::zeros(depth.size(), CV_8UC1);
  for (int y = 0; y < depth.rows; ++y) {
    const double expected = 1000 * floor.depth_at(height_of(y, depth.rows));
    const double low = expected * (1 - tolerance);
    const double high = std::min(expected * (1 + tolerance), near * 1000);
    const auto* in = depth.ptr<std::uint16_t>(y);
    auto* out = mask.ptr<std::uint8_t>(y);
    for (int x = 0; x < depth.cols; ++x)
      out[x] = in[x] != 0 && in[x] >= low && in[x] <= high ? 255 : 0;
  }
  return mask;
}

} // namespace terrainseg::reference
