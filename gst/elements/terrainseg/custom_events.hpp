// SPDX-License-Identifier: LGPL-2.1-or-later
// The events terrainseg-near and terrainseg-pose, which come from either side and on any thread.
#pragma once

#include <gst/gst.h>

namespace terrainseg {

class MetricStage;
struct Shared;

/// True when the event was one of them and was understood. The caller forwards it all the same.
bool take_custom_event(GstElement* element, Shared& shared, MetricStage& metres, GstEvent* event);

} // namespace terrainseg
