// SPDX-License-Identifier: LGPL-2.1-or-later
#include "elements/terrainseg/metric_stage.hpp"

#include <gst/terrainseg/terrainsegmeta.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <numbers>

namespace terrainseg {
namespace {

/// To a thousandth of a unit of `unit`: metadata and text hold no more.
double rounded(double value, double unit) {
  return std::round(value / unit * 1000) * unit / 1000;
}
double rounded_angle(double value) {
  return rounded(value, std::numbers::pi / 180);
}

} // namespace

std::optional<SettingsError> MetricStage::start(const std::string& camera_info, const std::string& mount) {
  camera_.reset();
  mount_.reset();
  frame_camera_.reset();
  result_.fan = {};
  monitor_.clear();
  std::fill(std::begin(told_), std::end(told_), false);
  notice_.reset();
  {
    const Lock lock(mutex_);
    poses_.clear();
    posed_ = false;
  }
  return read_calibration(camera_info, mount, camera_, mount_);
}

std::string MetricStage::fit(int width, int height) {
  frame_camera_.reset();
  if (!camera_ || !mount_)
    return {};
  if (camera_->whole_width > 0 && width == camera_->whole_width && height == camera_->whole_height)
    return "the calibration's roi is a part of the picture and these frames have the size of the whole: "
           "remove roi from the calibration";
  // A picture that was scaled as a whole, its sides rounded to pixels.
  const std::int64_t a = std::int64_t{width} * camera_->height, b = std::int64_t{height} * camera_->width;
  if (std::abs(a - b) <= std::max(camera_->width, camera_->height)) {
    frame_camera_ = metric::scaled(*camera_, width, height);
    return {};
  }
  return "the camera was calibrated with pictures of " + std::to_string(camera_->width) + " x " +
         std::to_string(camera_->height) + " but the frames are " + std::to_string(width) + " x " +
         std::to_string(height) +
         ", another aspect ratio: calibrate with pictures of this aspect ratio (a cropped picture is not a "
         "scaled one)";
}

const char* MetricStage::take_pose(const GstStructure* fields) {
  metric::Pose pose;
  guint64 time = 0;
  if (!gst_structure_get_double(fields, "roll", &pose.roll) ||
      !gst_structure_get_double(fields, "pitch", &pose.pitch) ||
      !gst_structure_get_uint64(fields, "running-time", &time))
    return "it needs the doubles roll and pitch in radians and the uint64 running-time in nanoseconds";
  if (time > static_cast<guint64>(G_MAXINT64))
    return "the running time is missing";
  pose.time = static_cast<std::int64_t>(time);
  double number = 0;
  if (gst_structure_get_double(fields, "yaw", &number))
    pose.yaw = number;
  if (gst_structure_get_double(fields, "height", &number))
    pose.height = number;
  if (const char* flaw = metric::flaw_of(pose))
    return flaw;
  const Lock lock(mutex_);
  posed_ = true;
  poses_.add(pose);
  return nullptr;
}

void MetricStage::flush() {
  monitor_.clear();
  const Lock lock(mutex_);
  poses_.clear();
}

std::optional<std::int32_t> MetricStage::vanishing_row(GstClockTime running_time) {
  if (!frame_camera_)
    return std::nullopt;
  bool posed = false;
  const auto mount = attitude(running_time, posed);
  return mount ? metric::vanishing_row_q8(*mount, *frame_camera_) : std::nullopt;
}

const MetricEstimate* MetricStage::refuse(Notice why, const char* text) {
  if (!std::exchange(told_[why], true))
    notice_ = text;
  return nullptr;
}

/// The mount at this moment; nothing, and posed, when poses come and none of this moment is there.
std::optional<metric::Mount> MetricStage::attitude(GstClockTime running_time, bool& posed) {
  const Lock lock(mutex_);
  posed = posed_;
  if (!posed_)
    return mount_;
  if (!GST_CLOCK_TIME_IS_VALID(running_time))
    return std::nullopt;
  const auto time = static_cast<std::int64_t>(running_time);
  poses_.forget_future(time);
  const auto pose = poses_.at(time);
  return pose ? std::optional(metric::with_pose(*mount_, *pose)) : std::nullopt;
}

const MetricEstimate* MetricStage::measure(const Estimate& e, GstClockTime running_time, double range_max) {
  if (!frame_camera_ || e.boundary.empty())
    return nullptr;
  bool posed = false;
  const auto mount = attitude(running_time, posed);
  if (!mount && !GST_CLOCK_TIME_IS_VALID(running_time))
    return refuse(no_time,
                  "Ranges are disabled: frames have no time stamps, which are needed to find the pose. Set "
                  "do-timestamp=true on the source.");
  if (!mount)
    return refuse(
        stale,
        "Ranges are disabled: the last " GST_TERRAIN_SEG_POSE_EVENT
        " event is more than 100 ms away from the frame. They resume with the next pose; check that its "
        "running-time uses the pipeline's clock.");
  ranges_.adapt(*camera_, e.frame_width, e.frame_height, e.mask_region, static_cast<int>(e.boundary.size()));
  const double limit =
      range_max > 0 ? range_max : metric::expected_range_limit(*mount_, *camera_, e.frame_height);
  const double nearest = ranges_.nearest(*mount);
  if (!(nearest < limit))
    return refuse(
        short_range,
        "Ranges are disabled: the nearest ground in the frame is beyond range-max. Tilt the camera down, "
        "increase range-max, or check height and pitch of the mount.");
  const metric::RangeColumns& columns =
      ranges_.measure(e.boundary, (e.flags & flag_unknown) != 0, *mount, limit);
  watch_horizon(e, *mount, running_time);
  result_.ranges = columns.ranges;
  result_.bearings = columns.bearings;
  result_.low = columns.low;
  result_.high = columns.high;
  if (result_.fan.beams == 0)
    choose_fan(*mount, posed, nearest);
  find_ticks(*mount, limit);
  result_.height = rounded(mount->height, 1);
  result_.pitch = rounded_angle(mount->pitch);
  result_.roll = rounded_angle(mount->roll);
  result_.yaw = rounded_angle(mount->yaw);
  result_.range_min = rounded(nearest, 1);
  result_.range_max = rounded(limit, 1);
  result_.flags = (posed ? metric_flag_pose : 0U) | (monitor_.disagrees() ? metric_flag_horizon : 0U);
  return &result_;
}

/// Once, at the first frame with metres: readers of scans do not take a geometry that changes.
void MetricStage::choose_fan(const metric::Mount& mount, bool posed, double nearest) {
  constexpr double sway = 10 * std::numbers::pi / 180; // what rough ground does to an attitude
  constexpr double slack = 1.25; // a boundary that is no row has columns that are farther apart
  const auto view = ranges_.view(mount, sway);
  if (!view)
    return;
  if (posed) {
    metric::Mount lowest = mount;
    lowest.pitch += sway;
    nearest = std::min(nearest, ranges_.nearest(lowest));
  }
  const double span = view->left - view->right, turn = 2 * std::numbers::pi;
  const double columns = static_cast<double>(result_.bearings.size());
  // Under the camera directions have no limit to their distance.
  const double increment =
      std::clamp(slack * view->widest_step, turn / most_beams, 4 * std::max(span, 0.01) / columns);
  if (span > turn - 2 * increment)
    result_.fan = whole_circle(static_cast<std::uint32_t>(turn / increment), rounded(nearest, 1));
  else
    result_.fan = {view->right, increment, static_cast<std::uint32_t>(std::ceil(span / increment)) + 1,
                   rounded(nearest, 1)};
}

/// Whole metres straight ahead that the picture shows.
void MetricStage::find_ticks(const metric::Mount& mount, double range_max) {
  constexpr double marked[] = {1, 2, 3, 4, 5, 7, 10, 15, 20, 30, 50, 70, 100, 200, 500};
  static_assert(std::size(marked) <= most_ticks);
  const metric::Camera& camera = ranges_.camera();
  const metric::GroundProjection ground(mount);
  std::size_t count = 0;
  for (const double range : marked) {
    const auto ray = range <= range_max ? ground.ray_to({range, 0}) : std::nullopt;
    if (!ray)
      continue;
    const metric::ImagePoint pixel = metric::distort(camera, *ray);
    const double column = (pixel.x + 0.5) / camera.width, row = (pixel.y + 0.5) / camera.height;
    if (column >= 0 && column <= 1 && row >= 0 && row <= 1)
      ticks_[count++] = {static_cast<float>(range), static_cast<float>(column), static_cast<float>(row)};
  }
  result_.ticks = {ticks_.data(), count};
}

void MetricStage::watch_horizon(const Estimate& e, const metric::Mount& mount, GstClockTime running_time) {
  constexpr int sure = 80;
  if (e.horizon_row < 0 || e.horizon_confidence < sure || (e.flags & flag_horizon_held) ||
      !GST_CLOCK_TIME_IS_VALID(running_time))
    return;
  const metric::Camera& camera = ranges_.camera();
  if (const auto ray = metric::undistort(camera, camera.cx, e.horizon_row))
    monitor_.add(static_cast<std::int64_t>(running_time), metric::horizon_offset(mount, *ray));
  if (!monitor_.disagrees() || told_[horizon])
    return;
  const double degrees = monitor_.median().value_or(0) * 180 / std::numbers::pi;
  char text[200];
  g_snprintf(text, sizeof text,
             "For ten seconds the horizon in the frame has been %.1f degrees %s than the mount predicts. "
             "Check the pitch of the mount: ranges may be wrong.",
             std::abs(degrees), degrees > 0 ? "higher" : "lower");
  refuse(horizon, text);
}

} // namespace terrainseg
