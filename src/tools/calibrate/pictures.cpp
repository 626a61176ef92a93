// SPDX-License-Identifier: LGPL-2.1-or-later
#include "tools/calibrate/pictures.hpp"

#include <cstdint>
#include <opencv2/core/utils/logger.hpp>
#include <opencv2/imgcodecs.hpp>
#include <stdexcept>
#include <vector>

#include "tools/calibrate/files.hpp"
#include "tools/calibrate/grid_picture.hpp"

namespace terrainseg::calibrate {
namespace {

cv::Mat read_picture(const std::string& path) {
  cv::utils::logging::setLogLevel(cv::utils::logging::LOG_LEVEL_SILENT);
  cv::Mat picture = cv::imread(path, cv::IMREAD_COLOR | cv::IMREAD_IGNORE_ORIENTATION);
  if (picture.empty())
    throw std::runtime_error(path +
                             ": not a picture that can be decoded; take one from a video with ffmpeg -i "
                             "VIDEO -frames:v 1 frame.png");
  return picture;
}

void write_picture(const std::string& path, const cv::Mat& picture) {
  std::vector<std::uint8_t> bytes;
  const std::size_t dot = path.rfind('.');
  try {
    if (dot == path.npos || !cv::imencode(path.substr(dot), picture, bytes))
      bytes.clear();
  } catch (const cv::Exception&) {
    bytes.clear();
  }
  if (bytes.empty())
    throw std::runtime_error(path + ": cannot be encoded; name it .png or .jpg");
  write_file(path, {bytes.begin(), bytes.end()});
}

} // namespace

PictureSize size_of_picture(const std::string& path) {
  const cv::Mat picture = read_picture(path);
  return {picture.cols, picture.rows};
}

void draw_over(const std::string& frame, const metric::Camera& camera, const metric::Mount& mount,
               std::span<const MeasuredPoint> points, const std::string& picture) {
  cv::Mat drawn = read_picture(frame);
  draw_grid(drawn, camera, mount, points);
  write_picture(picture, drawn);
}

} // namespace terrainseg::calibrate
