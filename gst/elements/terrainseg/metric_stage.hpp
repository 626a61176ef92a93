// SPDX-License-Identifier: LGPL-2.1-or-later
// Ranges in metres for terrainseg: reads the calibration and the mount, keeps the attitude of the moment, and
// makes the warnings about them.
#pragma once

#include <gst/gst.h>

#include <array>
#include <optional>
#include <string>
#include <utility>

#include "exchange/metric_estimate.hpp"
#include "metric/free_space_ranges.hpp"
#include "metric/horizon_monitor.hpp"
#include "metric/pose.hpp"
#include "support/calibration_files.hpp"
#include "support/mutex.hpp"
#include "terrainseg/estimate.hpp"

namespace terrainseg {

class MetricStage {
 public:
  /// Resets the stage and reads the files of camera-info and mount (or a mount such as `height=..,pitch=..`);
  /// empty = none.
  std::optional<SettingsError> start(const std::string& camera_info, const std::string& mount);
  /// Sets the size of the frames. When the calibration does not fit them there are no ranges, and the result
  /// is the reason as the rest of a sentence; otherwise it is empty.
  std::string fit(int width, int height);

  /// Stores the pose of a terrainseg-pose event, from any thread. Returns nullptr, or why it was ignored.
  const char* take_pose(const GstStructure* fields);
  /// After a flush: drops all poses, because running times restart. There are no metres until the next pose.
  void flush();

  /// The vanishing line of level ground according to the pose, otherwise the mount, in Q8 rows of frames of
  /// the size of fit(); nothing when unknown.
  std::optional<std::int32_t> vanishing_row(GstClockTime running_time);
  /// Ranges of a frame's boundary, valid until the next call; nullptr when there are none. `running_time` may
  /// be NONE. `range_max` is in metres, 0 = where the expected error reaches 20 %.
  const MetricEstimate* measure(const Estimate& estimate, GstClockTime running_time, double range_max);
  /// A warning after measure(), if any; each at most once until the next start.
  std::optional<std::string> take_notice() { return std::exchange(notice_, std::nullopt); }

 private:
  enum Notice : std::uint8_t { no_time, stale, short_range, horizon, notices };
  const MetricEstimate* refuse(Notice why, const char* text);
  std::optional<metric::Mount> attitude(GstClockTime running_time, bool& posed);
  void choose_fan(const metric::Mount& mount, bool posed, double nearest);
  void find_ticks(const metric::Mount& mount, double range_max);
  void watch_horizon(const Estimate& estimate, const metric::Mount& mount, GstClockTime running_time);

  std::optional<metric::Camera> camera_;
  std::optional<metric::Mount> mount_;
  std::optional<metric::Camera> frame_camera_; ///< for frames that both are there for, and that fit
  metric::FreeSpaceRanges ranges_;
  metric::HorizonMonitor monitor_;
  MetricEstimate result_;
  std::array<RangeTick, most_ticks> ticks_{};
  bool told_[notices] = {};
  std::optional<std::string> notice_; ///< not taken yet

  Mutex mutex_; ///< pose events come on other threads
  metric::PoseTrack poses_ TERRAINSEG_GUARDED_BY(mutex_);
  bool posed_ TERRAINSEG_GUARDED_BY(mutex_) =
      false; ///< whether there was ever a pose: then the mount's attitude is that of no moment
};

} // namespace terrainseg
