// SPDX-License-Identifier: LGPL-2.1-or-later

#include <gst/base/gstbasetransform.h>

#include "support/element.hpp"
#include "support/estimate_meta.hpp"
#include "support/metric_drawing.hpp"
#include "support/overlay_properties.hpp"
#include "support/transform.hpp"
#include "support/video_frame.hpp"
#include "support/warnings.hpp"

GST_DEBUG_CATEGORY_STATIC(terrainoverlay_debug);
#define GST_CAT_DEFAULT terrainoverlay_debug

namespace terrainseg {

namespace {

struct OverlayElementSettings {
  OverlaySettings drawing;
  InternedName source;
};

constexpr auto drawing = overlay_rows<&OverlayElementSettings::drawing>();
const Property<OverlayElementSettings> table[] = {drawing[0], drawing[1], drawing[2],
                                                  source_row<&OverlayElementSettings::source>()};

} // namespace

/// Everything behind the instance.
struct OverlayState {
  OverlayElementSettings settings; // object lock
  GstVideoInfo info = no_video();  // streaming
  Once<> damaged;                  // streaming
  MetadataWatch metadata;          // streaming
  MetricDrawing drawing;           // streaming
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
using GstTerrainOverlay = Instance<GstBaseTransform, OverlayState>;
using GstTerrainOverlayClass = GstBaseTransformClass;

G_DEFINE_TYPE(GstTerrainOverlay, gst_terrain_overlay, GST_TYPE_BASE_TRANSFORM)
GST_ELEMENT_REGISTER_DEFINE(terrainoverlay, "terrainoverlay", GST_RANK_NONE, gst_terrain_overlay_get_type())

namespace {

OverlayState& state_of(gpointer object) {
  return *reinterpret_cast<GstTerrainOverlay*>(object)->state;
}

gboolean start(GstBaseTransform* transform) {
  OverlayState& s = state_of(transform);
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
  state_of(transform).info = info;
  return TRUE;
}

/// Says that nothing can be seen, when no frame had metadata.
void warn_bare(GstBaseTransform* transform, const OverlayState& s) {
  TERRAINSEG_POST_WARNING(
      transform, STREAM, FAILED,
      s.metadata.warning("terrainoverlay", "nothing is drawn", s.settings.source.c_str()));
}

gboolean sink_event(GstBaseTransform* transform, GstEvent* event) {
  OverlayState& s = state_of(transform);
  if (GST_EVENT_TYPE(event) == GST_EVENT_EOS && s.metadata.end())
    warn_bare(transform, s);
  return GST_BASE_TRANSFORM_CLASS(gst_terrain_overlay_parent_class)->sink_event(transform, event);
}

GstFlowReturn draw(GstBaseTransform* transform, OverlayState& s, GstBuffer* buffer) {
  const PaintStyle style = locked_copy(transform, s.settings.drawing).paint();
  const EstimateReader reader(buffer, s.settings.source.c_str());
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
  if (style.style != OverlayStyle::mask && (style.alpha == 0 || style.color >> 24 == 0))
    return GST_FLOW_OK;
  // Mapping for writing copies pixels that are shared; a frame that is not drawn on is
  // never mapped.
  const MappedFrame frame(s.info, buffer, GST_MAP_READWRITE);
  if (!frame) {
    report_unusable(transform, buffer, frame);
    return GST_FLOW_ERROR;
  }
  const MetricReader metres(buffer, s.settings.source.c_str());
  s.drawing.draw(frame.mutable_view(), reader.estimate(), metres ? &metres.metric() : nullptr, style);
  return GST_FLOW_OK;
}

GstFlowReturn transform_ip(GstBaseTransform* transform, GstBuffer* buffer) {
  return guarded(transform, GST_FLOW_ERROR, [&] { return draw(transform, state_of(transform), buffer); });
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
  init_class<GstTerrainOverlay, gst_terrain_overlay_parent_class, table>(
      klass, {"Traversable terrain overlay", "Filter/Editor/Video",
              "Draws the metadata of terrainseg onto the frames that carry it"});
  add_video_pad_templates(GST_ELEMENT_CLASS(klass));
  auto* transform_class = GST_BASE_TRANSFORM_CLASS(klass);
  transform_class->start = start;
  transform_class->set_caps = set_caps;
  transform_class->sink_event = sink_event;
  transform_class->propose_allocation = propose_video_allocation<gst_terrain_overlay_parent_class>;
  transform_class->before_transform = sync_controlled;
  transform_class->transform_ip = transform_ip;
}
