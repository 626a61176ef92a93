/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Reads the metadata of terrainseg in C: prints, per frame, the horizon, the share that is traversable
 * (counted in the mask), and the free rows ahead in the middle column.
 *
 * cc read_mask.c -o read_mask $(pkg-config --cflags --libs gstreamer-terrainseg-1.0 gstreamer-app-1.0)
 * ./read_mask [VIDEO]          without a video: a rendered scene of 60 frames
 */
#include <gst/app/gstappsink.h>
#include <gst/gst.h>
#include <gst/terrainseg/terrainsegmeta.h>
#include <gst/video/video.h>

/* Pixels of the mask that are traversable, in permille, from the pixels themselves. */
static guint count_traversable(GstBuffer* mask) {
  GstVideoMeta* layout = gst_buffer_get_video_meta(mask);
  GstMapInfo map;
  gpointer data;
  gint stride;
  guint64 free = 0;

  if (layout == NULL || !gst_video_meta_map(layout, 0, &map, &data, &stride, GST_MAP_READ))
    return 0;
  for (guint y = 0; y < layout->height; y++) {
    const guint8* row = (const guint8*)data + (gsize)y * stride;
    for (guint x = 0; x < layout->width; x++)
      free += row[x] == GST_TERRAIN_SEG_TRAVERSABLE;
  }
  gst_video_meta_unmap(layout, 0, &map);
  return (guint)(1000 * free / ((guint64)layout->width * layout->height));
}

/* Rows that are free ahead in the middle of the view, 0 = none. */
static gint free_rows_ahead(const GstStructure* meta) {
  GstBuffer* boundary = gst_terrain_seg_meta_get_boundary(meta);
  GstMapInfo map;
  gint rows = 0;

  if (boundary == NULL || !gst_buffer_map(boundary, &map, GST_MAP_READ))
    return 0;
  if (map.size >= 2)
    rows = gst_terrain_seg_meta_get_frame_height(meta) - GST_READ_UINT16_LE(map.data + map.size / 4 * 2);
  gst_buffer_unmap(boundary, &map);
  return rows;
}

static void print_frame(GstBuffer* buffer) {
  const GstStructure* meta = gst_buffer_get_terrain_seg_structure(buffer);
  GstBuffer* mask;
  guint flags;

  if (meta == NULL) {
    g_print("no metadata\n");
    return;
  }
  mask = gst_terrain_seg_meta_get_mask(meta);
  flags = gst_terrain_seg_meta_get_flags(meta);
  g_print("frame %" G_GUINT64_FORMAT " horizon %d traversable %u counted %u ahead %d%s%s\n",
          gst_terrain_seg_meta_get_frame(meta), gst_terrain_seg_meta_get_horizon_row(meta),
          gst_terrain_seg_meta_get_traversable_permille(meta), mask ? count_traversable(mask) : 0,
          free_rows_ahead(meta), flags & GST_TERRAIN_SEG_FLAG_BLOCKED ? " blocked" : "",
          flags & GST_TERRAIN_SEG_FLAG_UNKNOWN ? " unknown" : "");
}

static GstElement* make_pipeline(const gchar* video) {
  GError* error = NULL;
  GstElement* pipeline;
  const gchar* tail = "terrainseg ! appsink name=out sync=false max-buffers=4";
  gchar* text;

  if (video) {
    gchar* uri = gst_filename_to_uri(video, &error);
    if (uri == NULL) {
      g_printerr("read_mask: %s\n", error->message);
      g_error_free(error);
      return NULL;
    }
    /* Upright and progressive video from every recording. */
    text =
        g_strdup_printf("uridecodebin uri=\"%s\" ! videoconvert ! deinterlace fields=top ! "
                        "identity drop-allocation=true ! videoflip video-direction=auto ! videoconvert ! %s",
                        uri, tail);
    g_free(uri);
  } else {
    text = g_strdup_printf("terrainscenesrc num-buffers=60 ! video/x-raw,width=320,height=180 ! %s", tail);
  }
  pipeline = gst_parse_launch(text, &error);
  g_free(text);
  if (error) {
    g_printerr("read_mask: %s\n", error->message);
    g_clear_error(&error);
    g_clear_pointer(&pipeline, gst_object_unref);
  }
  return pipeline;
}

int main(int argc, char** argv) {
  GstElement *pipeline, *out;
  GstMessage* message = NULL;
  GstBus* bus;
  int result = 0;

  gst_init(&argc, &argv);
  pipeline = make_pipeline(argc > 1 ? argv[1] : NULL);
  if (pipeline == NULL)
    return 1;
  out = gst_bin_get_by_name(GST_BIN(pipeline), "out");
  bus = gst_element_get_bus(pipeline);
  gst_element_set_state(pipeline, GST_STATE_PLAYING);
  while (message == NULL && !gst_app_sink_is_eos(GST_APP_SINK(out))) {
    GstSample* sample = gst_app_sink_try_pull_sample(GST_APP_SINK(out), GST_SECOND / 10);

    if (sample) {
      print_frame(gst_sample_get_buffer(sample));
      gst_sample_unref(sample);
    } else {
      /* an appsink alone would wait for ever when another element fails */
      message = gst_bus_pop_filtered(bus, GST_MESSAGE_ERROR);
    }
  }
  if (message) {
    GError* error;
    gchar* details; /* its last line names the file */

    gst_message_parse_error(message, &error, &details);
    g_printerr("read_mask: %s\n%s\n", error->message, details ? details : "");
    g_error_free(error);
    g_free(details);
    gst_message_unref(message);
    result = 1;
  }
  gst_element_set_state(pipeline, GST_STATE_NULL);
  gst_object_unref(bus);
  gst_object_unref(out);
  gst_object_unref(pipeline);
  return result;
}
