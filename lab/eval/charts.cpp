// SPDX-License-Identifier: LGPL-2.1-or-later
#include "lab/eval/charts.hpp"

#include <algorithm>
#include <fstream>
#include <set>
#include <stdexcept>

#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "lab/eval/sequence.hpp"

namespace terrainseg::eval {

void save_chart(const std::string& path, const Chart& chart) {
  nlohmann::ordered_json curves = nlohmann::ordered_json::array();
  for (const Curve& curve : chart.curves)
    curves.push_back({{"name", curve.name}, {"right", curve.right}, {"points", curve.points}});
  const nlohmann::ordered_json all = {{"title", chart.title},
                                      {"x", chart.x_name},
                                      {"left", chart.left_name},
                                      {"right", chart.right_name},
                                      {"curves", curves}};
  if (!(std::ofstream(path) << all.dump() << '\n' << std::flush))
    throw std::runtime_error(path + ": cannot be written");
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
  cv::Mat all(down * (height + caption + gap), across * (width + gap) - gap, CV_8UC3, cv::Scalar::all(255));
  for (int i = 0; i < count; ++i) {
    const cv::Point at(i % across * (width + gap), i / across * (height + caption + gap));
    const cv::Mat& small = scaled[static_cast<std::size_t>(i)];
    cv::putText(all, tiles[static_cast<std::size_t>(i)].caption, {at.x + 2, at.y + 14},
                cv::FONT_HERSHEY_SIMPLEX, 0.42, {0, 0, 0}, 1, cv::LINE_AA);
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
