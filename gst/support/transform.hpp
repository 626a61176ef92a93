// SPDX-License-Identifier: LGPL-2.1-or-later
// Common handling of times, flags and events in the in-place filters.
#pragma once

#include <gst/base/gstbasetransform.h>

#include "support/times.hpp"

namespace terrainseg {

/// Whether to drop an event from downstream: a QoS event makes decoders drop late frames, which then would
/// not be learned. The property `qos` of the base class decides; the base class itself would always forward
/// the event.
inline bool stops_qos(GstBaseTransform* transform, const GstEvent* event) {
  return GST_EVENT_TYPE(event) == GST_EVENT_QOS && !gst_base_transform_is_qos_enabled(transform);
}

/// GstBaseTransform::before_transform: sets the controlled properties to their values at the time of
/// `buffer`.
inline void sync_controlled(GstBaseTransform* transform, GstBuffer* buffer) {
  const GstClockTime time = stream_time_of(transform->segment, GST_BUFFER_PTS(buffer));
  if (GST_CLOCK_TIME_IS_VALID(time))
    gst_object_sync_values(GST_OBJECT(transform), time);
}

/// Whether a frame has new content in temporal order: not a repeated frame (GAP), not damaged (CORRUPTED),
/// and not played or recorded backwards.
inline bool is_learnable(const GstSegment& segment, const GstBuffer* buffer) {
  return !GST_BUFFER_FLAG_IS_SET(buffer, GST_BUFFER_FLAG_GAP | GST_BUFFER_FLAG_CORRUPTED) &&
         segment.rate > 0 && segment.applied_rate > 0;
}

} // namespace terrainseg
