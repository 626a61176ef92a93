/* SPDX-License-Identifier: LGPL-2.1-or-later */
/**
 * The metadata that the plugin `terrainseg` attaches to video buffers, for programs in C.
 *
 * All data are fields of the GstStructure of a GstCustomMeta. The accessors are inline functions, so a
 * program links only GStreamer. The plugin registers the metas when it is loaded: when one of its
 * elements is created, or by gst_plugin_load_by_name ("terrainseg"). Before that the accessors return
 * NULL.
 *
 * Lifetime: a returned structure or buffer belongs to the video buffer that carries the meta. To keep a
 * mask, boundary or confidence map longer, take a reference.
 */
#ifndef GST_TERRAINSEG_META_H
#define GST_TERRAINSEG_META_H

#include <gst/gst.h>
#include <gst/video/video.h>
#include <math.h>

G_BEGIN_DECLS

/** Names of the metas: arguments of gst_buffer_get_custom_meta(). */
#define GST_TERRAIN_SEG_META_NAME "GstTerrainSegMeta"
#define GST_TERRAIN_METRIC_META_NAME "GstTerrainMetricMeta"
#define GST_TERRAIN_TRAINING_META_NAME "GstTerrainTrainingMeta"
#define GST_TERRAIN_VETO_META_NAME "GstTerrainVetoMeta"
#define GST_TERRAIN_TRUTH_META_NAME "GstTerrainTruthMeta"
/** Type of a GstVideoRegionOfInterestMeta whose pixels are used for training. */
#define GST_TERRAIN_TRAINING_ROI "terrain-training"
/** Type of a GstVideoRegionOfInterestMeta whose pixels are never traversable and are not learned. */
#define GST_TERRAIN_VETO_ROI "terrain-veto"
/** Name of the custom event, upstream or downstream, with the boolean field "clear": FALSE while a
 * near-range sensor reports an obstacle in the training window. */
#define GST_TERRAIN_SEG_NEAR_EVENT "terrainseg-near"
/** Name of the custom event, upstream or downstream, with the camera's attitude at a running time. Fields:
 * doubles "roll" and "pitch" (radians; positive pitch = the camera looks down, positive roll = its right
 * side is down), optional doubles "yaw" and "height" (metres), uint64 "running-time" (nanoseconds). */
#define GST_TERRAIN_SEG_POSE_EVENT "terrainseg-pose"
/** Name of the element message that is posted with post-messages=true at each change and once a second. */
#define GST_TERRAIN_SEG_MESSAGE "terrainseg"

/** Name of the element message about a rectangle that the user drew with navigation=true. */
#define GST_TERRAIN_SEG_REGION_MESSAGE "terrainseg-region"

/** Version of a meta. Incremented when the meaning of a field changes, not when a field is added. */
#define GST_TERRAIN_SEG_META_VERSION 1
#define GST_TERRAIN_METRIC_META_VERSION 1

/** Bits of gst_terrain_seg_meta_get_flags(). */
typedef enum {
  GST_TERRAIN_SEG_FLAG_LEARNED = 1, /* this frame's training window was learned */
  GST_TERRAIN_SEG_FLAG_FROZEN = 2,  /* not learned: learning or near-clear is false, or the frame is GAP,
                                       CORRUPTED or backwards in time */
  GST_TERRAIN_SEG_FLAG_STARVED =
      4, /* not learned: too few usable window pixels, an obstacle in the window, or a blank frame */
  GST_TERRAIN_SEG_FLAG_UNKNOWN = 8,       /* no terrain is known, the mask is 128 everywhere */
  GST_TERRAIN_SEG_FLAG_HORIZON_HELD = 16, /* the horizon row is that of an earlier frame */
  GST_TERRAIN_SEG_FLAG_BLOCKED = 32, /* too little free space ahead of the window, or no terrain is known */
  GST_TERRAIN_SEG_FLAG_WINDOW_STILL = 64 /* the picture above the training window changes, the window does
                                            not: it shows the vehicle, or a still picture */
} GstTerrainSegFlags;

/** Bits of gst_terrain_metric_meta_get_flags(). */
typedef enum {
  GST_TERRAIN_METRIC_FLAG_POSE = 1,   /* attitude from terrainseg-pose events; otherwise from the mount */
  GST_TERRAIN_METRIC_FLAG_HORIZON = 2 /* the horizon in the picture disagrees with that attitude */
} GstTerrainMetricFlags;

/** Values of a mask pixel. */
enum {
  GST_TERRAIN_SEG_NOT_TRAVERSABLE = 0,
  GST_TERRAIN_SEG_DOUBTFUL = 128, /* doubtful, ignored or unknown */
  GST_TERRAIN_SEG_TRAVERSABLE = 255
};

/** Returns the structure of the meta @name on @buffer, or NULL when the buffer has no such meta. */
static inline const GstStructure* gst_terrain_meta_get_named_structure(GstBuffer* buffer, const gchar* name) {
  GstCustomMeta* meta;

  if (gst_meta_get_info(name) == NULL)
    return NULL; /* the plugin is not loaded; gst_buffer_get_custom_meta() would log a critical */
  meta = gst_buffer_get_custom_meta(buffer, name);
  return meta ? gst_custom_meta_get_structure(meta) : NULL;
}

/** Returns the name of the filter that attached the meta (its property "instance"), or NULL for a filter
 * without a name. */
static inline const gchar* gst_terrain_seg_meta_get_instance(const GstStructure* meta) {
  return gst_structure_get_string(meta, "instance");
}

/** Returns the structure of the meta @name on @buffer that the filter @instance attached ("" = a filter
 * without a name). With NULL, returns the last such meta of any filter. Returns NULL when the buffer has
 * no such meta. */
static inline const GstStructure* gst_terrain_meta_get_structure_of(GstBuffer* buffer, const gchar* name,
                                                                    const gchar* instance) {
  const GstMetaInfo* info = gst_meta_get_info(name);
  const GstStructure *found = NULL, *next;
  const gchar* its;
  gpointer state = NULL;
  GstMeta* meta;

  if (info == NULL)
    return NULL; /* the plugin is not loaded */
  while ((meta = gst_buffer_iterate_meta_filtered(buffer, &state, info->api)) != NULL) {
    next = gst_custom_meta_get_structure((GstCustomMeta*)meta);
    its = gst_terrain_seg_meta_get_instance(next);
    if (instance == NULL || g_strcmp0(its ? its : "", instance) == 0)
      found = next;
  }
  return found;
}

/** Returns the structure with all fields of the estimate for @buffer that the filter @instance attached
 * ("" = a filter without a name). With NULL, returns the last estimate of any filter. Returns NULL when
 * the buffer has no such estimate. */
static inline const GstStructure* gst_buffer_get_terrain_seg_structure_of(GstBuffer* buffer,
                                                                          const gchar* instance) {
  return gst_terrain_meta_get_structure_of(buffer, GST_TERRAIN_SEG_META_NAME, instance);
}

/** Returns the structure with all fields of the estimate for @buffer, the last one when there are several,
 * or NULL when the buffer has no estimate. */
static inline const GstStructure* gst_buffer_get_terrain_seg_structure(GstBuffer* buffer) {
  return gst_buffer_get_terrain_seg_structure_of(buffer, NULL);
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

/** Value of GST_TERRAIN_SEG_META_VERSION in the program that wrote the meta. */
static inline guint gst_terrain_seg_meta_get_version(const GstStructure* meta) {
  return gst_terrain_seg_meta_get_uint_(meta, "version", 0);
}

/** Number of the frame since the start of the element, from 0. */
static inline guint64 gst_terrain_seg_meta_get_frame(const GstStructure* meta) {
  guint64 value;

  return gst_structure_get_uint64(meta, "frame", &value) ? value : 0;
}

/** Size in pixels of the frame to which rows and rectangles refer. */
static inline gint gst_terrain_seg_meta_get_frame_width(const GstStructure* meta) {
  return gst_terrain_seg_meta_get_int_(meta, "frame-width", 0);
}

static inline gint gst_terrain_seg_meta_get_frame_height(const GstStructure* meta) {
  return gst_terrain_seg_meta_get_int_(meta, "frame-height", 0);
}

/** Row of the horizon in pixels, 0 at the top; -1 = not found. */
static inline gint gst_terrain_seg_meta_get_horizon_row(const GstStructure* meta) {
  return gst_terrain_seg_meta_get_int_(meta, "horizon-row", -1);
}

/** Row of the ground's vanishing line in pixels: from the property, a pose, or motion; -1 = unknown or
 * outside the frame. */
static inline gdouble gst_terrain_seg_meta_get_vanishing_row(const GstStructure* meta) {
  gdouble row = -1;
  return gst_structure_get_double(meta, "vanishing-row", &row) ? row : -1;
}

/** Forward speed in camera heights per second; 0 = standing still or unknown. */
static inline gdouble gst_terrain_seg_meta_get_speed_over_height(const GstStructure* meta) {
  gdouble speed = 0;
  return gst_structure_get_double(meta, "speed-over-height", &speed) ? speed : 0;
}

/** Confidence of the horizon row, 0 (not found) to 255. */
static inline guint gst_terrain_seg_meta_get_horizon_confidence(const GstStructure* meta) {
  return gst_terrain_seg_meta_get_uint_(meta, "horizon-confidence", 0);
}

/** Confidence of the mask, 0 to 255. */
static inline guint gst_terrain_seg_meta_get_confidence(const GstStructure* meta) {
  return gst_terrain_seg_meta_get_uint_(meta, "confidence", 0);
}

/** The mask: GRAY8, read only. Its GstVideoMeta has the size and stride; map it with gst_video_frame_map()
 * or gst_video_meta_map(). NULL for a meta without a mask. */
static inline GstBuffer* gst_terrain_seg_meta_get_mask(const GstStructure* meta) {
  return gst_terrain_seg_meta_get_buffer_(meta, "mask");
}

/** Confidence of the mask's labels: GRAY8 like the mask, one byte per cell of the grid, stretched over the
 * mask's region, read only. The value is 255 * (2 p - 1), where p is the expected share of correct
 * labels. NULL for preset=paper and for an estimate that was received as KLV. */
static inline GstBuffer* gst_terrain_seg_meta_get_confidence_map(const GstStructure* meta) {
  return gst_terrain_seg_meta_get_buffer_(meta, "confidence-map");
}

/** The part of the frame that the mask covers, in pixels of the frame. */
static inline void gst_terrain_seg_meta_get_mask_region(const GstStructure* meta, GstVideoRectangle* region) {
  region->x = gst_terrain_seg_meta_get_int_(meta, "mask-x", 0);
  region->y = gst_terrain_seg_meta_get_int_(meta, "mask-y", 0);
  region->w = gst_terrain_seg_meta_get_int_(meta, "mask-w", 0);
  region->h = gst_terrain_seg_meta_get_int_(meta, "mask-h", 0);
}

/** The boundary: one uint16, little-endian, per mask column. It is the highest row of the frame that
 * belongs to free space connected to the training window; the frame's height = no free space. */
static inline GstBuffer* gst_terrain_seg_meta_get_boundary(const GstStructure* meta) {
  return gst_terrain_seg_meta_get_buffer_(meta, "boundary");
}

/** Share of traversable mask pixels, 0..1000. */
static inline guint gst_terrain_seg_meta_get_traversable_permille(const GstStructure* meta) {
  return gst_terrain_seg_meta_get_uint_(meta, "traversable-permille", 0);
}

/** The training window, in pixels of the frame. */
static inline void gst_terrain_seg_meta_get_window(const GstStructure* meta, GstVideoRectangle* window) {
  window->x = gst_terrain_seg_meta_get_int_(meta, "window-x", 0);
  window->y = gst_terrain_seg_meta_get_int_(meta, "window-y", 0);
  window->w = gst_terrain_seg_meta_get_int_(meta, "window-w", 0);
  window->h = gst_terrain_seg_meta_get_int_(meta, "window-h", 0);
}

/** Incremented at each change of the learned models. */
static inline guint gst_terrain_seg_meta_get_model_generation(const GstStructure* meta) {
  return gst_terrain_seg_meta_get_uint_(meta, "model-generation", 0);
}

/** Bits of GstTerrainSegFlags. */
static inline guint gst_terrain_seg_meta_get_flags(const GstStructure* meta) {
  return gst_terrain_seg_meta_get_uint_(meta, "flags", GST_TERRAIN_SEG_FLAG_UNKNOWN);
}

/** Number of learned models. */
static inline guint gst_terrain_seg_meta_get_model_count(const GstStructure* meta) {
  const GValue* list = gst_structure_get_value(meta, "models");

  return list && GST_VALUE_HOLDS_LIST(list) ? gst_value_list_get_size(list) : 0;
}

/** Returns the learned model @index: a structure with "mean" and "variance" (arrays of three doubles,
 * 8-bit units of the colour space in which it was learned), "mass" (uint64, samples) and "rgb" (uint, the
 * mean as 0xRRGGBB). Returns NULL for an invalid index. */
static inline const GstStructure* gst_terrain_seg_meta_get_model(const GstStructure* meta, guint index) {
  const GValue *list = gst_structure_get_value(meta, "models"), *value;

  if (list == NULL || !GST_VALUE_HOLDS_LIST(list) || index >= gst_value_list_get_size(list))
    return NULL;
  value = gst_value_list_get_value(list, index);
  return GST_VALUE_HOLDS_STRUCTURE(value) ? gst_value_get_structure(value) : NULL;
}

/** Returns the structure with the ranges of @buffer's boundary in metres that the filter @instance
 * attached ("" = a filter without a name). With NULL, returns the last one of any filter. Returns NULL
 * when the buffer has none, as for an uncalibrated camera or an unknown attitude. */
static inline const GstStructure* gst_buffer_get_terrain_metric_structure(GstBuffer* buffer,
                                                                          const gchar* instance) {
  return gst_terrain_meta_get_structure_of(buffer, GST_TERRAIN_METRIC_META_NAME, instance);
}

/** Value of GST_TERRAIN_METRIC_META_VERSION in the program that wrote the meta. */
static inline guint gst_terrain_metric_meta_get_version(const GstStructure* meta) {
  return gst_terrain_seg_meta_get_uint_(meta, "version", 0);
}

/** Ranges: one float, little-endian, per mask column. It is the distance over the ground in metres from
 * the body's origin to the end of the free space; +infinity = free up to range-max, NaN = unknown. */
static inline GstBuffer* gst_terrain_metric_meta_get_ranges(const GstStructure* meta) {
  return gst_terrain_seg_meta_get_buffer_(meta, "ranges");
}

/** Bearings of the columns, in the layout of the ranges: radians counter-clockwise from straight ahead;
 * NaN = unknown. */
static inline GstBuffer* gst_terrain_metric_meta_get_bearings(const GstStructure* meta) {
  return gst_terrain_seg_meta_get_buffer_(meta, "bearings");
}

/** The ranges minus one standard deviation, in metres. */
static inline GstBuffer* gst_terrain_metric_meta_get_low(const GstStructure* meta) {
  return gst_terrain_seg_meta_get_buffer_(meta, "low");
}

/** The ranges plus one standard deviation, in metres. */
static inline GstBuffer* gst_terrain_metric_meta_get_high(const GstStructure* meta) {
  return gst_terrain_seg_meta_get_buffer_(meta, "high");
}

/** Tick marks straight ahead of the body. Three floats, little-endian, per mark: the range in metres, and
 * the position of that ground in the picture as fractions of the frame's width (from the left) and height
 * (from the top). NULL when there are none. */
static inline GstBuffer* gst_terrain_metric_meta_get_ticks(const GstStructure* meta) {
  return gst_terrain_seg_meta_get_buffer_(meta, "ticks");
}

/** Returns element @column of one of the buffers above, or NAN when it does not exist. */
static inline gfloat gst_terrain_metric_meta_get_value(GstBuffer* values, guint column) {
  gfloat value;

  if (values == NULL || gst_buffer_extract(values, (gsize)column * 4, &value, 4) != 4)
    return NAN;
  return GFLOAT_FROM_LE(value);
}

static inline gdouble gst_terrain_metric_meta_get_double_(const GstStructure* meta, const gchar* field) {
  gdouble value;

  return gst_structure_get_double(meta, field, &value) ? value : NAN;
}

/** Height of the camera above the ground in metres. This and the following accessors return NAN when the
 * field is missing or has the wrong type. */
static inline gdouble gst_terrain_metric_meta_get_height(const GstStructure* meta) {
  return gst_terrain_metric_meta_get_double_(meta, "height");
}

/** Pitch in radians, positive = the camera looks down. */
static inline gdouble gst_terrain_metric_meta_get_pitch(const GstStructure* meta) {
  return gst_terrain_metric_meta_get_double_(meta, "pitch");
}

/** Roll in radians, positive = the camera's right side is down. */
static inline gdouble gst_terrain_metric_meta_get_roll(const GstStructure* meta) {
  return gst_terrain_metric_meta_get_double_(meta, "roll");
}

/** Yaw in radians, positive = the camera looks to the left. */
static inline gdouble gst_terrain_metric_meta_get_yaw(const GstStructure* meta) {
  return gst_terrain_metric_meta_get_double_(meta, "yaw");
}

/** Largest range in metres; a column that is free up to it has the range +infinity. */
static inline gdouble gst_terrain_metric_meta_get_range_max(const GstStructure* meta) {
  return gst_terrain_metric_meta_get_double_(meta, "range-max");
}

/** Range in metres of the nearest ground that the mask shows. A column without free space ends there or
 * farther away. */
static inline gdouble gst_terrain_metric_meta_get_range_min(const GstStructure* meta) {
  return gst_terrain_metric_meta_get_double_(meta, "range-min");
}

/** Number of beams in a laser scan made of these ranges, or 0 when the meta has no scan geometry. The
 * geometry is the same for every frame of a stream. */
static inline guint gst_terrain_metric_meta_get_fan_beams(const GstStructure* meta) {
  return gst_terrain_seg_meta_get_uint_(meta, "fan-beams", 0);
}

/** Direction of the first (rightmost) beam, in radians counter-clockwise from straight ahead. */
static inline gdouble gst_terrain_metric_meta_get_fan_angle_min(const GstStructure* meta) {
  return gst_terrain_metric_meta_get_double_(meta, "fan-angle-min");
}

/** Angle between neighbouring beams, in radians counter-clockwise. */
static inline gdouble gst_terrain_metric_meta_get_fan_increment(const GstStructure* meta) {
  return gst_terrain_metric_meta_get_double_(meta, "fan-increment");
}

/** Shortest range of a beam, in metres. */
static inline gdouble gst_terrain_metric_meta_get_fan_range_min(const GstStructure* meta) {
  return gst_terrain_metric_meta_get_double_(meta, "fan-range-min");
}

/** Bits of GstTerrainMetricFlags. */
static inline guint gst_terrain_metric_meta_get_flags(const GstStructure* meta) {
  return gst_terrain_seg_meta_get_uint_(meta, "flags", 0);
}

static inline GstClockTime gst_buffer_get_terrain_reference_(GstBuffer* buffer, const gchar* reference) {
  GstCaps* caps = gst_caps_new_empty_simple(reference);
  const GstReferenceTimestampMeta* meta = gst_buffer_get_reference_timestamp_meta(buffer, caps);

  gst_caps_unref(caps);
  return meta ? meta->timestamp : GST_CLOCK_TIME_NONE;
}

/** Capture time of @buffer in nanoseconds since 1970, from its GstReferenceTimestampMeta with
 * timestamp/x-unix or timestamp/x-ntp. GST_CLOCK_TIME_NONE when it is unknown. */
static inline GstClockTime gst_buffer_get_terrain_utc(GstBuffer* buffer) {
  const GstClockTime from_1900_to_1970 = G_GUINT64_CONSTANT(2208988800) * GST_SECOND;
  GstClockTime time = gst_buffer_get_terrain_reference_(buffer, "timestamp/x-unix");

  if (GST_CLOCK_TIME_IS_VALID(time))
    return time;
  time = gst_buffer_get_terrain_reference_(buffer, "timestamp/x-ntp");
  return GST_CLOCK_TIME_IS_VALID(time) && time >= from_1900_to_1970 ? time - from_1900_to_1970
                                                                    : GST_CLOCK_TIME_NONE;
}

G_END_DECLS

#endif /* GST_TERRAINSEG_META_H */
