// SPDX-License-Identifier: LGPL-2.1-or-later
#include "terrainoverlay.hpp"

#include <gst/base/gstbasetransform.h>

#include "estimate_meta.hpp"
#include "guarded.hpp"
#include "overlay_properties.hpp"
#include "video_frame.hpp"

GST_DEBUG_CATEGORY_STATIC(terrainoverlay_debug);
#define GST_CAT_DEFAULT terrainoverlay_debug

namespace terrainseg {

/// Everything behind the instance. "streaming": touched by the streaming thread alone, or while there is
/// none.
struct OverlayState {
  OverlaySettings settings; // object lock
  GstVideoInfo info;        // streaming
  bool warned = false;      // streaming; damaged metadata is told once a stream

  OverlayState() { gst_video_info_init(&info); }
};

} // namespace terrainseg

using namespace terrainseg;

struct GstTerrainOverlay {
  GstBaseTransform parent;
  OverlayState* state;
};
struct GstTerrainOverlayClass {
  GstBaseTransformClass parent_class;
};

G_DEFINE_TYPE(GstTerrainOverlay, gst_terrain_overlay, GST_TYPE_BASE_TRANSFORM)
GST_ELEMENT_REGISTER_DEFINE(terrainoverlay, "terrainoverlay", GST_RANK_NONE, gst_terrain_overlay_get_type())

namespace {

constexpr guint first_property = 1;

GstTerrainOverlay* self_of(gpointer object) {
  return reinterpret_cast<GstTerrainOverlay*>(object);
}

/// For GST_PTR_FORMAT, which the compiler takes for %p.
void* printable(void* object) {
  return object;
}

void set_property(GObject* object, guint id, const GValue* value, GParamSpec* spec) {
  if (id < first_property || id >= first_property + overlay_property_count) {
    G_OBJECT_WARN_INVALID_PROPERTY_ID(object, id, spec);
    return;
  }
  GST_OBJECT_LOCK(object);
  set_overlay_property(self_of(object)->state->settings, id - first_property, value);
  GST_OBJECT_UNLOCK(object);
}

void get_property(GObject* object, guint id, GValue* value, GParamSpec* spec) {
  if (id < first_property || id >= first_property + overlay_property_count) {
    G_OBJECT_WARN_INVALID_PROPERTY_ID(object, id, spec);
    return;
  }
  GST_OBJECT_LOCK(object);
  get_overlay_property(self_of(object)->state->settings, id - first_property, value);
  GST_OBJECT_UNLOCK(object);
}

gboolean start(GstBaseTransform* transform) {
  self_of(transform)->state->warned = false;
  return TRUE;
}

gboolean set_caps(GstBaseTransform* transform, GstCaps* caps, GstCaps*) {
  GstVideoInfo info;
  if (!gst_video_info_from_caps(&info, caps)) {
    GST_ELEMENT_ERROR(transform, STREAM, FORMAT, ("The video format cannot be understood."),
                      ("caps %" GST_PTR_FORMAT, printable(caps)));
    return FALSE;
  }
  self_of(transform)->state->info = info;
  return TRUE;
}

gboolean propose_allocation(GstBaseTransform* transform, GstQuery* decide_query, GstQuery* query) {
  if (!GST_BASE_TRANSFORM_CLASS(gst_terrain_overlay_parent_class)
           ->propose_allocation(transform, decide_query, query))
    return FALSE;
  if (!gst_query_find_allocation_meta(query, GST_VIDEO_META_API_TYPE, nullptr))
    gst_query_add_allocation_meta(query, GST_VIDEO_META_API_TYPE, nullptr); // any stride and offset will do
  return TRUE;
}

void before_transform(GstBaseTransform* transform, GstBuffer* buffer) {
  const GstClockTime time =
      gst_segment_to_stream_time(&transform->segment, GST_FORMAT_TIME, GST_BUFFER_PTS(buffer));
  if (GST_CLOCK_TIME_IS_VALID(time))
    gst_object_sync_values(GST_OBJECT(transform), time);
}

GstFlowReturn draw(GstBaseTransform* transform, OverlayState& s, GstBuffer* buffer) {
  GST_OBJECT_LOCK(transform);
  const PaintStyle style = s.settings.paint();
  GST_OBJECT_UNLOCK(transform);
  const EstimateReader reader(buffer);
  if (!reader) {
    if (reader.error() && !s.warned) {
      s.warned = true;
      GST_ELEMENT_WARNING(
          transform, STREAM, FAILED,
          ("Metadata that makes no sense was not drawn: %s. Frames like this pass as they are.",
           reader.error()),
          ("buffer %" GST_PTR_FORMAT ": %s", printable(buffer), reader.error()));
    }
    return GST_FLOW_OK;
  }
  const bool invisible = style.style != OverlayStyle::mask && (style.alpha == 0 || style.color >> 24 == 0);
  if (invisible)
    return GST_FLOW_OK;
  if (const auto wrong = describe_unusable(s.info, buffer)) {
    GST_ELEMENT_ERROR(transform, STREAM, FORMAT, ("A buffer does not hold a frame: %s.", wrong->c_str()),
                      ("buffer %" GST_PTR_FORMAT ": %s", printable(buffer), wrong->c_str()));
    return GST_FLOW_ERROR;
  }
  // Mapping for writing copies the pixels when somebody else holds them too; a frame that is not drawn on is
  // never mapped.
  const MappedFrame frame(s.info, buffer, GST_MAP_READWRITE);
  if (!frame) {
    GST_ELEMENT_ERROR(
        transform, RESOURCE, WRITE, ("A frame's memory cannot be written to."),
        ("buffer %" GST_PTR_FORMAT " cannot be mapped as one piece a plane", printable(buffer)));
    return GST_FLOW_ERROR;
  }
  paint(mutable_view_of(*frame), reader.estimate(), style);
  return GST_FLOW_OK;
}

GstFlowReturn transform_ip(GstBaseTransform* transform, GstBuffer* buffer) {
  return guarded(transform, GST_FLOW_ERROR,
                 [&] { return draw(transform, *self_of(transform)->state, buffer); });
}

void finalize(GObject* object) {
  delete self_of(object)->state;
  G_OBJECT_CLASS(gst_terrain_overlay_parent_class)->finalize(object);
}

} // namespace

static void gst_terrain_overlay_init(GstTerrainOverlay* self) {
  self->state = new OverlayState;
  auto* transform = GST_BASE_TRANSFORM(self);
  gst_base_transform_set_in_place(transform, TRUE);
  gst_base_transform_set_gap_aware(transform, TRUE);
}

static void gst_terrain_overlay_class_init(GstTerrainOverlayClass* klass) {
  GST_DEBUG_CATEGORY_INIT(terrainoverlay_debug, "terrainoverlay", 0,
                          "Draws traversable terrain from metadata");
  auto* object_class = G_OBJECT_CLASS(klass);
  auto* element_class = GST_ELEMENT_CLASS(klass);
  auto* transform_class = GST_BASE_TRANSFORM_CLASS(klass);

  object_class->set_property = set_property;
  object_class->get_property = get_property;
  object_class->finalize = finalize;
  install_overlay_properties(object_class, first_property);

  gst_element_class_set_static_metadata(element_class, "Traversable terrain overlay", "Filter/Editor/Video",
                                        "Draws the metadata of terrainseg onto the frames that carry it",
                                        "The terrainseg developers");
  add_video_pad_templates(element_class);

  transform_class->start = start;
  transform_class->set_caps = set_caps;
  transform_class->propose_allocation = propose_allocation;
  transform_class->before_transform = before_transform;
  transform_class->transform_ip = transform_ip;
}
