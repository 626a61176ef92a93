// SPDX-License-Identifier: LGPL-2.1-or-later
// What the in-place filters do alike with times, flags and events.
#pragma once

#include <gst/base/gstbasetransform.h>

#include "support/segment_time.hpp"

namespace terrainseg {

/// Whether an event from downstream ends here: a decoder that receives it drops late frames, and they
/// would not be learned. The base class's property `qos` decides; it obeys it for its own frames only and
/// sends the event on in any case.
inline bool stops_qos(GstBaseTransform* transform, const GstEvent* event) {
  return GST_EVENT_TYPE(event) == GST_EVENT_QOS && !gst_base_transform_is_qos_enabled(transform);
}

/// Gives properties that a GstController binds their values at the time of `buffer`.
inline void sync_controlled(GstBaseTransform* transform, const GstBuffer* buffer) {
  const GstClockTime time = stream_time_of(transform->segment, GST_BUFFER_PTS(buffer));
  if (GST_CLOCK_TIME_IS_VALID(time))
    gst_object_sync_values(GST_OBJECT(transform), time);
}

/// Whether a frame shows something new of the world in the order of its time: not a repeated frame (GAP), not
/// one that the decoder knows to be damaged (CORRUPTED), and not backwards, played so or recorded so.
inline bool is_learnable(const GstSegment& segment, const GstBuffer* buffer) {
  return !GST_BUFFER_FLAG_IS_SET(buffer, GST_BUFFER_FLAG_GAP | GST_BUFFER_FLAG_CORRUPTED) &&
         segment.rate > 0 && segment.applied_rate > 0;
}

} // namespace terrainseg
