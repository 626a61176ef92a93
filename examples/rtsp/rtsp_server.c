/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* A rover as an RTSP server: stream 0 is H.264, stream 1 one KLV unit per frame. Any player shows the video;
 * terraincombine puts the two together again (see docs/tasks/streaming.md).
 *
 * cc rtsp_server.c -o rtsp_server $(pkg-config --cflags --libs gstreamer-rtsp-server-1.0)
 * ./rtsp_server [--port 8554] [--annotated] [--source 'v4l2src ! decodebin']
 * gst-play-1.0 rtsp://ROVER:8554/rover
 */
#include <gst/rtsp-server/rtsp-server.h>
#include <signal.h>

#include <glib-unix.h>

typedef struct {
  GMainLoop* loop;
  gint frames, units; /* atomic: what went out since the media was prepared */
} Server;

static GstPadProbeReturn count(GstPad* pad, GstPadProbeInfo* info, gpointer counter) {
  (void)pad;
  (void)info;
  g_atomic_int_inc((gint*)counter);
  return GST_PAD_PROBE_OK;
}

/* The end of a stream becomes an RTCP goodbye, on another UDP port than the packets: on a busy receiver it
 * overtakes the last frame, which is thrown away then. */
#define LINGER_US 300000

static GstPadProbeReturn linger(GstPad* pad, GstPadProbeInfo* info, gpointer data) {
  (void)pad;
  (void)data;
  if (GST_EVENT_TYPE(GST_PAD_PROBE_INFO_EVENT(info)) == GST_EVENT_EOS)
    g_usleep(LINGER_US);
  return GST_PAD_PROBE_OK;
}

static void watch(GstElement* media, const gchar* payloader, gint* counter) {
  GstElement* element = gst_bin_get_by_name(GST_BIN(media), payloader);
  GstPad* in = gst_element_get_static_pad(element, "sink");
  GstPad* out = gst_element_get_static_pad(element, "src");

  gst_pad_add_probe(in, GST_PAD_PROBE_TYPE_BUFFER, count, counter, NULL);
  gst_pad_add_probe(out, GST_PAD_PROBE_TYPE_EVENT_DOWNSTREAM, linger, NULL, NULL);
  gst_object_unref(in);
  gst_object_unref(out);
  gst_object_unref(element);
}

static void on_unprepared(GstRTSPMedia* media, gpointer data) {
  Server* server = data;

  (void)media;
  g_print("media closed: %d frames and %d units went out\n", g_atomic_int_get(&server->frames),
          g_atomic_int_get(&server->units));
}

static void on_media(GstRTSPMediaFactory* factory, GstRTSPMedia* media, gpointer data) {
  Server* server = data;
  GstElement* element = gst_rtsp_media_get_element(media);

  (void)factory;
  g_atomic_int_set(&server->frames, 0);
  g_atomic_int_set(&server->units, 0);
  watch(element, "pay0", &server->frames);
  watch(element, "pay1", &server->units);
  g_signal_connect(media, "unprepared", G_CALLBACK(on_unprepared), server);
  gst_object_unref(element);
}

static gboolean on_interrupt(gpointer data) {
  g_main_loop_quit(((Server*)data)->loop);
  return G_SOURCE_REMOVE;
}

int main(int argc, char** argv) {
  Server server = {0};
  gint port = 8554;
  gchar *source = NULL, *settings = NULL, *launch, *service;
  gboolean annotated = FALSE;
  GError* error = NULL;
  GOptionEntry entries[] = {
      {"port", 0, 0, G_OPTION_ARG_INT, &port, "TCP port (8554)", "PORT"},
      {"source", 0, 0, G_OPTION_ARG_STRING, &source, "Piece of a pipeline that gives raw video (a camera)",
       "TEXT"},
      {"settings", 0, 0, G_OPTION_ARG_STRING, &settings, "Properties of terrainseg", "TEXT"},
      {"annotated", 0, 0, G_OPTION_ARG_NONE, &annotated, "Draw the traversable ground on the video", NULL},
      {NULL, 0, 0, 0, NULL, NULL, NULL}};
  GOptionContext* context = g_option_context_new("- the rover as an RTSP server");
  GstRTSPServer* rtsp;
  GstRTSPMediaFactory* factory;
  GstRTSPMountPoints* mounts;

  g_option_context_add_main_entries(context, entries, NULL);
  g_option_context_add_group(context, gst_init_get_option_group());
  if (!g_option_context_parse(context, &argc, &argv, &error)) {
    g_printerr("rtsp_server: %s\n", error->message);
    return 2;
  }
  g_option_context_free(context);

  /* The leaky queue stands before terrainseg: behind it video and metadata stay together. */
  launch = g_strdup_printf(
      "( %s ! videoconvert ! video/x-raw,format=I420 ! queue leaky=downstream max-size-buffers=2 ! "
      "terrainseg %s "
      "! tee name=t  t. ! queue ! %s x264enc tune=zerolatency speed-preset=veryfast bitrate=4000 "
      "key-int-max=30 "
      "! rtph264pay name=pay0 pt=96 config-interval=-1  t. ! queue ! terrainextract ! meta/x-klv,parsed=true "
      "! rtpklvpay name=pay1 pt=97 )",
      source ? source : "v4l2src ! decodebin", settings ? settings : "",
      annotated ? "terrainoverlay ! videoconvert ! video/x-raw,format=I420 !" : "");

  rtsp = gst_rtsp_server_new();
  service = g_strdup_printf("%d", port);
  gst_rtsp_server_set_service(rtsp, service);
  factory = gst_rtsp_media_factory_new();
  gst_rtsp_media_factory_set_launch(factory, launch);
  gst_rtsp_media_factory_set_shared(factory, TRUE); /* one camera, many viewers */
  g_signal_connect(factory, "media-configure", G_CALLBACK(on_media), &server);
  mounts = gst_rtsp_server_get_mount_points(rtsp);
  gst_rtsp_mount_points_add_factory(mounts, "/rover", factory);
  g_object_unref(mounts);

  server.loop = g_main_loop_new(NULL, FALSE);
  if (gst_rtsp_server_attach(rtsp, NULL) == 0) {
    g_printerr("rtsp_server: port %d is in use\n", port);
    return 1;
  }
  g_unix_signal_add(SIGINT, on_interrupt, &server);
  g_unix_signal_add(SIGTERM, on_interrupt, &server);
  g_print("rtsp://127.0.0.1:%d/rover\n", port);
  g_main_loop_run(server.loop);

  g_main_loop_unref(server.loop);
  g_object_unref(rtsp);
  g_free(service);
  g_free(launch);
  g_free(source);
  g_free(settings);
  return 0;
}
