/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* A rover as an RTSP server: stream 0 is H.264, stream 1 one KLV unit per frame. Any player shows the video;
 * terraincombine puts the two together again (see docs/tasks/streaming.md).
 *
 * cc rtsp_server.c -o rtsp_server $(pkg-config --cflags --libs gstreamer-rtsp-server-1.0 gio-2.0)
 * ./rtsp_server [--port 8554] [--annotated] [--source 'v4l2src ! decodebin']      this machine alone
 * RTSP_USER=me RTSP_PASSWORD=... ./rtsp_server --address 0.0.0.0    the network, with a password
 * gst-play-1.0 rtsp://me:PASSWORD@ROVER:8554/rover
 *
 * The password is checked (digest), the pictures are not encrypted: see docs/security.md.
 */
#include <gst/rtsp-server/rtsp-server.h>
#include <signal.h>

#include <gio/gio.h>
#include <glib-unix.h>
#include <locale.h>

typedef struct {
  GMainLoop* loop;
  gint frames, units; /* atomic: what went out since the media was prepared */
  gint failed;        /* atomic: the first error was printed; later errors are its consequences */
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
  const gint frames = g_atomic_int_get(&server->frames), units = g_atomic_int_get(&server->units);

  (void)media;
  g_print("media closed: %d frame%s and %d unit%s went out\n", frames, frames == 1 ? "" : "s", units,
          units == 1 ? "" : "s");
}

/* Prints errors and warnings of the pipeline. A viewer gets only "service unavailable". */
static void print_message(GstMessage* message) {
  GError* error = NULL;
  gchar* details = NULL;

  if (GST_MESSAGE_TYPE(message) == GST_MESSAGE_ERROR)
    gst_message_parse_error(message, &error, &details);
  else if (GST_MESSAGE_TYPE(message) == GST_MESSAGE_WARNING)
    gst_message_parse_warning(message, &error, &details);
  else
    return;
  g_printerr("rtsp_server: %s from %s: %s\n  %s\n", GST_MESSAGE_TYPE_NAME(message),
             message->src ? GST_OBJECT_NAME(message->src) : "an unknown element", error->message,
             details ? details : "");
  g_error_free(error);
  g_free(details);
}

static void on_message(GstBus* bus, GstMessage* message, gpointer data) {
  (void)bus;
  if (GST_MESSAGE_TYPE(message) != GST_MESSAGE_ERROR ||
      g_atomic_int_compare_and_exchange(&((Server*)data)->failed, 0, 1))
    print_message(message);
}

/* Keeps the first warning of GLib: for a value out of range GLib only warns (newer versions: critical) and
 * keeps the default. */
static void on_complaint(const gchar* domain, GLogLevelFlags level, const gchar* text, gpointer data) {
  gchar** first = data;

  (void)domain;
  (void)level;
  if (!*first)
    *first = g_strdup(text);
}

/* Builds the pipeline once and opens the camera, to report errors before the first viewer connects. */
static gboolean can_start(const gchar* launch) {
  GError* error = NULL;
  gchar* complaint = NULL;
  const guint handler = g_log_set_handler(
      "GLib-GObject", (GLogLevelFlags)(G_LOG_LEVEL_WARNING | G_LOG_LEVEL_CRITICAL), on_complaint, &complaint);
  GstElement* media = gst_parse_launch_full(launch, NULL, GST_PARSE_FLAG_FATAL_ERRORS, &error);
  GstElement* pipeline;
  GstMessage* message;
  GstBus* bus;
  gboolean fine;

  g_log_remove_handler("GLib-GObject", handler);
  if (!media || complaint) {
    g_printerr("rtsp_server: the pipeline cannot be built: %s: look at --source and --settings\n"
               "  (gst-inspect-1.0 terrainseg lists its properties and their ranges)\n",
               complaint ? complaint : error->message);
    g_clear_error(&error);
    g_clear_object(&media);
    g_free(complaint);
    return FALSE;
  }
  pipeline = gst_pipeline_new(NULL);
  gst_bin_add(GST_BIN(pipeline), media);
  bus = gst_element_get_bus(pipeline);
  fine = gst_element_set_state(pipeline, GST_STATE_READY) != GST_STATE_CHANGE_FAILURE;
  while ((message = gst_bus_pop(bus))) {
    print_message(message);
    gst_message_unref(message);
  }
  if (!fine)
    g_printerr(
        "rtsp_server: the source cannot be opened: is a camera there, and free (v4l2-ctl --list-devices)?\n"
        "  another one:       --source 'v4l2src device=/dev/video2 ! decodebin'\n"
        "  without a camera:  --source 'terrainscenesrc is-live=true ! video/x-raw,framerate=30/1'\n");
  gst_object_unref(bus);
  gst_element_set_state(pipeline, GST_STATE_NULL);
  gst_object_unref(pipeline);
  return fine;
}

static void on_media(GstRTSPMediaFactory* factory, GstRTSPMedia* media, gpointer data) {
  Server* server = data;
  GstElement* element = gst_rtsp_media_get_element(media);
  GstObject* pipeline = gst_object_get_parent(GST_OBJECT(element));
  GstBus* bus = gst_element_get_bus(GST_ELEMENT(pipeline));

  (void)factory;
  /* Where it does not start the library empties the bus before anybody reads it. */
  gst_bus_enable_sync_message_emission(bus);
  g_signal_connect(bus, "sync-message", G_CALLBACK(on_message), server);
  gst_object_unref(bus);
  gst_object_unref(pipeline);
  g_atomic_int_set(&server->frames, 0);
  g_atomic_int_set(&server->units, 0);
  g_atomic_int_set(&server->failed, 0);
  watch(element, "pay0", &server->frames);
  watch(element, "pay1", &server->units);
  g_signal_connect(media, "unprepared", G_CALLBACK(on_unprepared), server);
  gst_object_unref(element);
}

/* Requires the password to watch the stream. It comes from the environment, because every user of the machine
 * can read the command line. */
static void ask_for_password(GstRTSPServer* rtsp, GstRTSPMediaFactory* factory, const gchar* user,
                             const gchar* password) {
  GstRTSPAuth* auth = gst_rtsp_auth_new();
  GstRTSPToken* token = gst_rtsp_token_new(GST_RTSP_TOKEN_MEDIA_FACTORY_ROLE, G_TYPE_STRING, "viewer", NULL);

  gst_rtsp_auth_set_supported_methods(auth, GST_RTSP_AUTH_DIGEST);
  gst_rtsp_auth_add_digest(auth, user, password, token);
  gst_rtsp_token_unref(token);
  gst_rtsp_media_factory_add_role(factory, "viewer", GST_RTSP_PERM_MEDIA_FACTORY_ACCESS, G_TYPE_BOOLEAN, TRUE,
                                  GST_RTSP_PERM_MEDIA_FACTORY_CONSTRUCT, G_TYPE_BOOLEAN, TRUE, NULL);
  gst_rtsp_server_set_auth(rtsp, auth);
  g_object_unref(auth);
}

static gboolean is_loopback(const gchar* address) {
  GInetAddress* parsed = g_inet_address_new_from_string(address);
  gboolean loopback = parsed ? g_inet_address_get_is_loopback(parsed) : g_str_equal(address, "localhost");

  g_clear_object(&parsed);
  return loopback;
}

static gboolean on_interrupt(gpointer data) {
  g_main_loop_quit(((Server*)data)->loop);
  return G_SOURCE_REMOVE;
}

int main(int argc, char** argv) {
  Server server = {0};
  gint port = 8554;
  gchar *source = NULL, *settings = NULL, *address = NULL, *launch, *service;
  const gchar *user = g_getenv("RTSP_USER"), *password = g_getenv("RTSP_PASSWORD");
  gboolean annotated = FALSE, open_to_all = FALSE;
  GError* error = NULL;
  GOptionEntry entries[] = {
      {"port", 0, 0, G_OPTION_ARG_INT, &port, "TCP port (8554)", "PORT"},
      {"address", 0, 0, G_OPTION_ARG_STRING, &address,
       "Address to listen on (127.0.0.1); others require RTSP_USER and RTSP_PASSWORD", "ADDRESS"},
      {"open", 0, 0, G_OPTION_ARG_NONE, &open_to_all, "No password, for any address", NULL},
      {"source", 0, 0, G_OPTION_ARG_STRING, &source, "Part of a pipeline that delivers raw video (a camera)",
       "TEXT"},
      {"settings", 0, 0, G_OPTION_ARG_STRING, &settings, "Properties of terrainseg", "TEXT"},
      {"annotated", 0, 0, G_OPTION_ARG_NONE, &annotated, "Draw the traversable ground on the video", NULL},
      {NULL, 0, 0, 0, NULL, NULL, NULL}};
  GOptionContext* context = g_option_context_new("- the rover as an RTSP server");
  GstRTSPServer* rtsp;
  GstRTSPMediaFactory* factory;
  GstRTSPMountPoints* mounts;
  const gchar* needed[][2] = {
      {"terrainseg", "install it, or set GST_PLUGIN_PATH (meson devenv -C build does)"},
      {"x264enc", "install gstreamer1.0-plugins-ugly"},
      {"rtpklvpay", "install gstreamer1.0-plugins-good"}};
  guint i;

  setlocale(LC_ALL, ""); /* the command line is in the encoding of the locale */
  g_option_context_add_main_entries(context, entries, NULL);
  g_option_context_add_group(context, gst_init_get_option_group());
  if (!g_option_context_parse(context, &argc, &argv, &error)) {
    g_printerr("rtsp_server: %s\n", error->message);
    return 2;
  }
  g_option_context_free(context);

  if (!address)
    address = g_strdup("127.0.0.1");
  if (port < 1 || port > 65535) {
    g_printerr("rtsp_server: %d is not a port: 1 to 65535\n", port);
    return 2;
  }
  if (!user != !password) {
    g_printerr("rtsp_server: set both RTSP_USER and RTSP_PASSWORD, or neither\n");
    return 2;
  }
  if (!user && !open_to_all && !is_loopback(address)) {
    g_printerr("rtsp_server: everyone could watch on %s: set RTSP_USER and RTSP_PASSWORD, or --open\n",
               address);
    return 2;
  }

  /* Without this check a viewer would get "service unavailable" without a reason. */
  for (i = 0; i < G_N_ELEMENTS(needed); ++i) {
    GstElementFactory* there = gst_element_factory_find(needed[i][0]);
    if (!there) {
      g_printerr("rtsp_server: GStreamer does not find %s: %s\n", needed[i][0], needed[i][1]);
      return 3;
    }
    gst_object_unref(there);
  }

  /* The leaky queue is in front of terrainseg: behind it video and metadata must stay together. The two RTP
     streams have separate clocks, so units are matched to frames by the stamps in the video. A unit must be
     one packet: after a loss, rtpklvdepay 1.22 refuses units of several packets. */
  launch = g_strdup_printf(
      "( %s ! videoconvert ! video/x-raw,format=I420 ! queue leaky=downstream max-size-buffers=2 ! "
      "terrainseg %s "
      "! tee name=t  t. ! queue ! %s x264enc tune=zerolatency speed-preset=veryfast bitrate=4000 "
      "key-int-max=30 "
      "! terrainstamp ! rtph264pay name=pay0 pt=96 config-interval=-1  t. ! queue ! terrainextract "
      "! meta/x-klv,parsed=true ! rtpklvpay name=pay1 pt=97 mtu=65000 )",
      source ? source : "v4l2src ! decodebin", settings ? settings : "",
      annotated ? "terrainoverlay ! videoconvert ! video/x-raw,format=I420 !" : "");

  rtsp = gst_rtsp_server_new();
  service = g_strdup_printf("%d", port);
  gst_rtsp_server_set_service(rtsp, service);
  gst_rtsp_server_set_address(rtsp, address);
  factory = gst_rtsp_media_factory_new();
  gst_rtsp_media_factory_set_launch(factory, launch);
  gst_rtsp_media_factory_set_shared(factory, TRUE); /* one camera, many viewers */
  if (user)
    ask_for_password(rtsp, factory, user, password);
  g_signal_connect(factory, "media-configure", G_CALLBACK(on_media), &server);
  mounts = gst_rtsp_server_get_mount_points(rtsp);
  gst_rtsp_mount_points_add_factory(mounts, "/rover", factory);
  g_object_unref(mounts);

  server.loop = g_main_loop_new(NULL, FALSE);
  if (gst_rtsp_server_attach(rtsp, NULL) == 0) {
    g_printerr("rtsp_server: %s port %d is in use or not an address of this machine\n", address, port);
    return 1;
  }
  if (!can_start(launch))
    return 4;
  g_unix_signal_add(SIGINT, on_interrupt, &server);
  g_unix_signal_add(SIGTERM, on_interrupt, &server);
  g_print("rtsp://%s:%d/rover\n", address, port);
  g_main_loop_run(server.loop);

  g_main_loop_unref(server.loop);
  g_object_unref(rtsp);
  g_free(service);
  g_free(launch);
  g_free(source);
  g_free(address);
  g_free(settings);
  return 0;
}
