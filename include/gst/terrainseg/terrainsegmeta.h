/* SPDX-License-Identifier: LGPL-2.1-or-later */
/**
 * The metadata that the plugin `terrainseg` attaches to video buffers, for programs in C.
 *
 * Everything lies in the GstStructure of a custom meta, so nothing has to be linked but GStreamer itself:
 * these are inline accessors. The plugin registers the meta when it is loaded (any of its elements was made,
 * or gst_plugin_load_by_name ("terrainseg")); before that there can be no such meta and the accessors say so.
 *
 * Lifetime: what an accessor returns belongs to the buffer that carries the meta. Take a reference of a mask
 * or boundary that has to outlive it.
 */
#ifndef GST_TERRAINSEG_META_H
#define GST_TERRAINSEG_META_H

#include <gst/gst.h>
#include <gst/video/video.h>

G_BEGIN_DECLS

/** Names of the metas: arguments of gst_buffer_get_custom_meta(). */
#define GST_TERRAIN_SEG_META_NAME "GstTerrainSegMeta"
#define GST_TERRAIN_TRAINING_META_NAME "GstTerrainTrainingMeta"
#define GST_TERRAIN_TRUTH_META_NAME "GstTerrainTruthMeta"
/** Type of a GstVideoRegionOfInterestMeta whose pixels are trained on. */
#define GST_TERRAIN_TRAINING_ROI "terrain-training"
/** Name of the custom event, upstream or downstream, with the boolean field "clear". */
#define GST_TERRAIN_SEG_NEAR_EVENT "terrainseg-near"
/** Name of the element message that post-messages=true sends on change. */
#define GST_TERRAIN_SEG_MESSAGE "terrainseg"

/** Raised when a field changes its meaning; fields may be added without it. */
#define GST_TERRAIN_SEG_META_VERSION 1

/** Bits of gst_terrain_seg_meta_get_flags(). */
typedef enum {
  GST_TERRAIN_SEG_FLAG_LEARNED = 1,       /* this frame's window was learned */
  GST_TERRAIN_SEG_FLAG_FROZEN = 2,        /* not learned: learning or near-clear is off */
  GST_TERRAIN_SEG_FLAG_STARVED = 4,       /* not learned: too few usable window pixels */
  GST_TERRAIN_SEG_FLAG_UNKNOWN = 8,       /* nothing is known, the mask is 128 everywhere */
  GST_TERRAIN_SEG_FLAG_HORIZON_HELD = 16, /* the horizon row is an earlier frame's */
  GST_TERRAIN_SEG_FLAG_BLOCKED = 32       /* too little free space ahead of the window, or unknown */
} GstTerrainSegFlags;

/** Values of a mask pixel. */
enum {
  GST_TERRAIN_SEG_NOT_TRAVERSABLE = 0,
  GST_TERRAIN_SEG_DOUBTFUL = 128, /* doubtful, ignored or unknown */
  GST_TERRAIN_SEG_TRAVERSABLE = 255
};

/** The structure of the meta called @name on @buffer, or NULL when there is none. */
static inline const GstStructure* gst_terrain_meta_get_named_structure(GstBuffer* buffer, const gchar* name) {
  GstCustomMeta* meta;

  if (gst_meta_get_info(name) == NULL)
    return NULL; /* the plugin is not loaded, and asking on would be a critical */
  meta = gst_buffer_get_custom_meta(buffer, name);
  return meta ? gst_custom_meta_get_structure(meta) : NULL;
}

/** The structure with all fields of the estimate of @buffer's picture, or NULL when it carries none. */
static inline const GstStructure* gst_buffer_get_terrain_seg_structure(GstBuffer* buffer) {
  return gst_terrain_meta_get_named_structure(buffer, GST_TERRAIN_SEG_META_NAME);
}

static inline gint gst_terrain_seg_meta_get_int_(const GstStructure* meta, const gchar* field,
                                                 gint fallback) {
  gint value;

  return gst_structure_get_int(meta, field, &value) ? value : fallback;
}

static inline guint gst_terrain_seg_meta_get_uint_(const GstStructure* meta, const gchar* field,
                                                   guint fallback) {
  guint value;

  return gst_structure_get_uint(meta, field, &value) ? value : fallback;
}

static inline GstBuffer* gst_terrain_seg_meta_get_buffer_(const GstStructure* meta, const gchar* field) {
  const GValue* value = gst_structure_get_value(meta, field);

  return value && G_VALUE_HOLDS(value, GST_TYPE_BUFFER) ? (GstBuffer*)g_value_get_boxed(value) : NULL;
}

/** GST_TERRAIN_SEG_META_VERSION of the writer. */
static inline guint gst_terrain_seg_meta_get_version(const GstStructure* meta) {
  return gst_terrain_seg_meta_get_uint_(meta, "version", 0);
}

/** Number of the frame since the element started, from 0. */
static inline guint64 gst_terrain_seg_meta_get_frame(const GstStructure* meta) {
  guint64 value;

  return gst_structure_get_uint64(meta, "frame", &value) ? value : 0;
}

/** Size in pixels of the picture that rows and rectangles refer to. */
static inline gint gst_terrain_seg_meta_get_frame_width(const GstStructure* meta) {
  return gst_terrain_seg_meta_get_int_(meta, "frame-width", 0);
}

static inline gint gst_terrain_seg_meta_get_frame_height(const GstStructure* meta) {
  return gst_terrain_seg_meta_get_int_(meta, "frame-height", 0);
}

/** Row of the horizon, 0 at the top; -1 = none was found. */
static inline gint gst_terrain_seg_meta_get_horizon_row(const GstStructure* meta) {
  return gst_terrain_seg_meta_get_int_(meta, "horizon-row", -1);
}

/** 0 (none) to 255. */
static inline guint gst_terrain_seg_meta_get_horizon_confidence(const GstStructure* meta) {
  return gst_terrain_seg_meta_get_uint_(meta, "horizon-confidence", 0);
}

/** 0 (none) to 255: how far the mask can be trusted. */
static inline guint gst_terrain_seg_meta_get_confidence(const GstStructure* meta) {
  return gst_terrain_seg_meta_get_uint_(meta, "confidence", 0);
}

/** The mask: GRAY8, size and stride in its GstVideoMeta (map it with gst_video_frame_map() or
 *  gst_video_meta_map()). Read only. NULL when a program attached a meta without one. */
static inline GstBuffer* gst_terrain_seg_meta_get_mask(const GstStructure* meta) {
  return gst_terrain_seg_meta_get_buffer_(meta, "mask");
}

/** Where the mask lies in the frame, in frame pixels. */
static inline void gst_terrain_seg_meta_get_mask_region(const GstStructure* meta, GstVideoRectangle* region) {
  region->x = gst_terrain_seg_meta_get_int_(meta, "mask-x", 0);
  region->y = gst_terrain_seg_meta_get_int_(meta, "mask-y", 0);
  region->w = gst_terrain_seg_meta_get_int_(meta, "mask-w", 0);
  region->h = gst_terrain_seg_meta_get_int_(meta, "mask-h", 0);
}

/** One uint16, little-endian, per mask column: the highest row (of the frame) of the free space that is
 *  reachable from the window without a break; the frame's height = none. */
static inline GstBuffer* gst_terrain_seg_meta_get_boundary(const GstStructure* meta) {
  return gst_terrain_seg_meta_get_buffer_(meta, "boundary");
}

/** Share of the mask's pixels that are traversable, 0..1000. */
static inline guint gst_terrain_seg_meta_get_traversable_permille(const GstStructure* meta) {
  return gst_terrain_seg_meta_get_uint_(meta, "traversable-permille", 0);
}

/** The training window, in frame pixels. */
static inline void gst_terrain_seg_meta_get_window(const GstStructure* meta, GstVideoRectangle* window) {
  window->x = gst_terrain_seg_meta_get_int_(meta, "window-x", 0);
  window->y = gst_terrain_seg_meta_get_int_(meta, "window-y", 0);
  window->w = gst_terrain_seg_meta_get_int_(meta, "window-w", 0);
  window->h = gst_terrain_seg_meta_get_int_(meta, "window-h", 0);
}

/** Counts changes of what is learned. */
static inline guint gst_terrain_seg_meta_get_model_generation(const GstStructure* meta) {
  return gst_terrain_seg_meta_get_uint_(meta, "model-generation", 0);
}

/** GstTerrainSegFlags. */
static inline guint gst_terrain_seg_meta_get_flags(const GstStructure* meta) {
  return gst_terrain_seg_meta_get_uint_(meta, "flags", GST_TERRAIN_SEG_FLAG_UNKNOWN);
}

/** Number of learned models. */
static inline guint gst_terrain_seg_meta_get_model_count(const GstStructure* meta) {
  const GValue* list = gst_structure_get_value(meta, "models");

  return list && GST_VALUE_HOLDS_LIST(list) ? gst_value_list_get_size(list) : 0;
}

/** Model @index: a structure with "mean" and "variance" (arrays of three doubles, 8-bit units of the colour
 *  space it was learned in), "mass" (uint64, samples) and "rgb" (uint, the mean as 0xRRGGBB). NULL when there
 *  is no such model. */
static inline const GstStructure* gst_terrain_seg_meta_get_model(const GstStructure* meta, guint index) {
  const GValue *list = gst_structure_get_value(meta, "models"), *value;

  if (list == NULL || !GST_VALUE_HOLDS_LIST(list) || index >= gst_value_list_get_size(list))
    return NULL;
  value = gst_value_list_get_value(list, index);
  return GST_VALUE_HOLDS_STRUCTURE(value) ? gst_value_get_structure(value) : NULL;
}

G_END_DECLS

#endif /* GST_TERRAINSEG_META_H */
