// SPDX-License-Identifier: LGPL-2.1-or-later
#include "recording/terrain_messages.hpp"

#include <utility>

namespace terrainseg::recording {
namespace {

const char* text_of(bool value) {
  return value ? "true" : "false";
}

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

/// Sends what `content` returns, if the topic is needed.
template <class Content>
void TerrainMessages::send(MessageOutlet& out, Topic topic, const Header& header, Content content) {
  if (!out.wants(topic))
    return;
  encode(message_, header, content());
  out.put(topic, header.time, message_);
}

void TerrainMessages::add_metric(MessageOutlet& out, const Header& body, const MetricEstimate& m) {
  beams_.take(m);
  const double since =
      last_scan_ && body.time > *last_scan_ ? static_cast<double>(body.time - *last_scan_) / 1e9 : 0;
  last_scan_ = body.time;
  send(out, Topic::scan, body, [&] { return LaserScan{beams_.fan(), since, m.range_max, beams_.ranges()}; });
  send(out, Topic::points, body, [&] {
    boundary_points(points_, m);
    return std::span<const BoundaryPoint>(points_);
  });
  send(out, Topic::grid, body, [&] {
    grid_.draw(m, beams_, options_.grid_resolution);
    return grid_.grid();
  });
}

/// The attitude of the frame if it has metres, otherwise the mount's.
void TerrainMessages::add_transform(MessageOutlet& out, const Header& body, const MetricEstimate* m) {
  if (!options_.mount)
    return;
  const Topic topic = m && (m->flags & metric_flag_pose) != 0 ? Topic::tf : Topic::tf_static;
  const metric::Mount& mount = *options_.mount;
  // From the camera's optical frame (x right, y down, z forward) to one with x forward and z up.
  constexpr Quaternion optical = {-0.5, 0.5, -0.5, 0.5};
  send(out, topic, body, [&] {
    const Quaternion rotation =
        m ? rotation_of(m->yaw, m->pitch, m->roll) : rotation_of(mount.yaw, mount.pitch, mount.roll);
    return Transform{
        options_.camera_frame, {mount.x, mount.y, m ? m->height : mount.height}, product(rotation, optical)};
  });
}

/// After each change of the status that is_new() reports, and once a second.
void TerrainMessages::add_diagnostics(MessageOutlet& out, const Header& header, const MessageFrame& frame) {
  DiagnosticStatus status = status_of(*frame.estimate, frame.metric != nullptr, frame.near_clear);
  if (last_status_ && !is_new(status, status_) && header.time >= *last_status_ &&
      header.time - *last_status_ < second)
    return;
  status_ = std::move(status);
  last_status_ = header.time;
  send(out, Topic::diagnostics, header, [&] { return status_; });
}

void TerrainMessages::add(const MessageFrame& frame, MessageOutlet& out) {
  const Header body{frame.time, options_.body_frame}, camera{frame.time, options_.camera_frame};
  if (!frame.picture.empty())
    send(out, Topic::picture, camera, [&] { return JpegFile{frame.picture}; });
  // The parameter sets are also stored while the video topic has no reader.
  if (const ByteView whole = parameter_sets_.complete(frame.video); !whole.empty())
    send(out, Topic::video, camera, [&] { return H264Picture{whole}; });
  add_transform(out, body, frame.metric);
  if (frame.metric)
    add_metric(out, body, *frame.metric);
  if (!frame.estimate)
    return;
  const Estimate& e = *frame.estimate;
  if (options_.camera)
    send(out, Topic::camera_info, camera,
         [&] { return metric::scaled(*options_.camera, e.frame_width, e.frame_height); });
  add_diagnostics(out, body, frame);
  if (!e.mask.empty())
    send(out, Topic::mask, camera, [&] { return e.mask; });
}

} // namespace terrainseg::recording
