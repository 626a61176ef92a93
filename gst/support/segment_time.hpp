// SPDX-License-Identifier: LGPL-2.1-or-later
// Times of a segment that a peer sends and that may have any values.
#pragma once

#include <gst/gst.h>

namespace terrainseg {

/// GST_CLOCK_TIME_NONE if the segment is in bytes or frames, which have no stream time.
inline GstClockTime stream_time_of(const GstSegment& segment, GstClockTime timestamp) {
  return segment.format == GST_FORMAT_TIME ? gst_segment_to_stream_time(&segment, GST_FORMAT_TIME, timestamp)
                                           : GST_CLOCK_TIME_NONE;
}

/// Whether positions have a running time. They have none with a negative rate and no stop; GStreamer logs a
/// critical in that case.
inline bool has_running_time(const GstSegment& segment) {
  return segment.format == GST_FORMAT_TIME && (segment.rate > 0 || GST_CLOCK_TIME_IS_VALID(segment.stop));
}

/// GST_CLOCK_TIME_NONE if there is none, or if it does not fit into a signed number.
inline GstClockTime running_time_of(const GstSegment& segment, GstClockTime timestamp) {
  const GstClockTime time = has_running_time(segment)
                                ? gst_segment_to_running_time(&segment, GST_FORMAT_TIME, timestamp)
                                : GST_CLOCK_TIME_NONE;
  return time <= static_cast<GstClockTime>(G_MAXINT64) ? time : GST_CLOCK_TIME_NONE;
}

} // namespace terrainseg
