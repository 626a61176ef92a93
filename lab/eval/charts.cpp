// SPDX-License-Identifier: LGPL-2.1-or-later
#include "lab/eval/charts.hpp"

#include <algorithm>
#include <cmath>
#include <set>
#include <stdexcept>

#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "lab/eval/sequence.hpp"
#include "lab/eval/statistics.hpp"

namespace terrainseg::eval {

namespace {

constexpr std::size_t most_marks = 50; // points of a curve that are drawn one by one
const cv::Scalar ink(60, 60, 60), grid_color(228, 228, 228), white(255, 255, 255);

void write(cv::Mat& on, const std::string& text, cv::Point at, const cv::Scalar& color = ink,
           double size = 0.42) {
  cv::putText(on, text, at, cv::FONT_HERSHEY_SIMPLEX, size, color, 1, cv::LINE_AA);
}

/// The end of an axis: 1, 2 or 5 times a power of ten, or a little above the largest value.
double axis_end(double largest) {
  if (largest <= 0)
    return 1;
  const double unit = std::pow(10, std::floor(std::log10(largest)));
  for (const double step : {1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0})
    if (step * unit >= largest)
      return step * unit;
  return 10 * unit;
}

} // namespace

cv::Mat chart(const std::string& title, const std::string& x_name, const std::string& left_name,
              const std::string& right_name, const std::vector<Curve>& curves) {
  const cv::Rect area(70, 44, 620, 300);
  cv::Mat picture(410, 980, CV_8UC3, white);
  double x_low = 1e300, x_high = -1e300, most[2] = {0, 0};
  for (const Curve& curve : curves)
    for (const cv::Point2d& p : curve.points) {
      x_low = std::min(x_low, p.x);
      x_high = std::max(x_high, p.x);
      most[curve.right] = std::max(most[curve.right], p.y);
    }
  x_high = std::max(x_high, x_low + 1);
  const double top[2] = {axis_end(most[0]), axis_end(most[1])};
  const auto place = [&](const cv::Point2d& p, bool right) {
    return cv::Point(area.x + cvRound((p.x - x_low) / (x_high - x_low) * area.width),
                     area.y + area.height - cvRound(p.y / top[right] * area.height));
  };
  constexpr int lines = 5;
  for (int i = 0; i <= lines; ++i) {
    const int y = area.y + area.height - area.height * i / lines;
    cv::line(picture, {area.x, y}, {area.x + area.width, y}, grid_color);
    write(picture, number(top[0] * i / lines, top[0] < 10 ? 1 : 0), {area.x - 44, y + 4});
    if (most[1] > 0)
      write(picture, number(top[1] * i / lines, top[1] < 10 ? 1 : 0), {area.x + area.width + 6, y + 4});
  }
  const int step = std::max(1, static_cast<int>(std::lround((x_high - x_low) / 8)));
  for (int x = static_cast<int>(std::ceil(x_low)); x <= x_high; x += step) {
    const cv::Point p = place({static_cast<double>(x), 0}, false);
    cv::line(picture, p, {p.x, p.y + 4}, ink);
    write(picture, number(x, 0), {p.x - 4, p.y + 18});
  }
  cv::rectangle(picture, area, {150, 150, 150});
  write(picture, title, {area.x, 20}, {0, 0, 0}, 0.5);
  write(picture, left_name, {8, 38});
  if (most[1] > 0)
    write(picture, right_name, {area.x + area.width - 40, 38});
  write(picture, x_name, {area.x + area.width / 2 - 60, area.y + area.height + 42});
  const cv::Scalar colors[] = {{180, 90, 20},  {40, 40, 210}, {60, 150, 40}, {160, 60, 160},
                               {30, 150, 220}, {90, 90, 90},  {200, 170, 30}};
  for (std::size_t i = 0; i < curves.size(); ++i) {
    const Curve& curve = curves[i];
    const cv::Scalar& color = colors[i % std::size(colors)];
    const bool marked = curve.points.size() <= most_marks;
    for (std::size_t k = 0; k < curve.points.size(); ++k) {
      const cv::Point p = place(curve.points[k], curve.right);
      if (marked && curve.right)
        cv::circle(picture, p, 3, color, cv::FILLED, cv::LINE_AA);
      else if (marked)
        cv::rectangle(picture, {p.x - 2, p.y - 2, 5, 5}, color, cv::FILLED);
      if (k > 0)
        cv::line(picture, place(curve.points[k - 1], curve.right), p, color, 1, cv::LINE_AA);
    }
    const cv::Point key(area.x + area.width + 44, area.y + 14 + 20 * static_cast<int>(i));
    cv::line(picture, {key.x, key.y - 4}, {key.x + 20, key.y - 4}, color, 2);
    write(picture, curve.name + (curve.right ? " (right)" : ""), {key.x + 26, key.y});
  }
  return picture;
}

cv::Mat3b judged(const cv::Mat3b& picture, const cv::Mat1b& labels, const cv::Mat1b& mask) {
  cv::Mat3b out = picture.clone();
  for (int y = 0; y < out.rows; ++y)
    for (int x = 0; x < out.cols; ++x) {
      const int label = labels(y, x), said = mask(y, x);
      if (label == label_none)
        continue;
      const bool truth = label == label_terrain || label == label_ground;
      cv::Vec3b color;
      if (said >= 192)
        color = truth ? cv::Vec3b(60, 190, 60) : cv::Vec3b(40, 40, 230);
      else if (said >= 64)
        color = cv::Vec3b(40, 210, 230);
      else if (truth)
        color = cv::Vec3b(230, 80, 40);
      else
        continue;
      for (int c = 0; c < 3; ++c)
        out(y, x)[c] = static_cast<std::uint8_t>((out(y, x)[c] + color[c]) / 2);
    }
  return out;
}

std::vector<int> frames_of_sheet(int count) {
  constexpr int row = 4;
  std::set<int> chosen;
  for (const int first : {0, (count - row) / 2, count - row})
    for (int i = std::max(first, 0); i < std::min(first + row, count); ++i)
      chosen.insert(i);
  return {chosen.begin(), chosen.end()};
}

cv::Mat contact_sheet(const std::vector<Tile>& tiles, int across, int width) {
  constexpr int caption = 20, gap = 4;
  std::vector<cv::Mat> scaled;
  int height = 0;
  for (const Tile& tile : tiles) {
    cv::Mat small;
    const int rows = tile.picture.rows * width / tile.picture.cols;
    cv::resize(tile.picture, small, {width, rows}, 0, 0, cv::INTER_AREA);
    if (small.channels() == 1)
      cv::cvtColor(small, small, cv::COLOR_GRAY2BGR);
    scaled.push_back(small);
    height = std::max(height, rows);
  }
  const int count = static_cast<int>(tiles.size()), down = (count + across - 1) / across;
  cv::Mat all(down * (height + caption + gap), across * (width + gap) - gap, CV_8UC3, white);
  for (int i = 0; i < count; ++i) {
    const cv::Point at(i % across * (width + gap), i / across * (height + caption + gap));
    const cv::Mat& small = scaled[static_cast<std::size_t>(i)];
    write(all, tiles[static_cast<std::size_t>(i)].caption, {at.x + 2, at.y + 14}, {0, 0, 0});
    small.copyTo(all(cv::Rect(at.x, at.y + caption, small.cols, small.rows)));
  }
  return all;
}

void save(const std::string& path, const cv::Mat& picture) {
  const bool jpeg = path.ends_with(".jpg");
  if (!cv::imwrite(path, picture, jpeg ? std::vector<int>{cv::IMWRITE_JPEG_QUALITY, 84} : std::vector<int>{}))
    throw std::runtime_error(path + ": cannot be written");
}

} // namespace terrainseg::eval
