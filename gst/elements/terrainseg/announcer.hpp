// SPDX-License-Identifier: LGPL-2.1-or-later
// Which results are worth a message on the bus.
#pragma once

#include <gst/gst.h>
#include <gst/terrainseg/terrainsegmeta.h>

#include <algorithm>
#include <cstdlib>
#include <optional>

#include "support/times.hpp"
#include "terrainseg/estimate.hpp"

namespace terrainseg {

/// What post-messages tells.
struct News {
  int traversable_permille = 0;
  int horizon_row = -1; ///< -1 = none
  bool blocked = false;
};

/// The element message, for the frame that `buffer` holds.
inline GstStructure* structure_of(const News& news, const GstSegment& segment, const GstBuffer* buffer) {
  const GstClockTime timestamp = GST_BUFFER_PTS(buffer);
  return gst_structure_new(
      GST_TERRAIN_SEG_MESSAGE, "timestamp", G_TYPE_UINT64, timestamp, "stream-time", G_TYPE_UINT64,
      stream_time_of(segment, timestamp), "running-time", G_TYPE_UINT64, running_time_of(segment, timestamp),
      "duration", G_TYPE_UINT64, GST_BUFFER_DURATION(buffer), "traversable-permille", G_TYPE_UINT,
      static_cast<guint>(news.traversable_permille), "horizon-row", G_TYPE_INT, news.horizon_row, "blocked",
      G_TYPE_BOOLEAN, static_cast<gboolean>(news.blocked), nullptr);
}

/// Reports a change once, and noise not at all: values are compared with the last report and not with the
/// previous frame. A blocked way is reported at once, a free one when it has been free for some frames. There
/// is a report each second in any case: silence means that no frames arrive.
class Announcer {
 public:
  static constexpr int permille_step = 25;  ///< smallest change of the traversable share that is reported
  static constexpr int rows_per_frame = 40; ///< the horizon's least change: this fraction of the frame height
  static constexpr int settled_after =
      5; ///< frames that the way has to stay free, or a horizon there or away

  static constexpr GstClockTime longest_silence = GST_SECOND; ///< between the time stamps of two messages

  /// What to tell after the frame of this time stamp (or NONE); nothing when it is no news.
  std::optional<News> consider(const Estimate& estimate, GstClockTime timestamp) {
    const News now{estimate.traversable_permille, estimate.horizon_row, (estimate.flags & flag_blocked) != 0};
    if (!told_)
      return tell(now, timestamp);
    free_for_ = told_->blocked && !now.blocked ? free_for_ + 1 : 0;
    const bool has_horizon = now.horizon_row >= 0, had_horizon = told_->horizon_row >= 0;
    changed_for_ = has_horizon != had_horizon ? changed_for_ + 1 : 0;
    News next = now;
    next.blocked = now.blocked || (told_->blocked && free_for_ < settled_after);
    if (has_horizon != had_horizon && changed_for_ < settled_after)
      next.horizon_row = told_->horizon_row;
    const int row_step = std::max(2, estimate.frame_height / rows_per_frame);
    if (!is_silent_for_long(timestamp) && next.blocked == told_->blocked &&
        (next.horizon_row < 0) == !had_horizon &&
        std::abs(next.horizon_row - told_->horizon_row) < row_step &&
        std::abs(next.traversable_permille - told_->traversable_permille) < permille_step)
      return std::nullopt;
    return tell(next, timestamp);
  }

 private:
  std::optional<News> tell(const News& news, GstClockTime timestamp) {
    told_at_ = timestamp;
    return told_ = news;
  }
  /// Also after a jump backwards.
  bool is_silent_for_long(GstClockTime timestamp) const {
    return GST_CLOCK_TIME_IS_VALID(timestamp) && GST_CLOCK_TIME_IS_VALID(told_at_) &&
           (timestamp < told_at_ || timestamp - told_at_ >= longest_silence);
  }

  std::optional<News> told_;
  GstClockTime told_at_ = GST_CLOCK_TIME_NONE;
  int free_for_ = 0, changed_for_ = 0; ///< frames that differ from the last report
};

} // namespace terrainseg
