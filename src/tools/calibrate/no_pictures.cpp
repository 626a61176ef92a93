// SPDX-License-Identifier: LGPL-2.1-or-later
// Error messages for pictures in a build of terrainseg-calibrate without OpenCV.
#include <stdexcept>

#include "tools/calibrate/pictures.hpp"

namespace terrainseg::calibrate {
namespace {

[[noreturn]] void refuse() {
  throw std::runtime_error("this build reads no pictures: install libopencv-dev and build again with "
                           "-Dcalibrate-pictures=enabled");
}

} // namespace

Calibration calibrate_from_folder(const std::string& /*folder*/, const Board& /*board*/, bool /*fisheye*/) {
  refuse();
}
metric::Camera fitted_to_picture(const metric::Camera& /*camera*/, const std::string& /*path*/) {
  refuse();
}
void draw_over(const std::string& /*frame*/, const metric::Camera& /*camera*/, const metric::Mount& /*mount*/,
               std::span<const MeasuredPoint> /*points*/, const std::string& /*picture*/) {
  refuse();
}

} // namespace terrainseg::calibrate
