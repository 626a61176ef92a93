/* SPDX-License-Identifier: LGPL-2.1-or-later */
/**
 * The metadata that the plugin `terrainseg` attaches to video buffers, for programs in C.
 *
 * Everything lies in the GstStructure of a custom meta, so nothing has to be linked but GStreamer itself:
 * these are inline accessors. The plugin registers the meta when it is loaded (any of its elements was made,
 * or gst_plugin_load_by_name ("terrainseg")); before that there can be no such meta and the accessors say so.
 *
 * Lifetime: what an accessor returns belongs to the buffer that carries the meta. Take a reference of a mask,
 * boundary or confidence map that has to outlive it.
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
#define GST_TERRAIN_TRUTH_META_NAME "GstTerrainTruthMeta"
/** Type of a GstVideoRegionOfInterestMeta whose pixels are trained on. */
#define GST_TERRAIN_TRAINING_ROI "terrain-training"
/** Name of the custom event, upstream or downstream, with the boolean field "clear". */
#define GST_TERRAIN_SEG_NEAR_EVENT "terrainseg-near"
/** Name of the custom event, upstream or downstream, with the camera's attitude at a running time: doubles
 * "roll" and "pitch" (radians, positive pitch = the camera looks down, positive roll = its right side is
 * down), optional doubles "yaw" and "height" (metres), uint64 "running-time" (nanoseconds). */
#define GST_TERRAIN_SEG_POSE_EVENT "terrainseg-pose"
/** Name of the element message that post-messages=true sends on change, and once a second. */
#define GST_TERRAIN_SEG_MESSAGE "terrainseg"

/** Name of the element message about a rectangle that was drawn with navigation=true. */
#define GST_TERRAIN_SEG_REGION_MESSAGE "terrainseg-region"

/** Raised when a field changes its meaning; fields may be added without it. */
#define GST_TERRAIN_SEG_META_VERSION 1
#define GST_TERRAIN_METRIC_META_VERSION 1

/** Bits of gst_terrain_seg_meta_get_flags(). */
typedef enum {
  GST_TERRAIN_SEG_FLAG_LEARNED = 1, /* this frame's window was learned */
  GST_TERRAIN_SEG_FLAG_FROZEN =
      2, /* not learned: learning or near-clear is off, or a GAP, CORRUPTED or backwards frame */
  GST_TERRAIN_SEG_FLAG_STARVED =
      4, /* not learned: too few usable window pixels, something stands in the window, or a blank frame */
  GST_TERRAIN_SEG_FLAG_UNKNOWN = 8,       /* nothing is known, the mask is 128 everywhere */
  GST_TERRAIN_SEG_FLAG_HORIZON_HELD = 16, /* the horizon row is an earlier frame's */
  GST_TERRAIN_SEG_FLAG_BLOCKED = 32       /* too little free space ahead of the window, or unknown */
} GstTerrainSegFlags;

/** Bits of gst_terrain_metric_meta_get_flags(). */
typedef enum {
  GST_TERRAIN_METRIC_FLAG_POSE = 1,   /* the attitude is that of terrainseg-pose events, else the mount's */
  GST_TERRAIN_METRIC_FLAG_HORIZON = 2 /* the picture's horizon is not where that attitude has it */
} GstTerrainMetricFlags;

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

/** Name of the filter that attached the meta (its property "instance"), or NULL when it has none. */
static inline const gchar* gst_terrain_seg_meta_get_instance(const GstStructure* meta) {
  return gst_structure_get_string(meta, "instance");
}

/** The structure of the meta called @name on @buffer that the filter named @instance attached ("": one
 * without a name), or with NULL the last one, by whomever. NULL when there is none. */
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

/** The structure with all fields of the estimate of @buffer's picture that the filter named @instance made
 *  ("": one without a name), or with NULL the last one that was attached, by whomever. NULL when there is
 *  none. */
static inline const GstStructure* gst_buffer_get_terrain_seg_structure_of(GstBuffer* buffer,
                                                                          const gchar* instance) {
  return gst_terrain_meta_get_structure_of(buffer, GST_TERRAIN_SEG_META_NAME, instance);
}

/** The structure with all fields of the estimate of @buffer's picture, the last when there are several, or
 *  NULL when it carries none. */
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

/** Row of the ground's vanishing line: set, from a pose, or found from motion; -1 = unknown, or outside the
 * frame. */
static inline gdouble gst_terrain_seg_meta_get_vanishing_row(const GstStructure* meta) {
  gdouble row = -1;
  return gst_structure_get_double(meta, "vanishing-row", &row) ? row : -1;
}

/** Forward speed in heights of the camera a second; 0 = still or unknown. */
static inline gdouble gst_terrain_seg_meta_get_speed_over_height(const GstStructure* meta) {
  gdouble speed = 0;
  return gst_structure_get_double(meta, "speed-over-height", &speed) ? speed : 0;
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

/** How sure the mask's label is, one byte for each cell of the grid that was thought on, spread over the
 * mask's region: GRAY8 like the mask, 255 * (2 p - 1) where p is the share of right labels to expect. Read
 * only. NULL where there is none: preset=paper, an estimate that came as KLV. */
static inline GstBuffer* gst_terrain_seg_meta_get_confidence_map(const GstStructure* meta) {
  return gst_terrain_seg_meta_get_buffer_(meta, "confidence-map");
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

/** The structure with the metres of @buffer's boundary that the filter named @instance measured ("": one
 * without a name), or with NULL the last one that was attached. NULL when there is none: without a
 * calibration, and while the attitude is not known, there are no metres. */
static inline const GstStructure* gst_buffer_get_terrain_metric_structure(GstBuffer* buffer,
                                                                          const gchar* instance) {
  return gst_terrain_meta_get_structure_of(buffer, GST_TERRAIN_METRIC_META_NAME, instance);
}

/** GST_TERRAIN_METRIC_META_VERSION of the writer. */
static inline guint gst_terrain_metric_meta_get_version(const GstStructure* meta) {
  return gst_terrain_seg_meta_get_uint_(meta, "version", 0);
}

/** One float, little-endian, per mask column: metres over the ground from the body's origin to where the free
 *  space ends; +infinity = free as far as range-max, NaN = unknown. */
static inline GstBuffer* gst_terrain_metric_meta_get_ranges(const GstStructure* meta) {
  return gst_terrain_seg_meta_get_buffer_(meta, "ranges");
}

/** As the ranges: direction of the column, radians counter-clockwise from straight ahead; NaN = unknown. */
static inline GstBuffer* gst_terrain_metric_meta_get_bearings(const GstStructure* meta) {
  return gst_terrain_seg_meta_get_buffer_(meta, "bearings");
}

/** As the ranges, one standard deviation nearer. */
static inline GstBuffer* gst_terrain_metric_meta_get_low(const GstStructure* meta) {
  return gst_terrain_seg_meta_get_buffer_(meta, "low");
}

/** As the ranges, one standard deviation farther. */
static inline GstBuffer* gst_terrain_metric_meta_get_high(const GstStructure* meta) {
  return gst_terrain_seg_meta_get_buffer_(meta, "high");
}

/** Three floats, little-endian, for some ranges straight ahead of the body: metres, and where that ground is
 * seen as shares of the frame's width (from the left) and height (from the top). NULL when there are none. */
static inline GstBuffer* gst_terrain_metric_meta_get_ticks(const GstStructure* meta) {
  return gst_terrain_seg_meta_get_buffer_(meta, "ticks");
}

/** Value @column of one of the buffers above, NAN when there is none. */
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

/** The camera above the ground, metres; NAN in a meta that makes no sense, as for those below. */
static inline gdouble gst_terrain_metric_meta_get_height(const GstStructure* meta) {
  return gst_terrain_metric_meta_get_double_(meta, "height");
}

/** Radians, positive = the camera looks down. */
static inline gdouble gst_terrain_metric_meta_get_pitch(const GstStructure* meta) {
  return gst_terrain_metric_meta_get_double_(meta, "pitch");
}

/** Radians, positive = the camera's right side is down. */
static inline gdouble gst_terrain_metric_meta_get_roll(const GstStructure* meta) {
  return gst_terrain_metric_meta_get_double_(meta, "roll");
}

/** Radians, positive = the camera looks to the left. */
static inline gdouble gst_terrain_metric_meta_get_yaw(const GstStructure* meta) {
  return gst_terrain_metric_meta_get_double_(meta, "yaw");
}

/** Metres up to which ranges are told; beyond, a column is free. */
static inline gdouble gst_terrain_metric_meta_get_range_max(const GstStructure* meta) {
  return gst_terrain_metric_meta_get_double_(meta, "range-max");
}

/** Metres of the nearest ground that the mask shows: a column without free space ends there or farther. */
static inline gdouble gst_terrain_metric_meta_get_range_min(const GstStructure* meta) {
  return gst_terrain_metric_meta_get_double_(meta, "range-min");
}

/** Geometry of scans made of these metres, the same for every frame of a stream. Number of beams; 0 when the
 *  meta states no geometry. */
static inline guint gst_terrain_metric_meta_get_fan_beams(const GstStructure* meta) {
  return gst_terrain_seg_meta_get_uint_(meta, "fan-beams", 0);
}

/** Direction of the first beam, the rightmost, radians counter-clockwise from straight ahead. */
static inline gdouble gst_terrain_metric_meta_get_fan_angle_min(const GstStructure* meta) {
  return gst_terrain_metric_meta_get_double_(meta, "fan-angle-min");
}

/** From one beam to the next, radians counter-clockwise. */
static inline gdouble gst_terrain_metric_meta_get_fan_increment(const GstStructure* meta) {
  return gst_terrain_metric_meta_get_double_(meta, "fan-increment");
}

/** Metres; a beam is not shorter. */
static inline gdouble gst_terrain_metric_meta_get_fan_range_min(const GstStructure* meta) {
  return gst_terrain_metric_meta_get_double_(meta, "fan-range-min");
}

/** GstTerrainMetricFlags. */
static inline guint gst_terrain_metric_meta_get_flags(const GstStructure* meta) {
  return gst_terrain_seg_meta_get_uint_(meta, "flags", 0);
}

static inline GstClockTime gst_buffer_get_terrain_reference_(GstBuffer* buffer, const gchar* reference) {
  GstCaps* caps = gst_caps_new_empty_simple(reference);
  const GstReferenceTimestampMeta* meta = gst_buffer_get_reference_timestamp_meta(buffer, caps);

  gst_caps_unref(caps);
  return meta ? meta->timestamp : GST_CLOCK_TIME_NONE;
}

/** When @buffer was taken, nanoseconds since 1970: what its GstReferenceTimestampMeta says in
 * timestamp/x-unix or timestamp/x-ntp. GST_CLOCK_TIME_NONE when the time of day is not known. */
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
