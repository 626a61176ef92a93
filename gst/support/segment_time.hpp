// SPDX-License-Identifier: LGPL-2.1-or-later
// Times of a segment, which may be any that a peer sends.
#pragma once

#include <gst/gst.h>

namespace terrainseg {

/// NONE where the segment counts bytes or frames, which have no stream time.
inline GstClockTime stream_time_of(const GstSegment& segment, GstClockTime timestamp) {
  return segment.format == GST_FORMAT_TIME ? gst_segment_to_stream_time(&segment, GST_FORMAT_TIME, timestamp)
                                           : GST_CLOCK_TIME_NONE;
}

/// Whether positions have a running time. Backwards from no stop they have none, and GStreamer calls the
/// question a programming error.
inline bool has_running_time(const GstSegment& segment) {
  return segment.format == GST_FORMAT_TIME && (segment.rate > 0 || GST_CLOCK_TIME_IS_VALID(segment.stop));
}

/// NONE where there is none.
inline GstClockTime running_time_of(const GstSegment& segment, GstClockTime timestamp) {
  return has_running_time(segment) ? gst_segment_to_running_time(&segment, GST_FORMAT_TIME, timestamp)
                                   : GST_CLOCK_TIME_NONE;
}

} // namespace terrainseg
