// SPDX-License-Identifier: LGPL-2.1-or-later
#include "recording/terrain_recording.hpp"

#include <cmath>
#include <utility>

namespace terrainseg::recording {
namespace {

using Quaternion = std::array<double, 4>; // x, y, z, w

Quaternion product(const Quaternion& a, const Quaternion& b) {
  return {a[3] * b[0] + a[0] * b[3] + a[1] * b[2] - a[2] * b[1],
          a[3] * b[1] - a[0] * b[2] + a[1] * b[3] + a[2] * b[0],
          a[3] * b[2] + a[0] * b[1] - a[1] * b[0] + a[2] * b[3],
          a[3] * b[3] - a[0] * b[0] - a[1] * b[1] - a[2] * b[2]};
}

Quaternion about(int axis, double angle) {
  Quaternion q{0, 0, 0, std::cos(angle / 2)};
  q[static_cast<std::size_t>(axis)] = std::sin(angle / 2);
  return q;
}

/// From the camera's optical frame (x right, y down, z forward) to the body's.
Quaternion camera_rotation(double yaw, double pitch, double roll) {
  constexpr Quaternion optical = {-0.5, 0.5, -0.5, 0.5};
  return product(product(product(about(2, yaw), about(1, pitch)), about(0, roll)), optical);
}

McapWriter::Channel channel_of(const char* topic, MessageType type) {
  return {topic, "cdr", type.name, "ros2msg", std::move(type.text), {{"offered_qos_profiles", ""}}, 0};
}

/// A text in double quotes.
std::string quoted_yaml(const std::string& text) {
  constexpr const char* digits = "0123456789abcdef";
  std::string quoted = "\"";
  for (const char c : text) {
    const auto byte = static_cast<unsigned char>(c);
    if (byte < 0x20)
      (quoted += "\\x") += {digits[byte >> 4], digits[byte & 15]};
    else if (c == '"' || c == '\\')
      (quoted += '\\') += c;
    else
      quoted += c;
  }
  return quoted += '"';
}

std::string number(std::uint64_t value) {
  return std::to_string(value);
}

} // namespace

TerrainRecording::TerrainRecording(ByteSink sink, RecordingOptions options)
    : options_(std::move(options)), writer_(std::move(sink), "ros2", "terrainseg") {
  channels_[scan] = writer_.add_channel(channel_of("/terrain/scan", laser_scan_type()));
  channels_[points] = writer_.add_channel(channel_of("/terrain/points", point_cloud_type()));
  channels_[grid] = writer_.add_channel(channel_of("/terrain/grid", occupancy_grid_type()));
  channels_[mask] = writer_.add_channel(channel_of("/terrain/mask", image_type()));
  channels_[camera_info] = writer_.add_channel(channel_of("/camera/camera_info", camera_info_type()));
  channels_[video] = writer_.add_channel(channel_of("/camera/video", compressed_video_type()));
  channels_[tf] = writer_.add_channel(channel_of("/tf", tf_message_type()));
}

bool TerrainRecording::put(Topic topic, std::uint64_t time) {
  return writer_.write(channels_[topic], time, message_);
}

bool TerrainRecording::add_metric(const Header& body, const MetricEstimate& m) {
  beams_.take(m);
  const double since =
      last_scan_ && body.time > *last_scan_ ? static_cast<double>(body.time - *last_scan_) / 1e9 : 0;
  last_scan_ = body.time;
  encode(message_, body,
         LaserScan{beams_.fan().angle_min, beams_.fan().increment, since, beams_.fan().range_min, m.range_max,
                   beams_.ranges()});
  if (!put(scan, body.time))
    return false;
  boundary_points(points_, m);
  encode(message_, body, points_);
  if (!put(points, body.time))
    return false;
  grid_.draw(m, beams_, options_.grid_resolution);
  encode(message_, body, grid_.grid());
  return put(grid, body.time);
}

bool TerrainRecording::add_camera(const Header& camera, int width, int height) {
  if (!options_.camera)
    return true;
  encode(message_, camera, metric::scaled(*options_.camera, width, height));
  return put(camera_info, camera.time);
}

/// The attitude of the moment where metres came with it, else the mount's.
bool TerrainRecording::add_transform(const Header& body, const MetricEstimate* m) {
  if (!options_.mount)
    return true;
  const metric::Mount& mount = *options_.mount;
  Transform transform;
  transform.child = options_.camera_frame;
  transform.translation = {mount.x, mount.y, m ? m->height : mount.height};
  transform.rotation =
      m ? camera_rotation(m->yaw, m->pitch, m->roll) : camera_rotation(mount.yaw, mount.pitch, mount.roll);
  encode(message_, body, transform);
  return put(tf, body.time);
}

bool TerrainRecording::add_video(const Header& camera, ByteView unit) {
  const ByteView whole = unit.empty() ? unit : parameter_sets_.complete(unit, inspect_h264(unit));
  if (whole.empty())
    return true;
  encode_video(message_, camera, whole);
  return put(video, camera.time);
}

bool TerrainRecording::add(const RecordedFrame& frame) {
  const Header body{frame.time, options_.body_frame}, camera{frame.time, options_.camera_frame};
  if (!add_video(camera, frame.video) || !add_transform(body, frame.metric))
    return false;
  if (frame.metric && !add_metric(body, *frame.metric))
    return false;
  if (!frame.estimate)
    return true;
  const Estimate& e = *frame.estimate;
  if (!add_camera(camera, e.frame_width, e.frame_height))
    return false;
  if (e.mask.empty())
    return true;
  encode(message_, camera, e.mask);
  return put(mask, camera.time);
}

std::string TerrainRecording::bag_metadata(const std::string& name) const {
  const std::string start = number(writer_.start_time());
  const std::string duration = number(writer_.end_time() - writer_.start_time());
  const std::string messages = number(writer_.messages());
  std::string text = "rosbag2_bagfile_information:\n  version: 5\n  storage_identifier: mcap\n  duration:\n"
                     "    nanoseconds: " +
                     duration + "\n  starting_time:\n    nanoseconds_since_epoch: " + start +
                     "\n  message_count: " + messages + "\n  topics_with_message_count:\n";
  for (const McapWriter::Channel& channel : writer_.channels())
    if (channel.messages > 0)
      text +=
          "    - topic_metadata:\n        name: " + channel.topic + "\n        type: " + channel.schema +
          "\n        serialization_format: cdr\n        offered_qos_profiles: \"\"\n      message_count: " +
          number(channel.messages) + "\n";
  const std::string quoted = quoted_yaml(name);
  text += "  compression_format: \"\"\n  compression_mode: \"\"\n  relative_file_paths:\n    - " + quoted +
          "\n  files:\n    - path: " + quoted +
          "\n      starting_time:\n        nanoseconds_since_epoch: " + start +
          "\n      duration:\n        nanoseconds: " + duration + "\n      message_count: " + messages + "\n";
  return text;
}

} // namespace terrainseg::recording
