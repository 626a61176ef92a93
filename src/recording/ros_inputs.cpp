// SPDX-License-Identifier: LGPL-2.1-or-later
#include "recording/ros_inputs.hpp"

#include <algorithm>
#include <bit>
#include <cmath>

namespace terrainseg::recording {
namespace {

/// Reads the members of one CDR message (XCDR1, little-endian) from untrusted bytes, in order. An invalid
/// value counts as a failed read. Check whole() after the last member.
class CdrReader : public ByteReader {
 public:
  /// Refuses messages that are too long and other encodings: big-endian, parameter lists, XCDR2.
  explicit CdrReader(ByteView message) : ByteReader(message) {
    const ByteView header = take(4);
    if (message.size() > longest_input || !ok() || header[0] != 0 || header[1] != 1)
      fail();
    members_ = left();
  }

  std::uint8_t u8() { return integer<std::uint8_t>(); }
  std::uint32_t u32() { return integer<std::uint32_t>(); }
  std::int32_t i32() { return static_cast<std::int32_t>(u32()); }
  float f32() { return std::bit_cast<float>(u32()); }
  double f64() { return std::bit_cast<double>(integer<std::uint64_t>()); }
  bool boolean() {
    const std::uint8_t value = u8();
    if (value > 1)
      fail();
    return value == 1;
  }
  /// Skips a string.
  void skip_string() {
    const ByteView text = take(u32());
    if (text.empty() || text.back() != 0)
      fail();
  }
  void skip_reals(std::size_t count) {
    f64(); // only for its alignment
    take((count - 1) * sizeof(double));
  }
  /// Whether all reads succeeded and only padding follows.
  bool whole() const { return ok() && left() < 4; }

 private:
  template <class Integer> Integer integer() {
    constexpr std::size_t size = sizeof(Integer);
    take((size - (members_ - left()) % size) % size);
    return little<Integer>();
  }

  std::size_t members_ = 0; ///< bytes behind the header
};

/// Nanoseconds. Nothing if the time is before 1970 or the nanoseconds are a second or more.
std::optional<std::uint64_t> read_header(CdrReader& in) {
  const std::int32_t seconds = in.i32();
  const std::uint32_t nanoseconds = in.u32();
  in.skip_string(); // frame_id
  if (seconds < 0 || nanoseconds >= second)
    return std::nullopt;
  return static_cast<std::uint64_t>(seconds) * second + nanoseconds;
}

Quaternion read_quaternion(CdrReader& in) {
  Quaternion q;
  for (double& value : q)
    value = in.f64();
  return q;
}

/// The attitude if the whole message was read and the quaternion is a rotation: a length of 1 +- 0.01.
std::optional<Attitude> checked(const CdrReader& in, std::optional<std::uint64_t> time, Quaternion q) {
  const double length = std::sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
  if (!in.whole() || !time || !(std::abs(length - 1) < 0.01)) // refuses NaN too
    return std::nullopt;
  for (double& value : q)
    value /= length;
  return Attitude{*time, q};
}

} // namespace

std::optional<Attitude> decode_odometry(ByteView message) {
  CdrReader in(message);
  const auto time = read_header(in);
  in.skip_string(); // child_frame_id
  in.skip_reals(3); // position
  const Quaternion rotation = read_quaternion(in);
  in.skip_reals(36 + 6 + 36); // its covariance, twist, its covariance
  return checked(in, time, rotation);
}

std::optional<Attitude> decode_pose_stamped(ByteView message) {
  CdrReader in(message);
  const auto time = read_header(in);
  in.skip_reals(3); // position
  const Quaternion rotation = read_quaternion(in);
  return checked(in, time, rotation);
}

std::optional<Attitude> decode_imu(ByteView message) {
  CdrReader in(message);
  const auto time = read_header(in);
  const Quaternion rotation = read_quaternion(in);
  constexpr double no_orientation = -1; // first element of the covariance, as sensor_msgs/msg/Imu defines it
  if (in.f64() == no_orientation)
    return std::nullopt;
  in.skip_reals(8 + 3 + 9 + 3 + 9);
  return checked(in, time, rotation);
}

std::optional<bool> decode_bool(ByteView message) {
  CdrReader in(message);
  const bool value = in.boolean();
  return in.whole() ? std::optional(value) : std::nullopt;
}

std::optional<float> decode_range(ByteView message) {
  CdrReader in(message);
  const auto time = read_header(in);
  in.u8();                    // radiation_type
  for (int i = 0; i < 3; ++i) // field_of_view, min_range, max_range
    in.f32();
  const float range = in.f32();
  if (in.left() >= sizeof(float))
    in.f32(); // variance
  return in.whole() && time && !std::isnan(range) ? std::optional(range) : std::nullopt;
}

CameraAngles camera_angles(const std::array<double, 4>& vehicle, const metric::Mount& mount) {
  const auto angles = [](const Quaternion& q) {
    const auto [x, y, z, w] = q;
    return CameraAngles{std::atan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y)),
                        std::asin(std::clamp(2 * (w * y - z * x), -1.0, 1.0)),
                        std::atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))};
  };
  const CameraAngles body = angles(vehicle);
  return angles(
      product(rotation_of(0, body.pitch, body.roll), rotation_of(mount.yaw, mount.pitch, mount.roll)));
}

} // namespace terrainseg::recording
