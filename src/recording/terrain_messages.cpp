// SPDX-License-Identifier: LGPL-2.1-or-later
#include "recording/terrain_messages.hpp"

#include <utility>

#include "recording/message_parts.hpp"
#include "recording/rotation.hpp"

namespace terrainseg::recording {
namespace {

/// Rotation from the camera's optical frame (x right, y down, z forward) to the body frame.
Quaternion camera_rotation(double yaw, double pitch, double roll) {
  constexpr Quaternion optical = {-0.5, 0.5, -0.5, 0.5};
  return product(rotation_of(yaw, pitch, roll), optical);
}

const char* text_of(bool value) {
  return value ? "true" : "false";
}

/// The diagnostic status of an estimate.
DiagnosticStatus status_of(const Estimate& e, bool has_metres, std::optional<bool> near_clear) {
  const auto has = [&](Flag flag) { return (e.flags & flag) != 0; };
  DiagnosticStatus status;
  status.level = has(flag_unknown) || has(flag_window_still) ? DiagnosticStatus::warn : DiagnosticStatus::ok;
  status.name = "terrainseg: terrain";
  const char* learning = "learned before";
  if (has(flag_learned))
    learning = "learning";
  else if (has(flag_frozen))
    learning = "paused: learning or near-clear is off";
  else if (has(flag_starved))
    learning = "waiting: the training window shows no usable ground";
  status.message = has(flag_unknown)        ? "nothing is learned yet"
                   : has(flag_window_still) ? "the training window shows the vehicle or a still picture"
                                            : "terrain is known";
  status.values = {{"learning", learning},
                   {"confidence", std::to_string(e.confidence)},
                   {"traversable_permille", std::to_string(e.traversable_permille)},
                   {"blocked", text_of(has(flag_blocked))},
                   {"metres", text_of(has_metres)}};
  if (near_clear)
    status.values.emplace_back("near_clear", text_of(*near_clear));
  return status;
}

/// Whether a status has news that is sent before the second is over. Confidence does not count: it changes
/// with every frame.
bool is_new(const DiagnosticStatus& a, const DiagnosticStatus& b) {
  const auto words = [](const DiagnosticStatus& status) {
    std::string text = status.message;
    for (const auto& [key, value] : status.values)
      if (key != "confidence" && key != "traversable_permille")
        text += value + '\n';
    return text;
  };
  return words(a) != words(b);
}

} // namespace

MessageType type_of(Topic topic) {
  switch (topic) {
  case Topic::scan:
    return laser_scan_type();
  case Topic::points:
    return point_cloud_type();
  case Topic::grid:
    return occupancy_grid_type();
  case Topic::mask:
    return image_type();
  case Topic::camera_info:
    return camera_info_type();
  case Topic::video:
    return compressed_video_type();
  case Topic::picture:
    return compressed_image_type();
  case Topic::tf:
  case Topic::tf_static:
    return tf_message_type();
  case Topic::diagnostics:
    break;
  }
  return diagnostic_array_type();
}

bool TerrainMessages::add_metric(MessageOutlet& out, const Header& body, const MetricEstimate& m) {
  beams_.take(m);
  const double since =
      last_scan_ && body.time > *last_scan_ ? static_cast<double>(body.time - *last_scan_) / 1e9 : 0;
  last_scan_ = body.time;
  if (out.wants(Topic::scan)) {
    encode(message_, body,
           LaserScan{beams_.fan().angle_min, beams_.fan().increment, since, beams_.fan().range_min,
                     m.range_max, beams_.ranges()});
    if (!out.put(Topic::scan, body.time, message_))
      return false;
  }
  if (out.wants(Topic::points)) {
    boundary_points(points_, m);
    encode(message_, body, points_);
    if (!out.put(Topic::points, body.time, message_))
      return false;
  }
  if (!out.wants(Topic::grid))
    return true;
  grid_.draw(m, beams_, options_.grid_resolution);
  encode(message_, body, grid_.grid());
  return out.put(Topic::grid, body.time, message_);
}

bool TerrainMessages::add_camera(MessageOutlet& out, const Header& camera, int width, int height) {
  if (!options_.camera || !out.wants(Topic::camera_info))
    return true;
  encode(message_, camera, metric::scaled(*options_.camera, width, height));
  return out.put(Topic::camera_info, camera.time, message_);
}

/// The attitude of the frame if it has metres, otherwise the mount's.
bool TerrainMessages::add_transform(MessageOutlet& out, const Header& body, const MetricEstimate* m) {
  const Topic topic = m && (m->flags & metric_flag_pose) != 0 ? Topic::tf : Topic::tf_static;
  if (!options_.mount || !out.wants(topic))
    return true;
  const metric::Mount& mount = *options_.mount;
  Transform transform;
  transform.child = options_.camera_frame;
  transform.translation = {mount.x, mount.y, m ? m->height : mount.height};
  transform.rotation =
      m ? camera_rotation(m->yaw, m->pitch, m->roll) : camera_rotation(mount.yaw, mount.pitch, mount.roll);
  encode(message_, body, transform);
  return out.put(topic, body.time, message_);
}

bool TerrainMessages::add_pictures(MessageOutlet& out, const Header& camera, const MessageFrame& frame) {
  if (!frame.picture.empty() && out.wants(Topic::picture)) {
    encode_picture(message_, camera, frame.picture);
    if (!out.put(Topic::picture, camera.time, message_))
      return false;
  }
  // The parameter sets are also stored while the video topic has no reader.
  const ByteView whole =
      frame.video.empty() ? frame.video : parameter_sets_.complete(frame.video, inspect_h264(frame.video));
  if (whole.empty() || !out.wants(Topic::video))
    return true;
  encode_video(message_, camera, whole);
  return out.put(Topic::video, camera.time, message_);
}

/// After each change of the status that is_new() reports, and once a second.
bool TerrainMessages::add_diagnostics(MessageOutlet& out, const Header& header, const MessageFrame& frame) {
  DiagnosticStatus status = status_of(*frame.estimate, frame.metric != nullptr, frame.near_clear);
  if (last_status_ && !is_new(status, status_) && header.time >= *last_status_ &&
      header.time - *last_status_ < second)
    return true;
  status_ = std::move(status);
  last_status_ = header.time;
  if (!out.wants(Topic::diagnostics))
    return true;
  encode(message_, header, status_);
  return out.put(Topic::diagnostics, header.time, message_);
}

bool TerrainMessages::add(const MessageFrame& frame, MessageOutlet& out) {
  const Header body{frame.time, options_.body_frame}, camera{frame.time, options_.camera_frame};
  if (!add_pictures(out, camera, frame) || !add_transform(out, body, frame.metric))
    return false;
  if (frame.metric && !add_metric(out, body, *frame.metric))
    return false;
  if (!frame.estimate)
    return true;
  const Estimate& e = *frame.estimate;
  if (!add_camera(out, camera, e.frame_width, e.frame_height) || !add_diagnostics(out, body, frame))
    return false;
  if (e.mask.empty() || !out.wants(Topic::mask))
    return true;
  encode(message_, camera, e.mask);
  return out.put(Topic::mask, camera.time, message_);
}

} // namespace terrainseg::recording
