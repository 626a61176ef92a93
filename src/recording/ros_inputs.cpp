// SPDX-License-Identifier: LGPL-2.1-or-later
#include "recording/ros_inputs.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <string_view>

namespace terrainseg::recording {
namespace {

/// Reads the members of one CDR message (XCDR1, little-endian) from untrusted bytes, in order. A read past
/// the end or of an invalid value returns 0 and marks the reader as failed. Check whole() after the last
/// member.
class CdrReader {
 public:
  /// Refuses other encodings: big-endian, parameter lists, XCDR2.
  explicit CdrReader(ByteView message) : rest_(message) {
    const ByteView header = take(header_size);
    failed_ = failed_ || header[0] != 0 || header[1] != 1;
  }

  std::uint8_t u8() { return integer<std::uint8_t>(); }
  std::uint32_t u32() { return integer<std::uint32_t>(); }
  std::int32_t i32() { return static_cast<std::int32_t>(u32()); }
  float f32() { return std::bit_cast<float>(u32()); }
  double f64() { return std::bit_cast<double>(integer<std::uint64_t>()); }
  bool boolean() {
    const std::uint8_t value = u8();
    failed_ = failed_ || value > 1;
    return value == 1;
  }
  /// A string without its terminating zero; a view into the message.
  std::string_view string() {
    const ByteView text = take(u32());
    failed_ = failed_ || text.empty() || text.back() != 0;
    return failed_ ? std::string_view()
                   : std::string_view(reinterpret_cast<const char*>(text.data()), text.size() - 1);
  }
  void skip_reals(std::size_t count) {
    f64(); // only for its alignment
    take((count - 1) * sizeof(double));
  }

  /// The bytes that have not been read.
  std::size_t left() const { return rest_.size(); }
  /// Whether all reads succeeded and only padding follows.
  bool whole() const { return !failed_ && rest_.size() < 4; }

 private:
  static constexpr std::size_t header_size = 4;

  ByteView take(std::size_t size) {
    failed_ = failed_ || size > rest_.size();
    if (failed_)
      return ByteView(zeros_).first(size <= sizeof zeros_ ? size : 0);
    const ByteView taken = rest_.first(size);
    rest_ = rest_.subspan(size);
    at_ += size;
    return taken;
  }
  template <class Integer> Integer integer() {
    constexpr std::size_t size = sizeof(Integer);
    take((size - (at_ - header_size) % size) % size);
    std::uint64_t value = 0;
    unsigned shift = 0;
    for (const std::uint8_t byte : take(size)) {
      value |= std::uint64_t{byte} << shift;
      shift += 8;
    }
    return static_cast<Integer>(value);
  }

  static constexpr std::uint8_t zeros_[8] = {};
  ByteView rest_;
  std::size_t at_ = 0;
  bool failed_ = false;
};

/// Nanoseconds. Nothing if the time is before 1970 or the nanoseconds are a second or more.
std::optional<std::uint64_t> read_header(CdrReader& in) {
  const std::int32_t seconds = in.i32();
  const std::uint32_t nanoseconds = in.u32();
  in.string(); // frame_id
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

/// Reads a message; one that is too long like an empty one, which every decoder refuses.
CdrReader reader_of(ByteView message) {
  return CdrReader(message.size() <= longest_input ? message : ByteView());
}

} // namespace

std::optional<Attitude> decode_odometry(ByteView message) {
  CdrReader in = reader_of(message);
  const auto time = read_header(in);
  in.string();      // child_frame_id
  in.skip_reals(3); // position
  const Quaternion rotation = read_quaternion(in);
  in.skip_reals(36 + 6 + 36); // its covariance, twist, its covariance
  return checked(in, time, rotation);
}

std::optional<Attitude> decode_pose_stamped(ByteView message) {
  CdrReader in = reader_of(message);
  const auto time = read_header(in);
  in.skip_reals(3); // position
  const Quaternion rotation = read_quaternion(in);
  return checked(in, time, rotation);
}

std::optional<Attitude> decode_imu(ByteView message) {
  CdrReader in = reader_of(message);
  const auto time = read_header(in);
  const Quaternion rotation = read_quaternion(in);
  constexpr double no_orientation = -1; // first element of the covariance, as sensor_msgs/msg/Imu defines it
  if (in.f64() == no_orientation)
    return std::nullopt;
  in.skip_reals(8 + 3 + 9 + 3 + 9);
  return checked(in, time, rotation);
}

std::optional<bool> decode_bool(ByteView message) {
  CdrReader in = reader_of(message);
  const bool value = in.boolean();
  return in.whole() ? std::optional(value) : std::nullopt;
}

std::optional<float> decode_range(ByteView message) {
  CdrReader in = reader_of(message);
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
