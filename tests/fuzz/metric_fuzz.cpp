// SPDX-License-Identifier: LGPL-2.1-or-later
// Calibration and mount files of any bytes, and poses of any numbers: an error or sound values, never a range
// that is none.
#include <bit>
#include <cmath>
#include <string>
#include <vector>

#include "input.hpp"
#include "metric/camera_info.hpp"
#include "metric/free_space_ranges.hpp"
#include "metric/pose.hpp"

namespace {

using namespace terrainseg;
using namespace terrainseg::metric;
using fuzz::require;

/// Every column of a boundary is a distance, free or unknown.
void check_ranges(const Camera& camera, const Mount& mount) {
  constexpr int width = 64, height = 48;
  FreeSpaceRanges ranges;
  ranges.adapt(camera, width, height, {0, 0, width, height}, width);
  std::vector<std::uint16_t> boundary(width);
  for (int i = 0; i < width; ++i)
    boundary[static_cast<std::size_t>(i)] = static_cast<std::uint16_t>(i % (height + 1));
  const RangeColumns& columns = ranges.measure(boundary, false, mount, 10);
  for (const auto* values : {&columns.ranges, &columns.low, &columns.high})
    for (const float value : *values)
      require(std::isnan(value) || (value >= 0 && (std::isinf(value) || value <= 10.001F)));
  for (const float bearing : columns.bearings)
    require(std::isnan(bearing) || std::abs(bearing) < 3.15F);
}

void check_files(const std::string& text) {
  std::string error;
  const auto camera = read_camera_info(text, error);
  require(camera.has_value() == error.empty());
  error.clear();
  const auto mount = read_mount(text, error);
  require(mount.has_value() == error.empty());
  error.clear();
  const auto line = parse_mount(text, error);
  require(line.has_value() == error.empty());
  Mount low;
  low.height = 0.5;
  low.pitch = 0.2;
  if (camera) {
    require(flaw_of(*camera).empty());
    check_ranges(*camera, mount.value_or(low));
  }
  for (const auto& found : {mount, line})
    if (found)
      require(flaw_of(*found).empty());
}

void check_poses(fuzz::Input input) {
  const Camera camera{64, 48, 55, 55, 31.5, 23.5, Distortion::brown_conrady, {}};
  Mount mount;
  mount.height = 0.5;
  PoseTrack track;
  while (!input.done()) {
    const auto real = [&] { return std::bit_cast<double>(input.number(8)); };
    Pose pose;
    pose.time = static_cast<std::int64_t>(input.number(8));
    pose.roll = real();
    pose.pitch = real();
    if (input.chance(3))
      pose.yaw = real();
    if (input.chance(3))
      pose.height = real();
    if (!flaw_of(pose))
      track.add(pose);
    const auto time = static_cast<std::int64_t>(input.number(8) >> 1);
    track.forget_future(time);
    for (const std::int64_t at : {time, pose.time})
      if (const auto found = at >= 0 ? track.at(at) : std::nullopt) {
        require(flaw_of(*found) == nullptr);
        check_ranges(camera, with_pose(mount, *found));
      }
  }
}

} // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size > 0 && data[0] == 1)
    check_poses({data + 1, size - 1});
  else
    check_files(std::string(reinterpret_cast<const char*>(data), size));
  return 0;
}
