// SPDX-License-Identifier: LGPL-2.1-or-later
#include "tools/calibrate/pictures.hpp"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <opencv2/calib3d.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <stdexcept>

namespace terrainseg::calibrate {
namespace {

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
                             "the board complete, flat "
                             "and with a white rim?");
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

} // namespace terrainseg::calibrate
