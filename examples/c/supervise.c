/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* A range sensor says what the ground is, terrainseg learns what it looks like: the training pixels come from
 * a depth image per picture instead of the window in front of the rover.
 *
 * cc supervise.c -o supervise $(pkg-config --cflags --libs gstreamer-terrainseg-1.0 gstreamer-app-1.0) -lm
 * ./supervise 'frames/%04d.jpg' 'depth/%04d.png' terrain.jsonl [PROPERTY=VALUE...]
 *
 * Pictures are JPEG or PNG; depth is 16-bit PNG of the same size in millimetres, 0 = no answer. The floor's
 * depth is a * exp (b * height above the bottom edge), fitted in every frame to the columns in front of the
 * rover: that is where the rover stands and nothing else can be. Pixels within 8 % of it and nearer than 2.5
 * m train. Copy attach_training() into a program with a better sensor.
 */
#include <gst/app/gstappsink.h>
#include <gst/gst.h>
#include <gst/terrainseg/terrainsegmeta.h>
#include <gst/video/video.h>
#include <math.h>
#include <string.h>

#define TOLERANCE 0.08
#define NEAR_METRES 2.5
#define START_ROWS 0.15 /* of the height: where the fit begins */
#define FIT_ROWS 0.5    /* of the height: where it may end */

typedef struct {
  GstAppSink* depth;
  guint64 frames, supervised, pixels;
} Supervisor;

/* Millimetres at a pixel; PNG keeps 16 bits big-endian. */
static guint depth_at(const GstVideoFrame* depth, gint x, gint y) {
  const guint8* row =
      (const guint8*)GST_VIDEO_FRAME_PLANE_DATA(depth, 0) + (gsize)y * GST_VIDEO_FRAME_PLANE_STRIDE(depth, 0);
  return GST_READ_UINT16_BE(row + 2 * x);
}

/* Least squares of log depth over the middle columns of the rows below @height, a fraction of the frame's.
 * With a fit in hand (b or a not 0) only pixels near it count. */
static gboolean fit(const GstVideoFrame* depth, gdouble height, gdouble* a, gdouble* b) {
  const gint width = GST_VIDEO_FRAME_WIDTH(depth), rows = GST_VIDEO_FRAME_HEIGHT(depth);
  const gboolean known = *a > 0;
  gdouble n = 0, sx = 0, sy = 0, sxx = 0, sxy = 0;

  for (gint y = (gint)(rows * (1 - height)); y < rows; y++) {
    const gdouble above = (rows - 0.5 - y) / rows;
    for (gint x = width * 3 / 8; x < width * 5 / 8; x++) {
      const gdouble metres = depth_at(depth, x, y) / 1000.0;
      if (metres <= 0 || (known && fabs(metres / (*a * exp(*b * above)) - 1) > TOLERANCE))
        continue;
      n += 1;
      sx += above;
      sy += log(metres);
      sxx += above * above;
      sxy += above * log(metres);
    }
  }
  if (n < 64 || n * sxx - sx * sx < 1e-9)
    return FALSE;
  *b = (n * sxy - sx * sy) / (n * sxx - sx * sx);
  *a = exp((sy - *b * sx) / n);
  return TRUE;
}

/* The training pixels of a depth image as a GRAY8 buffer, NULL when no floor is in it. */
static GstBuffer* floor_mask(const GstVideoFrame* depth, guint64* count) {
  const gint width = GST_VIDEO_FRAME_WIDTH(depth), rows = GST_VIDEO_FRAME_HEIGHT(depth);
  gdouble a = 0, b = 0;
  GstBuffer* mask;
  GstMapInfo map;

  if (!fit(depth, START_ROWS, &a, &b))
    return NULL;
  for (int i = 0; i < 5; i++)
    fit(depth, FIT_ROWS, &a, &b);
  mask = gst_buffer_new_allocate(NULL, (gsize)width * rows, NULL);
  gst_buffer_map(mask, &map, GST_MAP_WRITE);
  for (gint y = 0; y < rows; y++) {
    const gdouble expected = a * exp(b * (rows - 0.5 - y) / rows);
    for (gint x = 0; x < width; x++) {
      const gdouble metres = depth_at(depth, x, y) / 1000.0;
      const gboolean floor = fabs(metres - expected) <= TOLERANCE * expected && metres < NEAR_METRES;
      map.data[(gsize)y * width + x] = floor ? 255 : 0;
      *count += floor;
    }
  }
  gst_buffer_unmap(mask, &map);
  gst_buffer_add_video_meta(mask, GST_VIDEO_FRAME_FLAG_NONE, GST_VIDEO_FORMAT_GRAY8, width, rows);
  return mask;
}

/* What terrainseg reads from a buffer: a custom meta with the mask. Any size will do, it is stretched. */
static void attach_training(GstBuffer* picture, GstBuffer* mask) {
  GstCustomMeta* meta = gst_buffer_add_custom_meta(picture, GST_TERRAIN_TRAINING_META_NAME);

  gst_structure_set(gst_custom_meta_get_structure(meta), "mask", GST_TYPE_BUFFER, mask, NULL);
}

static GstPadProbeReturn supervise(GstPad* pad, GstPadProbeInfo* info, gpointer data) {
  Supervisor* self = data;
  GstSample* sample = gst_app_sink_pull_sample(self->depth);
  GstBuffer* mask = NULL;
  GstVideoInfo layout;
  GstVideoFrame depth;

  (void)pad;
  self->frames++;
  if (sample == NULL)
    return GST_PAD_PROBE_OK; /* the depth ended before the pictures: the window trains again */
  if (gst_video_info_from_caps(&layout, gst_sample_get_caps(sample)) &&
      gst_video_frame_map(&depth, &layout, gst_sample_get_buffer(sample), GST_MAP_READ)) {
    mask = floor_mask(&depth, &self->pixels);
    gst_video_frame_unmap(&depth);
  }
  if (mask != NULL) {
    info->data = gst_buffer_make_writable(GST_PAD_PROBE_INFO_BUFFER(info));
    attach_training(info->data, mask);
    gst_buffer_unref(mask);
    self->supervised++;
  }
  gst_sample_unref(sample);
  return GST_PAD_PROBE_OK;
}

/* Plays to the end; FALSE, with a reason on stderr, when that failed. */
static gboolean play(GstElement* pipeline) {
  GstBus* bus = gst_element_get_bus(pipeline);
  GstMessage* message;
  gboolean well;

  gst_element_set_state(pipeline, GST_STATE_PLAYING);
  message = gst_bus_timed_pop_filtered(bus, GST_CLOCK_TIME_NONE, GST_MESSAGE_EOS | GST_MESSAGE_ERROR);
  well = GST_MESSAGE_TYPE(message) == GST_MESSAGE_EOS;
  if (!well) {
    GError* error = NULL;
    gst_message_parse_error(message, &error, NULL);
    g_printerr("supervise: %s\n", error->message);
    g_error_free(error);
  }
  gst_message_unref(message);
  gst_element_set_state(pipeline, GST_STATE_NULL);
  gst_object_unref(bus);
  return well;
}

int main(int argc, char** argv) {
  GError* error = NULL;
  GString* text = g_string_new(NULL);
  GstElement *pipeline, *entry, *depth;
  GstPad* pad;
  Supervisor self = {0};
  gboolean well;

  gst_init(&argc, &argv);
  if (argc < 4) {
    g_printerr("usage: supervise 'frames/%%04d.jpg' 'depth/%%04d.png' OUTPUT.jsonl [PROPERTY=VALUE...]\n");
    return 2;
  }
  g_string_printf(text,
                  "multifilesrc location=\"%s\" caps=%s ! %s ! videoconvert ! video/x-raw,format=I420 ! "
                  "identity name=entry "
                  "! terrainseg name=terrain",
                  argv[1],
                  g_str_has_suffix(argv[1], ".png") ? "image/png,framerate=5/1" : "image/jpeg,framerate=5/1",
                  g_str_has_suffix(argv[1], ".png") ? "pngdec" : "jpegdec");
  for (int i = 4; i < argc; i++)
    g_string_append_printf(text, " %s", argv[i]);
  g_string_append_printf(
      text,
      " ! terrainextract json-mask=true ! application/x-ndjson ! filesink async=false location=\"%s\" "
      "multifilesrc location=\"%s\" caps=image/png,framerate=5/1 ! pngdec "
      "! video/x-raw,format=GRAY16_BE ! appsink name=depth sync=false max-buffers=2",
      argv[3], argv[2]);
  pipeline = gst_parse_launch(text->str, &error);
  g_string_free(text, TRUE);
  if (error != NULL) {
    g_printerr("supervise: %s\n", error->message);
    return 1;
  }
  entry = gst_bin_get_by_name(GST_BIN(pipeline), "entry");
  depth = gst_bin_get_by_name(GST_BIN(pipeline), "depth");
  self.depth = GST_APP_SINK(depth);
  pad = gst_element_get_static_pad(entry, "src");
  gst_pad_add_probe(pad, GST_PAD_PROBE_TYPE_BUFFER, supervise, &self, NULL);
  well = play(pipeline);
  g_print("%" G_GUINT64_FORMAT " %s, %" G_GUINT64_FORMAT " of them supervised, %" G_GUINT64_FORMAT
          " training pixels each\n",
          self.frames, self.frames == 1 ? "frame" : "frames", self.supervised,
          self.supervised ? self.pixels / self.supervised : 0);
  gst_object_unref(pad);
  gst_object_unref(entry);
  gst_object_unref(depth);
  gst_object_unref(pipeline);
  return well ? 0 : 1;
}
