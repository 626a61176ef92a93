// SPDX-License-Identifier: LGPL-2.1-or-later
#include "tools/calibrate/grid_picture.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <opencv2/core/utils/logger.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <stdexcept>
#include <string>
#include <vector>

#include "tools/calibrate/pictures.hpp"

namespace terrainseg::calibrate {
namespace {

using metric::Camera, metric::GroundPoint, metric::GroundProjection, metric::ImagePoint, metric::Mount;

const cv::Scalar across_color(0, 220, 255), ahead_color(255, 200, 0), horizon_color(255, 80, 255),
    point_color(60, 60, 255), dark(0, 0, 0);
constexpr double metres_ahead[] = {0.5, 1, 1.5, 2, 3, 4, 5, 7, 10, 15, 20, 30, 50, 100};
constexpr int widest = 10; ///< metres to each side
constexpr int shift = 4;   ///< fixed-point positions of OpenCV: 1/16 pixel

cv::Point fixed(const cv::Point2d& p) {
  return {static_cast<int>(std::lround(p.x * (1 << shift))),
          static_cast<int>(std::lround(p.y * (1 << shift)))};
}

class Pen {
 public:
  explicit Pen(cv::Mat& picture)
      : picture_(picture), thin_(std::max(1, picture.rows / 540)),
        font_(std::max(0.4, picture.rows / 900.0)) {}

  /// A polyline through the visible points in or near the picture.
  void curve(const std::vector<std::optional<cv::Point2d>>& points, const cv::Scalar& color) {
    for (const int thickness : {thin_ + 2, thin_})
      for (std::size_t i = 1; i < points.size(); ++i)
        if (near(points[i - 1]) && near(points[i]))
          cv::line(picture_, fixed(*points[i - 1]), fixed(*points[i]), thickness == thin_ ? color : dark,
                   thickness, cv::LINE_AA, shift);
  }
  void text(const std::string& words, cv::Point2d at, const cv::Scalar& color) {
    const cv::Size size = cv::getTextSize(words, cv::FONT_HERSHEY_SIMPLEX, font_, thin_, nullptr);
    const cv::Point place(
        std::clamp(static_cast<int>(at.x), 2, std::max(picture_.cols - size.width - 2, 2)),
        std::clamp(static_cast<int>(at.y), size.height + 2, std::max(picture_.rows - 4, 2)));
    for (const int thickness : {thin_ + 3, thin_})
      cv::putText(picture_, words, place, cv::FONT_HERSHEY_SIMPLEX, font_, thickness == thin_ ? color : dark,
                  thickness, cv::LINE_AA);
  }
  void cross(const cv::Point2d& at, const cv::Scalar& color) {
    for (const int thickness : {thin_ + 3, thin_ + 1})
      cv::drawMarker(picture_, at, thickness == thin_ + 1 ? color : dark, cv::MARKER_CROSS,
                     std::max(picture_.rows / 30, 9), thickness, cv::LINE_AA);
  }
  double line_height() const { return 30 * font_; }

 private:
  bool near(const std::optional<cv::Point2d>& p) const {
    return p && p->x > -picture_.cols && p->x < 2 * picture_.cols && p->y > -picture_.rows &&
           p->y < 2 * picture_.rows;
  }
  cv::Mat& picture_;
  int thin_;
  double font_;
};

/// The pixel of a direction in the body frame.
std::optional<cv::Point2d> pixel_of_direction(const Camera& camera, const Mount& mount,
                                              const double (&b)[3]) {
  const GroundProjection turn(mount);
  // Columns of the rotation matrix: the images of the camera's axes. Its inverse is its transpose.
  double in_camera[3]{};
  for (int axis = 0; axis < 3; ++axis) {
    const double forward = turn.along(axis, {0, 0});
    in_camera[0] += forward * b[axis];
    in_camera[1] += (turn.along(axis, {-1, 0}) - forward) * b[axis];
    in_camera[2] += (turn.along(axis, {0, -1}) - forward) * b[axis];
  }
  if (in_camera[0] <= 1e-6)
    return std::nullopt;
  const ImagePoint ray{-in_camera[1] / in_camera[0], -in_camera[2] / in_camera[0]};
  const ImagePoint pixel = metric::distort(camera, ray);
  // Outside its valid range a lens model folds back: the pixel then shows another ray.
  const auto shown = metric::undistort(camera, pixel.x, pixel.y);
  if (!shown || std::hypot(shown->x - ray.x, shown->y - ray.y) > 1e-3 * (1 + std::hypot(ray.x, ray.y)))
    return std::nullopt;
  return cv::Point2d(pixel.x, pixel.y);
}

std::string metres(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%g m", value);
  return text;
}

void draw_lines_ahead(Pen& pen, const Camera& camera, const Mount& mount) {
  for (int left = -widest; left <= widest; ++left) {
    std::vector<std::optional<cv::Point2d>> points;
    // NOLINTNEXTLINE(clang-analyzer-security.FloatLoopCounter)
    for (double ahead = mount.height / 4; ahead < 30; ahead *= 1.03)
      points.push_back(pixel_of(camera, mount, {ahead, static_cast<double>(left)}));
    pen.curve(points, ahead_color);
  }
}

void draw_lines_across(Pen& pen, const Camera& camera, const Mount& mount) {
  double last_row = 1e9;
  for (const double ahead : metres_ahead) {
    const auto middle = pixel_of(camera, mount, {ahead, 0});
    // Skips lines below the picture and lines that would touch the previous one.
    if (!middle || middle->y > camera.height || last_row - middle->y < pen.line_height())
      continue;
    last_row = middle->y;
    std::vector<std::optional<cv::Point2d>> points;
    for (int i = -200; i <= 200; ++i)
      points.push_back(pixel_of(camera, mount, {ahead, widest * i / 200.0}));
    pen.curve(points, across_color);
    pen.text(metres(ahead), *middle + cv::Point2d(6, -4), across_color);
  }
}

void draw_horizon(Pen& pen, const Camera& camera, const Mount& mount) {
  std::vector<std::optional<cv::Point2d>> points;
  // NOLINTNEXTLINE(clang-analyzer-security.FloatLoopCounter)
  for (double bearing = -1.4; bearing <= 1.4; bearing += 0.02)
    points.push_back(
        pixel_of_direction(camera, mount, {std::cos(bearing + mount.yaw), std::sin(bearing + mount.yaw), 0}));
  pen.curve(points, horizon_color);
  // At the left edge, which has no distance labels.
  for (const auto& point : points)
    if (point && point->x < camera.width / 4.0 && point->x > -camera.width) {
      pen.text("horizon", *point + cv::Point2d(6, -6), horizon_color);
      break;
    }
}

void draw_point(Pen& pen, const Camera& camera, const Mount& mount, const MeasuredPoint& point) {
  const auto ray = metric::undistort(camera, point.u, point.v);
  const GroundProjection ground(mount);
  if (ray) {
    const double bearing = std::atan2(ground.along(1, *ray), ground.along(0, *ray));
    const auto should = pixel_of(
        camera, mount,
        {mount.x + point.distance * std::cos(bearing), mount.y + point.distance * std::sin(bearing)});
    pen.curve({cv::Point2d(point.u, point.v), should}, point_color);
  }
  pen.cross({point.u, point.v}, point_color);
  pen.text(metres(point.distance), {point.u + 10, point.v + 16}, point_color);
}

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

std::optional<cv::Point2d> pixel_of(const Camera& camera, const Mount& mount, const GroundPoint& point) {
  return pixel_of_direction(camera, mount, {point.x - mount.x, point.y - mount.y, -mount.height});
}

void draw_grid(cv::Mat& picture, const Camera& camera, const Mount& mount,
               std::span<const MeasuredPoint> points) {
  Pen pen(picture);
  draw_lines_ahead(pen, camera, mount);
  draw_lines_across(pen, camera, mount);
  draw_horizon(pen, camera, mount);
  for (const MeasuredPoint& point : points)
    draw_point(pen, camera, mount, point);
}

Camera fitted_to_picture(const Camera& camera, const std::string& path) {
  const cv::Size size = read_picture(path).size();
  return fitted(camera, size.width, size.height);
}

void draw_over(const std::string& frame, const metric::Camera& camera, const metric::Mount& mount,
               std::span<const MeasuredPoint> points, const std::string& picture) {
  cv::Mat drawn = read_picture(frame);
  draw_grid(drawn, camera, mount, points);
  write_picture(picture, drawn);
}

} // namespace terrainseg::calibrate
