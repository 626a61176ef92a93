// SPDX-License-Identifier: LGPL-2.1-or-later
// Tables and charts of the experiments.
#pragma once

#include <initializer_list>
#include <string>
#include <vector>

#include <opencv2/core.hpp>

namespace terrainseg::experiments {

std::string number(double value, int digits);

/// A Markdown table that grows row by row.
class Table {
 public:
  explicit Table(std::vector<std::string> head);
  void add(std::vector<std::string> row);
  std::string text() const;

 private:
  std::vector<std::vector<std::string>> rows_;
};

/// Least, median, deviation, 99th percentile and largest of some times.
struct Spread {
  double least = 0, median = 0, deviation = 0, p99 = 0, max = 0;
  static Spread of(std::vector<double> values);
};

/// Milliseconds that this thread had a processor: other people's work does not count.
double processor_milliseconds();

/// One curve: `right` ones belong to the axis on the right.
struct Curve {
  std::string name;
  std::vector<cv::Point2d> points;
  bool right = false;
};

/// Curves over a common x axis, with an axis on either side; both start at 0.
cv::Mat chart(const std::string& title, const std::string& x_name, const std::string& left_name,
              const std::string& right_name, const std::vector<Curve>& curves);

/// Pictures in rows of `across`, each scaled to `width` and captioned.
struct Tile {
  cv::Mat picture;
  std::string caption;
};
cv::Mat sheet(const std::vector<Tile>& tiles, int across, int width);

/// Writes a picture; throws std::runtime_error that names the path.
void save(const std::string& path, const cv::Mat& picture);

} // namespace terrainseg::experiments
