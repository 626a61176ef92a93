// SPDX-License-Identifier: LGPL-2.1-or-later
#include "support/meta.hpp"

#include <gst/terrainseg/terrainsegmeta.h>
#include <gst/video/video.h>

#include <vector>

#include "support/buffers.hpp"
#include "support/estimate_meta.hpp"

namespace terrainseg {
namespace {

void rescale_length(GstStructure* fields, const char* name, Axis axis) {
  int length = 0;
  if (gst_structure_get_int(fields, name, &length) && length > 0)
    gst_structure_set(fields, name, G_TYPE_INT, axis.edge(length), nullptr);
}

void rescale_span(GstStructure* fields, const char* position_name, const char* length_name, Axis axis) {
  int position = 0, length = 0;
  if (!gst_structure_get(fields, position_name, G_TYPE_INT, &position, length_name, G_TYPE_INT, &length,
                         nullptr) ||
      position < 0 || length < 0 || length > G_MAXINT - position)
    return;
  const int start = axis.edge(position), end = axis.edge(position + length);
  gst_structure_set(fields, position_name, G_TYPE_INT, start, length_name, G_TYPE_INT, end - start, nullptr);
}

void rescale_horizon(GstStructure* fields, Axis y) {
  int row = 0;
  if (gst_structure_get_int(fields, "horizon-row", &row) && row >= 0)
    gst_structure_set(fields, "horizon-row", G_TYPE_INT, y.row(row), nullptr);
  double line = 0;
  if (gst_structure_get_double(fields, "vanishing-row", &line) && line >= 0)
    gst_structure_set(fields, "vanishing-row", G_TYPE_DOUBLE, line * y.to / y.from, nullptr);
}

/// Rows equal to the old frame height mean "none" and become the new height.
void rescale_boundary(GstStructure* fields, int old_height, int new_height, Axis y) {
  GstBuffer* boundary = gst_terrain_seg_meta_get_boundary(fields);
  ValueReader<std::uint16_t> rows;
  if (!boundary || !rows.map(boundary) || !rows.is_whole())
    return;
  std::vector<std::uint16_t> moved(rows.values().begin(), rows.values().end());
  for (std::uint16_t& row : moved)
    row = static_cast<std::uint16_t>(row >= old_height ? new_height : std::min(y.row(row), new_height - 1));
  const OwnedBuffer scaled(new_boundary_buffer(moved));
  if (scaled)
    gst_structure_set(fields, "boundary", GST_TYPE_BUFFER, scaled.get(), nullptr);
}

void rescale(GstStructure* fields, Axis x, Axis y) {
  rescale_horizon(fields, y);
  int old_height = 0;
  if (!gst_structure_get_int(fields, "frame-height", &old_height))
    return; // metres, truth, training and vetoed pixels do not contain rows
  rescale_length(fields, "frame-width", x);
  rescale_length(fields, "frame-height", y);
  rescale_boundary(fields, old_height, y.edge(old_height), y);
  rescale_span(fields, "mask-x", "mask-w", x);
  rescale_span(fields, "mask-y", "mask-h", y);
  rescale_span(fields, "window-x", "window-w", x);
  rescale_span(fields, "window-y", "window-h", y);
}

/// Copies the structure; buffers in it are referenced, not copied.
GstStructure* carry_over(GstBuffer* to, GstCustomMeta* meta) {
  GstStructure* from = gst_custom_meta_get_structure(meta);
  GstCustomMeta* added = gst_buffer_add_custom_meta(to, gst_structure_get_name(from));
  if (!added)
    return nullptr;
  GstStructure* fields = gst_custom_meta_get_structure(added);
  gst_structure_foreach(
      from,
      [](GQuark field, const GValue* value, gpointer data) -> gboolean {
        gst_structure_id_set_value(static_cast<GstStructure*>(data), field, value);
        return TRUE;
      },
      fields);
  return fields;
}

gboolean transform(GstBuffer* to, GstCustomMeta* meta, GstBuffer*, GQuark type, gpointer data, gpointer) {
  if (GST_META_TRANSFORM_IS_COPY(type)) {
    const auto* copy = static_cast<const GstMetaTransformCopy*>(data);
    return !copy->region && carry_over(to, meta);
  }
  // Also called for a change of colour only, with equal sizes.
  if (GST_VIDEO_META_TRANSFORM_IS_SCALE(type)) {
    const auto* scale = static_cast<const GstVideoMetaTransform*>(data);
    const Axis x{GST_VIDEO_INFO_WIDTH(scale->in_info), GST_VIDEO_INFO_WIDTH(scale->out_info)};
    const Axis y{GST_VIDEO_INFO_HEIGHT(scale->in_info), GST_VIDEO_INFO_HEIGHT(scale->out_info)};
    if (x.from <= 0 || y.from <= 0 || x.to <= 0 || y.to <= 0)
      return FALSE;
    GstStructure* fields = carry_over(to, meta);
    if (fields && (x.from != x.to || y.from != y.to))
      rescale(fields, x, y);
    return fields != nullptr;
  }
  return FALSE;
}

bool register_one(const char* name) {
  if (gst_meta_get_info(name))
    return true; // registering a name twice would log a critical
  // With exactly these tags, converters, scalers and codecs keep the meta, and crops and flips, after which
  // it would be wrong, drop it.
  static const gchar* tags[] = {GST_META_TAG_VIDEO_STR, GST_META_TAG_VIDEO_ORIENTATION_STR,
                                GST_META_TAG_VIDEO_SIZE_STR, nullptr};
  return gst_meta_register_custom(name, tags, transform, nullptr, nullptr) != nullptr;
}

} // namespace

bool register_metas() {
  return register_one(GST_TERRAIN_SEG_META_NAME) && register_one(GST_TERRAIN_METRIC_META_NAME) &&
         register_one(GST_TERRAIN_TRAINING_META_NAME) && register_one(GST_TERRAIN_VETO_META_NAME) &&
         register_one(GST_TERRAIN_TRUTH_META_NAME);
}

void remove_metas(GstBuffer* buffer, const char* name, const char* instance) {
  struct Wanted {
    GType api;
    const char* instance;
  } wanted{gst_meta_get_info(name)->api, instance};
  gst_buffer_foreach_meta(
      buffer,
      [](GstBuffer*, GstMeta** meta, gpointer data) -> gboolean {
        const auto* w = static_cast<const Wanted*>(data);
        if ((*meta)->info->api != w->api)
          return TRUE;
        const char* found = gst_terrain_seg_meta_get_instance(
            gst_custom_meta_get_structure(reinterpret_cast<GstCustomMeta*>(*meta)));
        if (g_str_equal(found ? found : "", w->instance))
          *meta = nullptr;
        return TRUE;
      },
      &wanted);
}

} // namespace terrainseg
