// SPDX-License-Identifier: LGPL-2.1-or-later
#include "tools/calibrate/pictures.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <opencv2/calib3d.hpp>
#include <opencv2/core/utils/logger.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <optional>
#include <stdexcept>

namespace terrainseg::calibrate {
namespace {

using metric::Camera, metric::GroundPoint, metric::GroundProjection, metric::ImagePoint, metric::Mount;
namespace fs = std::filesystem;

constexpr std::size_t fewest_views = 5;

std::vector<fs::path> files_of(const std::string& folder) {
  std::error_code failed;
  std::vector<fs::path> files;
  for (fs::directory_iterator at(folder, failed), end; !failed && at != end; at.increment(failed))
    if (at->is_regular_file() && cv::haveImageReader(at->path().string()))
      files.push_back(at->path());
  if (failed)
    throw std::runtime_error(folder + ": " + failed.message() +
                             "; name a folder of pictures of a chessboard");
  if (files.empty())
    throw std::runtime_error(folder + ": no pictures in it (PNG or JPEG are expected)");
  std::sort(files.begin(), files.end());
  return files;
}

bool find_board(const cv::Mat& gray, const Board& board, std::vector<cv::Point2f>& corners) {
  const cv::Size pattern(board.columns, board.rows);
  // findChessboardCornersSB, not findChessboardCorners: the latter searches quadrangles in textured pictures
  // without a board for seconds, also with CALIB_CB_FAST_CHECK, which in addition misses boards.
  if (!cv::findChessboardCornersSB(gray, pattern, corners))
    return false;
  // The refinement window must not reach the neighbouring corner.
  double least = 1e9;
  for (std::size_t i = 1; i < corners.size(); ++i)
    least = std::min(least, cv::norm(corners[i] - corners[i - 1]));
  const int half = std::clamp(static_cast<int>(least / 2.5), 2, 11);
  cv::cornerSubPix(gray, corners, {half, half}, {-1, -1},
                   {cv::TermCriteria::EPS | cv::TermCriteria::COUNT, 60, 1e-4});
  return true;
}

using Corners = std::vector<cv::Point2f>;

/// Views, their corners and their common size.
cv::Size look(const std::vector<fs::path>& files, const Board& board, Calibration& out,
              std::vector<Corners>& corners) {
  cv::Size size;
  std::string first;
  for (const fs::path& file : files) {
    const cv::Mat gray = cv::imread(file.string(), cv::IMREAD_GRAYSCALE);
    if (gray.empty())
      throw std::runtime_error(file.string() + ": cannot be decoded; remove it or save it again");
    if (size.empty()) {
      size = gray.size();
      first = file.filename().string();
    } else if (gray.size() != size) {
      throw std::runtime_error(file.string() + ": is " + std::to_string(gray.cols) + "x" +
                               std::to_string(gray.rows) + ", " + first + " is " +
                               std::to_string(size.width) + "x" + std::to_string(size.height) +
                               "; all pictures must have the size that the camera delivers to the filter");
    }
    Corners found;
    if (find_board(gray, board, found)) {
      out.views.push_back({file.filename().string(), 0});
      corners.push_back(std::move(found));
    } else {
      out.without_board.push_back(file.filename().string());
    }
  }
  return size;
}

/// Copies OpenCV's result to camera and errors.
void take(Calibration& out, const cv::Size& size, const cv::Mat& k, const cv::Mat& d, bool fisheye) {
  out.camera.width = size.width;
  out.camera.height = size.height;
  out.camera.fx = k.at<double>(0, 0);
  out.camera.fy = k.at<double>(1, 1);
  out.camera.cx = k.at<double>(0, 2);
  out.camera.cy = k.at<double>(1, 2);
  out.camera.distortion = fisheye ? metric::Distortion::equidistant : metric::Distortion::brown_conrady;
  for (int i = 0; i < std::min<int>(static_cast<int>(d.total()), fisheye ? 4 : 5); ++i)
    out.camera.coefficients[i] = d.at<double>(i);
}

double covered(const std::vector<Corners>& views, const cv::Size& size) {
  cv::Rect2f box;
  for (const Corners& view : views)
    for (const cv::Point2f& p : view)
      box = box.empty() ? cv::Rect2f(p, cv::Size2f(1, 1)) : box | cv::Rect2f(p, cv::Size2f(1, 1));
  return box.area() / static_cast<double>(size.area());
}

const cv::Scalar across_color(0, 220, 255), ahead_color(255, 200, 0), horizon_color(255, 80, 255),
    point_color(60, 60, 255), dark(0, 0, 0);
constexpr double metres_ahead[] = {0.5, 1, 1.5, 2, 3, 4, 5, 7, 10, 15, 20, 30, 50, 100};
constexpr double farthest = 1e12; ///< metres: on the horizon
constexpr int widest = 10;        ///< metres to each side
constexpr int shift = 4;          ///< fixed-point positions of OpenCV: 1/16 pixel

using Curve = std::vector<std::optional<ImagePoint>>;

cv::Point fixed(const ImagePoint& p) {
  return {static_cast<int>(std::lround(p.x * (1 << shift))),
          static_cast<int>(std::lround(p.y * (1 << shift)))};
}

class Pen {
 public:
  explicit Pen(cv::Mat& picture)
      : picture_(picture), thin_(std::max(1, picture.rows / 540)),
        font_(std::max(0.4, picture.rows / 900.0)) {}

  /// A polyline through the visible points in or near the picture.
  void curve(const Curve& points, const cv::Scalar& color) {
    for (const int thickness : {thin_ + 2, thin_})
      for (std::size_t i = 1; i < points.size(); ++i)
        if (near(points[i - 1]) && near(points[i]))
          cv::line(picture_, fixed(*points[i - 1]), fixed(*points[i]), thickness == thin_ ? color : dark,
                   thickness, cv::LINE_AA, shift);
  }
  void text(const std::string& words, const ImagePoint& at, const cv::Scalar& color) {
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
  bool near(const std::optional<ImagePoint>& p) const {
    return p && p->x > -picture_.cols && p->x < 2 * picture_.cols && p->y > -picture_.rows &&
           p->y < 2 * picture_.rows;
  }
  cv::Mat& picture_;
  int thin_;
  double font_;
};

std::string metres(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%g m", value);
  return text;
}

void draw_lines_ahead(Pen& pen, const Camera& camera, const Mount& mount) {
  for (int left = -widest; left <= widest; ++left) {
    Curve points;
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
    Curve points;
    for (int i = -200; i <= 200; ++i)
      points.push_back(pixel_of(camera, mount, {ahead, widest * i / 200.0}));
    pen.curve(points, across_color);
    pen.text(metres(ahead), {middle->x + 6, middle->y - 4}, across_color);
  }
}

void draw_horizon(Pen& pen, const Camera& camera, const Mount& mount) {
  Curve points;
  // NOLINTNEXTLINE(clang-analyzer-security.FloatLoopCounter)
  for (double bearing = -1.4; bearing <= 1.4; bearing += 0.02)
    points.push_back(pixel_of(
        camera, mount, {farthest * std::cos(bearing + mount.yaw), farthest * std::sin(bearing + mount.yaw)}));
  pen.curve(points, horizon_color);
  // At the left edge, which has no distance labels.
  for (const auto& point : points)
    if (point && point->x < camera.width / 4.0 && point->x > -camera.width) {
      pen.text("horizon", {point->x + 6, point->y - 6}, horizon_color);
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
    pen.curve({ImagePoint{point.u, point.v}, should}, point_color);
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
  bool encoded = false;
  try {
    encoded = cv::imencode(path.substr(std::min(path.rfind('.'), path.size())), picture, bytes);
  } catch (const cv::Exception&) { // an unknown extension
  }
  if (!encoded)
    throw std::runtime_error(path + ": cannot be encoded; name it .png or .jpg");
  write_file(path, {bytes.begin(), bytes.end()});
}

} // namespace

Calibration calibrate_from_folder(const std::string& folder, const Board& board, bool fisheye) {
  Calibration out;
  std::vector<Corners> corners;
  const cv::Size size = look(files_of(folder), board, out, corners);
  if (out.views.size() < fewest_views)
    throw std::runtime_error(folder + ": a complete board of " + std::to_string(board.columns) + "x" +
                             std::to_string(board.rows) + " inner corners was found in " +
                             std::to_string(out.views.size()) + " of " +
                             std::to_string(out.views.size() + out.without_board.size()) +
                             " pictures, 5 are needed and 20 are good; does --board count inner corners, is "
                             "the board complete, flat and with a white rim?");
  std::vector<cv::Point3f> model;
  for (int row = 0; row < board.rows; ++row)
    for (int column = 0; column < board.columns; ++column)
      model.emplace_back(static_cast<float>(column * board.square), static_cast<float>(row * board.square),
                         0.f);
  const std::vector<std::vector<cv::Point3f>> models(out.views.size(), model);
  cv::Mat k = cv::Mat::eye(3, 3, CV_64F), d;
  std::vector<cv::Mat> rotations, shifts;
  try {
    out.error =
        fisheye ? cv::fisheye::calibrate(models, corners, size, k, d, rotations, shifts,
                                         cv::fisheye::CALIB_RECOMPUTE_EXTRINSIC | cv::fisheye::CALIB_FIX_SKEW)
                : cv::calibrateCamera(models, corners, size, k, d, rotations, shifts);
  } catch (const cv::Exception&) {
    throw std::runtime_error(folder +
                             ": the views do not determine the lens; take some with the board tilted by 30 "
                             "degrees and more, near the corners of the picture too");
  }
  for (std::size_t i = 0; i < out.views.size(); ++i) {
    Corners seen;
    if (fisheye)
      cv::fisheye::projectPoints(models[i], seen, rotations[i], shifts[i], k, d);
    else
      cv::projectPoints(models[i], rotations[i], shifts[i], k, d, seen);
    out.views[i].error =
        cv::norm(seen, corners[i], cv::NORM_L2) / std::sqrt(static_cast<double>(seen.size()));
  }
  take(out, size, k, d, fisheye);
  out.coverage = covered(corners, size);
  if (std::string flaw = metric::flaw_of(out.camera); !flaw.empty())
    throw std::runtime_error(folder + ": " + flaw + "; take more views, tilted and all over the picture");
  return out;
}

std::optional<ImagePoint> pixel_of(const Camera& camera, const Mount& mount, const GroundPoint& point) {
  const auto ray = GroundProjection(mount).ray_to(point);
  if (!ray)
    return std::nullopt;
  const ImagePoint pixel = metric::distort(camera, *ray);
  // Outside its valid range a lens model folds back: the pixel then shows another ray.
  const auto shown = metric::undistort(camera, pixel.x, pixel.y);
  if (!shown || std::hypot(shown->x - ray->x, shown->y - ray->y) > 1e-3 * (1 + std::hypot(ray->x, ray->y)))
    return std::nullopt;
  return pixel;
}

Camera fitted_to_picture(const Camera& camera, const std::string& path) {
  const cv::Size size = read_picture(path).size();
  return fitted(camera, size.width, size.height);
}

void draw_over(const std::string& frame, const metric::Camera& camera, const metric::Mount& mount,
               std::span<const MeasuredPoint> points, const std::string& picture) {
  cv::Mat drawn = read_picture(frame);
  Pen pen(drawn);
  draw_lines_ahead(pen, camera, mount);
  draw_lines_across(pen, camera, mount);
  draw_horizon(pen, camera, mount);
  for (const MeasuredPoint& point : points)
    draw_point(pen, camera, mount, point);
  write_picture(picture, drawn);
}

} // namespace terrainseg::calibrate
