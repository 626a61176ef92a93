// SPDX-License-Identifier: LGPL-2.1-or-later
// Messages of ROS 2 from anybody: what is read of them is sound, and only whole messages are read.
#include <cmath>

#include "input.hpp"
#include "recording/ros_inputs.hpp"

namespace {

using namespace terrainseg;
using fuzz::require;

void check(const std::optional<recording::Attitude>& attitude) {
  if (!attitude)
    return;
  double length = 0;
  for (const double value : attitude->rotation)
    length += value * value;
  require(std::abs(length - 1) < 1e-9);
  require(attitude->time < std::uint64_t{1} << 62);
  const recording::CameraAngles angles =
      recording::camera_angles(attitude->rotation, metric::Mount{1, 0.2, 0.1, 3});
  for (const double angle : {angles.roll, angles.pitch, angles.yaw})
    require(std::isfinite(angle) && std::abs(angle) < 3.15);
}

} // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  fuzz::Input in(data, size);
  const std::uint8_t kind = in.byte();
  const recording::ByteView message = in.take(size);
  switch (kind % 5) {
  case 0:
    check(recording::decode_odometry(message));
    break;
  case 1:
    check(recording::decode_pose_stamped(message));
    break;
  case 2:
    check(recording::decode_imu(message));
    break;
  case 3:
    require(!recording::decode_bool(message) || message.size() < 9);
    break;
  default:
    if (const auto range = recording::decode_range(message))
      require(!std::isnan(*range));
  }
  return 0;
}
