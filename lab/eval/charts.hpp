// SPDX-License-Identifier: LGPL-2.1-or-later
// Charts and pictures of what was measured.
#pragma once

#include <string>
#include <utility>
#include <vector>

#include <opencv2/core.hpp>

namespace terrainseg::eval {

/// One curve of points (x, y): `right` ones belong to the axis on the right.
struct Curve {
  std::string name;
  std::vector<std::pair<double, double>> points;
  bool right = false;
};

/// Curves over a common x axis, with an axis on either side.
struct Chart {
  std::string title, x_name, left_name, right_name;
  std::vector<Curve> curves;
};

/// Writes a chart as JSON, which lab/evaluation/draw_charts.py draws; throws std::runtime_error that names
/// the path.
void save_chart(const std::string& path, const Chart& chart);

/// A frame with what is right (green), wrongly called ground (red), missed (blue) and doubtful (yellow).
cv::Mat3b judged(const cv::Mat3b& picture, const cv::Mat1b& labels, const cv::Mat1b& mask);

/// Of `count` frames in the order of their error: up to four of the best, of the middle and of the worst,
/// each once, in that order.
std::vector<int> frames_of_sheet(int count);

/// Pictures in rows of `across`, each scaled to `width` and captioned.
struct Tile {
  cv::Mat picture;
  std::string caption;
};
cv::Mat contact_sheet(const std::vector<Tile>& tiles, int across, int width);

/// Writes a picture; throws std::runtime_error that names the path.
void save(const std::string& path, const cv::Mat& picture);

} // namespace terrainseg::eval
