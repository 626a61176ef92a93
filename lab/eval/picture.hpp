// SPDX-License-Identifier: LGPL-2.1-or-later
// A picture as the filter gets it behind `decoder ! videoconvert ! video/x-raw,format=I420`.
#pragma once

#include <array>
#include <optional>
#include <string>

#include <opencv2/core.hpp>

#include "terrainseg/frame.hpp"

namespace terrainseg::eval {

/// Planes of 4:2:0 with what their numbers mean. Copies share memory, as cv::Mat does.
class Picture {
 public:
  Picture() = default;
  /// Planes of unknown content, each side 1..32767.
  Picture(const cv::Size& size, const Colorimetry& colorimetry);
  /// Decodes a PNG or JPEG file as a GStreamer pipeline does: jpegdec leaves 4:2:0 planes of full range as
  /// they are, pngdec's RGB becomes limited range. Throws std::runtime_error that names the file.
  static Picture read(const std::string& path);
  /// From B, G, R of full range, by the converter behind videoconvert.
  static Picture of(const cv::Mat3b& bgr, const Colorimetry& colorimetry);

  /// Scaled by averaging, through B, G, R.
  Picture resized(const cv::Size& size) const;
  /// B, G, R of full range, by the same converter.
  cv::Mat3b bgr() const;
  Frame frame() const;
  MutableFrame mutable_frame();
  cv::Size size() const { return planes_[0].size(); }
  bool empty() const { return planes_[0].empty(); }
  const Colorimetry& colorimetry() const { return colorimetry_; }
  /// Where the camera that rendered it had the ground's vanishing line, Q8 rows; frame() carries it. Changed
  /// pictures have none.
  void set_vanishing_row(std::int32_t row) { vanishing_row_ = row; }

 private:
  std::array<cv::Mat1b, 3> planes_; ///< Y, U, V
  Colorimetry colorimetry_;
  std::optional<std::int32_t> vanishing_row_;
};

} // namespace terrainseg::eval
