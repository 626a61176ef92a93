// SPDX-License-Identifier: LGPL-2.1-or-later

#include <gst/base/gstbasetransform.h>

#include "support/elements.hpp"
#include "support/estimate_meta.hpp"
#include "support/guarded.hpp"
#include "support/instance_state.hpp"
#include "support/metadata_watch.hpp"
#include "support/metric_drawing.hpp"
#include "support/metric_meta.hpp"
#include "support/name_property.hpp"
#include "support/object.hpp"
#include "support/once.hpp"
#include "support/overlay_properties.hpp"
#include "support/plugin_api.hpp"
#include "support/transform.hpp"
#include "support/video_frame.hpp"
#include "support/warning.hpp"

GST_DEBUG_CATEGORY_STATIC(terrainoverlay_debug);
#define GST_CAT_DEFAULT terrainoverlay_debug

namespace terrainseg {

/// Everything behind the instance. "streaming": touched by the streaming thread alone, or while there is
/// none.
struct OverlayState {
  OverlaySettings settings; // object lock
  NameProperty source;
  GstVideoInfo info;      // streaming
  Once<> damaged;         // streaming
  MetadataWatch metadata; // streaming
  MetricDrawing drawing;  // streaming

  OverlayState() noexcept { gst_video_info_init(&info); }
};

} // namespace terrainseg

using namespace terrainseg;

/**
 * SECTION:element-terrainoverlay
 * @title: terrainoverlay
 * @short_description: draws traversable terrain from metadata
 *
 * Draws the metadata of terrainseg onto the frames that carry it: after a tee, after a decoder, at a ground
 * station.
 *
 * ## Example launch line
 * |[
 * gst-launch-1.0 terrainscenesrc num-buffers=60 ! terrainseg ! terrainoverlay overlay-style=contour !
 * videoconvert ! autovideosink
 * ]|
 *
 * Since: 0.1
 */
struct GstTerrainOverlay {
  GstBaseTransform parent;
  InstanceState<OverlayState> state;
};
struct GstTerrainOverlayClass {
  GstBaseTransformClass parent_class;
};

G_DEFINE_TYPE(GstTerrainOverlay, gst_terrain_overlay, GST_TYPE_BASE_TRANSFORM)
GST_ELEMENT_REGISTER_DEFINE(terrainoverlay, "terrainoverlay", GST_RANK_NONE, gst_terrain_overlay_get_type())

namespace {

constexpr guint first_property = 1, property_source = first_property + overlay_property_count;

GstTerrainOverlay* self_of(gpointer object) {
  return reinterpret_cast<GstTerrainOverlay*>(object);
}

void set_property(GObject* object, guint id, const GValue* value, GParamSpec* spec) {
  if (id == property_source) {
    self_of(object)->state->source.set(value);
    return;
  }
  if (id < first_property || id >= first_property + overlay_property_count) {
    G_OBJECT_WARN_INVALID_PROPERTY_ID(object, id, spec);
    return;
  }
  ObjectLock lock(object);
  set_overlay_property(self_of(object)->state->settings, id - first_property, value);
}

void get_property(GObject* object, guint id, GValue* value, GParamSpec* spec) {
  if (id == property_source) {
    self_of(object)->state->source.get(value);
    return;
  }
  if (id < first_property || id >= first_property + overlay_property_count) {
    G_OBJECT_WARN_INVALID_PROPERTY_ID(object, id, spec);
    return;
  }
  ObjectLock lock(object);
  get_overlay_property(self_of(object)->state->settings, id - first_property, value);
}

gboolean start(GstBaseTransform* transform) {
  OverlayState& s = *self_of(transform)->state;
  s.damaged.again();
  s.metadata = {};
  return TRUE;
}

gboolean set_caps(GstBaseTransform* transform, GstCaps* caps, GstCaps*) {
  GstVideoInfo info;
  if (!read_video_info(info, caps)) {
    GST_ELEMENT_ERROR(transform, STREAM, FORMAT, ("Unsupported video format."),
                      ("caps %" GST_PTR_FORMAT, printable(caps)));
    return FALSE;
  }
  GST_DEBUG_OBJECT(transform, "caps %" GST_PTR_FORMAT, printable(caps));
  self_of(transform)->state->info = info;
  return TRUE;
}

gboolean propose_allocation(GstBaseTransform* transform, GstQuery* decide_query, GstQuery* query) {
  return propose_video_allocation(gst_terrain_overlay_parent_class, transform, decide_query, query);
}

void before_transform(GstBaseTransform* transform, GstBuffer* buffer) {
  sync_controlled(transform, buffer);
}

PaintStyle style_of(gpointer object, const OverlayState& s) {
  ObjectLock lock(object);
  return s.settings.paint();
}

/// Says that nothing can be seen, when no frame had metadata.
void warn_bare(GstBaseTransform* transform, const OverlayState& s) {
  TERRAINSEG_POST_WARNING(transform, STREAM, FAILED,
                          s.metadata.warning("terrainoverlay", "nothing is drawn", s.source.name()));
}

gboolean sink_event(GstBaseTransform* transform, GstEvent* event) {
  OverlayState& s = *self_of(transform)->state;
  if (GST_EVENT_TYPE(event) == GST_EVENT_EOS && s.metadata.end())
    warn_bare(transform, s);
  return GST_BASE_TRANSFORM_CLASS(gst_terrain_overlay_parent_class)->sink_event(transform, event);
}

GstFlowReturn draw(GstBaseTransform* transform, OverlayState& s, GstBuffer* buffer) {
  const PaintStyle style = style_of(transform, s);
  const EstimateReader reader(buffer, s.source.name());
  GST_LOG_OBJECT(transform, "%s: %" GST_PTR_FORMAT,
                 reader           ? "draws on"
                 : reader.error() ? reader.error()
                                  : "no metadata of that source on",
                 printable(buffer));
  if (s.metadata.see(reader || reader.error()))
    warn_bare(transform, s);
  if (!reader) {
    if (reader.error() && s.damaged.first())
      GST_ELEMENT_WARNING(transform, STREAM, FAILED,
                          ("Invalid terrain metadata, frame passed through undrawn: %s.", reader.error()),
                          ("buffer %" GST_PTR_FORMAT ": %s", printable(buffer), reader.error()));
    return GST_FLOW_OK;
  }
  const bool invisible = style.style != OverlayStyle::mask && (style.alpha == 0 || style.color >> 24 == 0);
  if (invisible)
    return GST_FLOW_OK;
  // Mapping for writing copies pixels that are shared; a frame that is not drawn on is
  // never mapped.
  const MappedFrame frame(s.info, buffer, GST_MAP_READWRITE);
  if (!frame) {
    report_unusable(transform, buffer, frame);
    return GST_FLOW_ERROR;
  }
  const MutableFrame view = frame.mutable_view();
  paint(view, reader.estimate(), style);
  if (const MetricReader metres(buffer, s.source.name()); metres)
    paint_metres(view,
                 s.drawing.make(reader.estimate(), metres.metric(), style.style, view.width, view.height),
                 style);
  return GST_FLOW_OK;
}

GstFlowReturn transform_ip(GstBaseTransform* transform, GstBuffer* buffer) {
  return guarded(transform, GST_FLOW_ERROR,
                 [&] { return draw(transform, *self_of(transform)->state, buffer); });
}

} // namespace

static void gst_terrain_overlay_init(GstTerrainOverlay* self) {
  self->state.make();
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
  object_class->finalize = finalize_state<GstTerrainOverlay, gst_terrain_overlay_parent_class>;
  install_overlay_properties(object_class, first_property);
  NameProperty::install_source(object_class, property_source);

  mark_enums_as_plugin_api(object_class);
  gst_element_class_set_static_metadata(element_class, "Traversable terrain overlay", "Filter/Editor/Video",
                                        "Draws the metadata of terrainseg onto the frames that carry it",
                                        "The terrainseg developers");
  add_video_pad_templates(element_class);

  transform_class->start = start;
  transform_class->set_caps = set_caps;
  transform_class->sink_event = sink_event;
  transform_class->propose_allocation = propose_allocation;
  transform_class->before_transform = before_transform;
  transform_class->transform_ip = transform_ip;
}
