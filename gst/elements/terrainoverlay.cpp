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

using namespace terrainseg;

namespace {

struct OverlayElementSettings {
  OverlaySettings drawing;
  InternedName source;
};

constexpr auto drawing = overlay_rows<&OverlayElementSettings::drawing>();
const Property<OverlayElementSettings> table[] = {drawing[0], drawing[1], drawing[2],
                                                  source_row<&OverlayElementSettings::source>()};

/// Everything behind the instance.
struct OverlayState {
  GstBaseTransform* element = nullptr;
  OverlayElementSettings settings; // object lock
  GstVideoInfo info = no_video();  // streaming
  Once<> damaged;                  // streaming
  MetadataWatch metadata;          // streaming
  MetricDrawing drawing;           // streaming
};

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

bool start(OverlayState& s) {
  s.damaged.again();
  s.metadata = {};
  return true;
}

bool set_caps(OverlayState& s, GstCaps* caps, GstCaps*) {
  GstVideoInfo info;
  if (!read_video_info(info, caps)) {
    GST_ELEMENT_ERROR(s.element, STREAM, FORMAT, ("Unsupported video format."),
                      ("caps %" GST_PTR_FORMAT, printable(caps)));
    return false;
  }
  GST_DEBUG_OBJECT(s.element, "caps %" GST_PTR_FORMAT, printable(caps));
  s.info = info;
  return true;
}

/// Says that nothing can be seen, when no frame had metadata.
void warn_bare(const OverlayState& s) {
  TERRAINSEG_POST_WARNING(
      s.element, STREAM, FAILED,
      s.metadata.warning("terrainoverlay", "nothing is drawn", s.settings.source.c_str()));
}

gboolean sink_event(OverlayState& s, GstEvent* event) {
  if (GST_EVENT_TYPE(event) == GST_EVENT_EOS && s.metadata.end())
    warn_bare(s);
  return GST_BASE_TRANSFORM_CLASS(gst_terrain_overlay_parent_class)->sink_event(s.element, event);
}

GstFlowReturn draw(OverlayState& s, GstBuffer* buffer) {
  const PaintStyle style = locked_copy(s.element, s.settings.drawing).paint();
  const EstimateReader reader(buffer, s.settings.source.c_str());
  GST_LOG_OBJECT(s.element, "%s: %" GST_PTR_FORMAT,
                 reader           ? "draws on"
                 : reader.error() ? reader.error()
                                  : "no metadata of that source on",
                 printable(buffer));
  if (s.metadata.see(reader || reader.error()))
    warn_bare(s);
  if (!reader) {
    if (reader.error() && s.damaged.first())
      GST_ELEMENT_WARNING(s.element, STREAM, FAILED,
                          ("Invalid terrain metadata, frame passed through undrawn: %s.", reader.error()),
                          ("buffer %" GST_PTR_FORMAT ": %s", printable(buffer), reader.error()));
    return GST_FLOW_OK;
  }
  if (style.style != OverlayStyle::mask && (style.alpha == 0 || style.color >> 24 == 0))
    return GST_FLOW_OK;
  // Mapping for writing copies pixels that are shared; a frame that is not drawn on is
  // never mapped.
  const MappedFrame frame(s.info, buffer, GST_MAP_READWRITE);
  if (!frame)
    return report_unusable(s.element, buffer, frame);
  const MetricReader metres(buffer, s.settings.source.c_str());
  s.drawing.draw(frame.mutable_view(), reader.estimate(), metres ? &metres.metric() : nullptr, style);
  return GST_FLOW_OK;
}

void gst_terrain_overlay_init(GstTerrainOverlay* self) {
  const OverlayState& s = self->make_state();
  gst_base_transform_set_in_place(s.element, TRUE);
  gst_base_transform_set_gap_aware(s.element, TRUE);
}

void gst_terrain_overlay_class_init(GstTerrainOverlayClass* klass) {
  GST_DEBUG_CATEGORY_INIT(terrainoverlay_debug, "terrainoverlay", 0,
                          "Draws traversable terrain from metadata");
  init_class<GstTerrainOverlay, gst_terrain_overlay_parent_class, table>(
      klass, {"Traversable terrain overlay", "Filter/Editor/Video",
              "Draws the metadata of terrainseg onto the frames that carry it"});
  add_video_pad_templates(GST_ELEMENT_CLASS(klass));
  auto* transform_class = GST_BASE_TRANSFORM_CLASS(klass);
  transform_class->start = GstTerrainOverlay::call<start>;
  transform_class->set_caps = GstTerrainOverlay::call<set_caps>;
  transform_class->sink_event = GstTerrainOverlay::call<sink_event>;
  transform_class->propose_allocation = propose_video_allocation<gst_terrain_overlay_parent_class>;
  transform_class->before_transform = sync_controlled;
  transform_class->transform_ip = GstTerrainOverlay::call<draw>;
}

} // namespace

GST_ELEMENT_REGISTER_DEFINE(terrainoverlay, "terrainoverlay", GST_RANK_NONE, gst_terrain_overlay_get_type())
