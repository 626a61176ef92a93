// SPDX-License-Identifier: LGPL-2.1-or-later
#include "metric/pose.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace terrainseg::metric {
namespace {

constexpr double pi = std::numbers::pi;

/// Angles the short way round.
double angle_between(double a, double b, double part) {
  return std::remainder(a + std::remainder(b - a, 2 * pi) * part, 2 * pi);
}
/// Of any two times: a frame's may be what no clock shows.
std::uint64_t distance(std::int64_t a, std::int64_t b) {
  const auto difference = static_cast<std::uint64_t>(a) - static_cast<std::uint64_t>(b);
  return a > b ? difference : -difference;
}

} // namespace

const char* flaw_of(const Pose& pose) {
  for (double number : {pose.roll, pose.pitch, pose.yaw.value_or(0), pose.height.value_or(1)})
    if (!std::isfinite(number))
      return "a number is not finite";
  if (pose.time < 0)
    return "the running time is missing";
  if (std::abs(pose.pitch) > 80 * pi / 180)
    return "the pitch is steeper than 80 degrees (radians are expected, positive = the camera looks down)";
  if (std::abs(pose.roll) > pi || std::abs(pose.yaw.value_or(0)) > 2 * pi)
    return "roll or yaw is more than a turn (radians are expected)";
  if (pose.height && (*pose.height <= 0 || *pose.height > 1000))
    return "the height is not above 0 and at most 1000 m";
  return nullptr;
}

void PoseTrack::add(const Pose& pose) {
  const auto place = std::ranges::lower_bound(poses_, pose.time, {}, &Pose::time);
  if (place != poses_.end() && place->time == pose.time) {
    *place = pose;
    return;
  }
  poses_.insert(place, pose);
  if (poses_.size() > capacity)
    poses_.erase(poses_.begin());
}

void PoseTrack::forget_future(std::int64_t time) {
  if (poses_.size() == capacity && poses_.front().time - longest_gap > time)
    poses_.clear();
}

std::optional<Pose> PoseTrack::at(std::int64_t time) const {
  const auto after = std::ranges::lower_bound(poses_, time, {}, &Pose::time);
  const Pose* const next = after == poses_.end() ? nullptr : &*after;
  const Pose* const last = after == poses_.begin() ? nullptr : &*(after - 1);
  const auto near = [time](const Pose* pose) {
    return pose && distance(pose->time, time) <= std::uint64_t{longest_gap};
  };
  if (near(last) && near(next)) {
    const double part = static_cast<double>(time - last->time) / static_cast<double>(next->time - last->time);
    Pose pose = *next;
    pose.time = time;
    pose.roll = angle_between(last->roll, next->roll, part);
    // Never beyond either: a + (b - a) * 1 need not be b, and a height would become 0.
    pose.pitch = std::lerp(last->pitch, next->pitch, part);
    if (last->yaw && next->yaw)
      pose.yaw = angle_between(*last->yaw, *next->yaw, part);
    if (last->height && next->height)
      pose.height = std::lerp(*last->height, *next->height, part);
    return pose;
  }
  if (near(last))
    return *last;
  if (near(next))
    return *next;
  return std::nullopt;
}

Mount with_pose(Mount mount, const Pose& pose) {
  mount.roll = pose.roll;
  mount.pitch = pose.pitch;
  mount.yaw = pose.yaw.value_or(mount.yaw);
  mount.height = pose.height.value_or(mount.height);
  return mount;
}

} // namespace terrainseg::metric
