// SPDX-License-Identifier: LGPL-2.1-or-later
#include "elements/terrainseg/custom_events.hpp"

#include <gst/terrainseg/terrainsegmeta.h>

#include "elements/terrainseg/debug.hpp"
#include "elements/terrainseg/metric_stage.hpp"
#include "elements/terrainseg/shared.hpp"
#include "support/element.hpp"

namespace terrainseg {
namespace {

/// True when the event was one for this element. It travels on all the same.
bool take_near_event(GstElement* element, Shared& shared, GstEvent* event) {
  const GstStructure* fields = gst_event_get_structure(event);
  if (!fields || !gst_structure_has_name(fields, GST_TERRAIN_SEG_NEAR_EVENT))
    return false;
  gboolean clear = FALSE;
  if (!gst_structure_get_boolean(fields, "clear", &clear)) {
    GST_ELEMENT_WARNING(
        element, STREAM, FAILED,
        ("Invalid event %s, ignored: it lacks the boolean field \"clear\".", GST_TERRAIN_SEG_NEAR_EVENT),
        ("event %" GST_PTR_FORMAT, printable(event)));
    return false;
  }
  {
    const Lock lock(shared.mutex);
    shared.book.set_near_clear(clear);
  }
  g_object_notify(G_OBJECT(element), "near-clear");
  return true;
}

/// Poses come a hundred times a second.
bool is_first_pose_flaw(Shared& shared) {
  const Lock lock(shared.mutex);
  return shared.pose_flaw.first();
}

/// As take_near_event().
bool take_pose_event(GstElement* element, Shared& shared, MetricStage& metres, GstEvent* event) {
  const GstStructure* fields = gst_event_get_structure(event);
  if (!fields || !gst_structure_has_name(fields, GST_TERRAIN_SEG_POSE_EVENT))
    return false;
  const char* flaw = metres.take_pose(fields);
  if (flaw && is_first_pose_flaw(shared))
    GST_ELEMENT_WARNING(element, STREAM, FAILED,
                        ("Invalid event %s, ignored: %s.", GST_TERRAIN_SEG_POSE_EVENT, flaw),
                        ("event %" GST_PTR_FORMAT, printable(event)));
  return !flaw;
}

} // namespace

bool take_custom_event(GstElement* element, Shared& shared, MetricStage& metres, GstEvent* event) {
  return take_near_event(element, shared, event) || take_pose_event(element, shared, metres, event);
}

} // namespace terrainseg
