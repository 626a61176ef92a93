// SPDX-License-Identifier: LGPL-2.1-or-later

#include <gst/base/gstpushsrc.h>
#include <gst/terrainseg/terrainsegmeta.h>

#include <memory>

#include "scene/scene.hpp"
#include "support/buffers.hpp"
#include "support/element.hpp"
#include "support/estimate_meta.hpp"
#include "support/video_frame.hpp"

GST_DEBUG_CATEGORY_STATIC(terrainscenesrc_debug);
#define GST_CAT_DEFAULT terrainscenesrc_debug

using namespace terrainseg;

namespace {

struct SceneSourceSettings {
  scene::Settings scene;
  bool is_live = false;
};

/// Everything behind the instance.
struct SceneSourceState {
  GstBaseSrc* element = nullptr;
  SceneSourceSettings settings; // object lock

  GstVideoInfo info = no_video(); // written by streaming under the object lock, which others read under
  scene::Settings rendered;       // streaming; what the renderer was made for
  std::unique_ptr<scene::Renderer> renderer; // streaming
  std::uint64_t frame = 0;                   // streaming; number of the next frame
  std::uint64_t first_frame = 0;             // streaming; since the frame rate is what it is
  GstClockTime first_time = 0;               // streaming; of first_frame
  bool reverse = false;                      // streaming; `frame` is one more than the next
  bool skipped = false;                      // streaming; the next buffer is a discontinuity
  GstClockTimeDiff punctual = G_MAXINT64;    // streaming; least lateness of a live frame

  bool still() const { return GST_VIDEO_INFO_FPS_N(&info) == 0; }
  /// When frame n is shown; valid only with a frame rate.
  GstClockTime time_of(std::uint64_t n) const {
    return first_time + gst_util_uint64_scale(n - first_frame, GST_VIDEO_INFO_FPS_D(&info) * GST_SECOND,
                                              GST_VIDEO_INFO_FPS_N(&info));
  }
};

/**
 * SECTION:element-terrainscenesrc
 * @title: terrainscenesrc
 * @short_description: a rendered view of a rover with its truth
 *
 * Renders the view of a moving rover. The true label of every pixel and the true horizon go with each frame
 * as `GstTerrainTruthMeta`.
 *
 * ## Example launch line
 * |[
 * gst-launch-1.0 terrainscenesrc num-buffers=60 scene=trail ! videoconvert ! autovideosink
 * ]|
 *
 * Since: 0.1
 */
using GstTerrainSceneSrc = Instance<GstPushSrc, SceneSourceState>;
using GstTerrainSceneSrcClass = GstPushSrcClass;

G_DEFINE_TYPE(GstTerrainSceneSrc, gst_terrain_scene_src, GST_TYPE_PUSH_SRC)

constexpr int default_width = 640, default_height = 360, default_rate = 30;

// ---- properties ------------------------------------------------------------------------------------------

constexpr Choice scenes[] = {
    {"road", "Asphalt with markings, cars, houses or verges"},
    {"trail", "A dirt path through grass, bushes and trees"},
    {"corridor", "Floor, walls, doors and furniture"},
    {"plain", "Sand or regolith with rocks and far hills"},
};
constexpr Choice lights[] = {
    {"day", "Sun or bright lamps"},
    {"dusk", "Low light and a noisy sensor"},
    {"drift", "Day, with drifting exposure and white balance"},
    {"sun", "A low sun in a clear sky, with hard shadows, including the rover's own"},
};
constexpr Choice motions[] = {
    {"straight", "Along a straight path"},
    {"turn", "Along a winding path, sometimes turning in place"},
    {"bumpy", "Over rough ground: the horizon pitches and rolls"},
    {"still", "The rover stands still"},
};
const Property<SceneSourceSettings> table[] = {
    {"scene", "Scene", "Kind of place that the rover drives through", property_playing,
     field<&SceneSourceSettings::scene, &scene::Settings::kind>("GstTerrainSceneSrcScene", scenes)},
    {"light", "Light", "Kind of light, and stability of exposure and white balance", property_playing,
     field<&SceneSourceSettings::scene, &scene::Settings::light>("GstTerrainSceneSrcLight", lights)},
    {"motion", "Motion", "How the rover moves; each frame advances the world by 1/30 s at any frame rate",
     property_playing,
     field<&SceneSourceSettings::scene, &scene::Settings::motion>("GstTerrainSceneSrcMotion", motions)},
    {"seed", "Seed", "Seed of the place: each number gives a different road, trail, corridor or plain",
     property_playing, field<&SceneSourceSettings::scene, &scene::Settings::seed>(0, G_MAXUINT32)},
    {"obstacles", "Obstacles", "Share of the possible obstacle positions that have an obstacle, in percent",
     property_playing, field<&SceneSourceSettings::scene, &scene::Settings::obstacles>(0, 100)},
    {"wet", "Wet", "Add puddles that mirror sky and objects; their true label is ground", property_playing,
     field<&SceneSourceSettings::scene, &scene::Settings::wet>()},
    {"is-live", "Is live",
     "Produce frames in real time like a camera; frames are dropped if downstream is too slow",
     property_before_start, field<&SceneSourceSettings::is_live>()},
};

void set_property(GObject* object, guint id, const GValue* value, GParamSpec* spec) {
  set_in_table<GstTerrainSceneSrc, table>(object, id, value, spec);
  const SceneSourceState& s = GstTerrainSceneSrc::state_of(object);
  gst_base_src_set_live(s.element, locked_copy(object, s.settings.is_live));
}

// ---- negotiation -----------------------------------------------------------------------------------------

GstCaps* fixate(SceneSourceState& s, GstCaps* caps) {
  caps = gst_caps_make_writable(caps);
  GstStructure* fields = gst_caps_get_structure(caps, 0);
  gst_structure_fixate_field_nearest_int(fields, "width", default_width);
  gst_structure_fixate_field_nearest_int(fields, "height", default_height);
  gst_structure_fixate_field_nearest_fraction(fields, "framerate", default_rate, 1);
  if (gst_structure_has_field(fields, "pixel-aspect-ratio"))
    gst_structure_fixate_field_nearest_fraction(fields, "pixel-aspect-ratio", 1, 1);
  if (gst_structure_has_field(fields, "interlace-mode"))
    gst_structure_fixate_field_string(fields, "interlace-mode", "progressive");
  return GST_BASE_SRC_CLASS(gst_terrain_scene_src_parent_class)->fixate(s.element, caps);
}

bool set_caps(SceneSourceState& s, GstCaps* caps) {
  GstVideoInfo info;
  if (!gst_video_info_from_caps(&info, caps) || !pixel_format_of(GST_VIDEO_INFO_FORMAT(&info))) {
    GST_ELEMENT_ERROR(s.element, CORE, NEGOTIATION, ("Unsupported video format."),
                      ("caps %" GST_PTR_FORMAT, printable(caps)));
    return false;
  }
  if (GST_VIDEO_INFO_IS_INTERLACED(&info)) {
    GST_ELEMENT_ERROR(s.element, CORE, NEGOTIATION,
                      ("terrainscenesrc renders progressive video only: put \"interlace\" after it."),
                      ("caps %" GST_PTR_FORMAT, printable(caps)));
    return false;
  }
  // Time goes on where the old rate left it.
  if (GST_VIDEO_INFO_FORMAT(&s.info) != GST_VIDEO_FORMAT_UNKNOWN && !s.still())
    s.first_time = s.time_of(s.frame);
  s.first_frame = s.frame;
  s.punctual = G_MAXINT64;
  if (GST_VIDEO_INFO_WIDTH(&info) != GST_VIDEO_INFO_WIDTH(&s.info) ||
      GST_VIDEO_INFO_HEIGHT(&info) != GST_VIDEO_INFO_HEIGHT(&s.info))
    s.renderer.reset();
  const bool other_rate = GST_VIDEO_INFO_FPS_N(&info) != GST_VIDEO_INFO_FPS_N(&s.info) ||
                          GST_VIDEO_INFO_FPS_D(&info) != GST_VIDEO_INFO_FPS_D(&s.info);
  {
    ObjectLock lock(s.element);
    s.info = info;
  }
  if (other_rate && gst_base_src_is_live(s.element)) // a frame is another time now
    gst_element_post_message(GST_ELEMENT(s.element), gst_message_new_latency(GST_OBJECT(s.element)));
  return true;
}

gboolean decide_allocation(SceneSourceState& s, GstQuery* query) {
  g_autoptr(GstBufferPool) pool = nullptr;
  guint size = static_cast<guint>(GST_VIDEO_INFO_SIZE(&s.info)), least = 0, most = 0;
  const bool offered = gst_query_get_n_allocation_pools(query) > 0;
  if (offered) {
    guint wanted = 0;
    gst_query_parse_nth_allocation_pool(query, 0, &pool, &wanted, &least, &most);
    size = MAX(size, wanted);
  }
  if (!pool)
    pool = gst_video_buffer_pool_new();
  GstCaps* caps = nullptr;
  gst_query_parse_allocation(query, &caps, nullptr);
  GstStructure* config = gst_buffer_pool_get_config(pool);
  gst_buffer_pool_config_set_params(config, caps, size, least, most);
  if (gst_query_find_allocation_meta(query, GST_VIDEO_META_API_TYPE, nullptr))
    gst_buffer_pool_config_add_option(config, GST_BUFFER_POOL_OPTION_VIDEO_META);
  gst_buffer_pool_set_config(pool, config); // the base class replaces a pool that insists on its own
  if (offered)
    gst_query_set_nth_allocation_pool(query, 0, pool, size, least, most);
  else
    gst_query_add_allocation_pool(query, pool, size, least, most);
  return GST_BASE_SRC_CLASS(gst_terrain_scene_src_parent_class)->decide_allocation(s.element, query);
}

// ---- time ------------------------------------------------------------------------------------------------

bool start(SceneSourceState& s) {
  s.frame = s.first_frame = 0;
  s.first_time = 0;
  s.reverse = s.skipped = false;
  s.punctual = G_MAXINT64;
  ObjectLock lock(s.element);
  s.info = no_video();
  return true;
}

bool stop(SceneSourceState& s) {
  s.renderer.reset();
  return true;
}

bool do_seek(SceneSourceState& s, GstSegment* segment) {
  segment->time = segment->start;
  s.first_frame = 0;
  s.first_time = 0;
  s.reverse = segment->rate < 0;
  if (s.reverse && !GST_CLOCK_TIME_IS_VALID(segment->stop) && !GST_CLOCK_TIME_IS_VALID(segment->duration))
    return false; // backwards from an end that there is not
  const guint64 rate_n = static_cast<guint64>(GST_VIDEO_INFO_FPS_N(&s.info)),
                rate_d = static_cast<guint64>(GST_VIDEO_INFO_FPS_D(&s.info)) * GST_SECOND;
  if (rate_n == 0) {
    s.frame = s.reverse ? 1 : 0;
    return true;
  }
  // Frame n starts at floor(n * rate_d / rate_n): forward the last frame that starts at or before the
  // position, backward those that start before it.
  if (s.reverse)
    s.frame = gst_util_uint64_scale_ceil(segment->position, rate_n, rate_d);
  else
    s.frame = gst_util_uint64_scale_ceil(segment->position + 1, rate_n, rate_d) - 1;
  return true;
}

gboolean query(SceneSourceState& s, GstQuery* query) {
  const GstVideoInfo info = locked_copy(s.element, s.info);
  switch (GST_QUERY_TYPE(query)) {
  case GST_QUERY_LATENCY: // a camera gives a frame when it is exposed, which takes as long as the frame
    if (GST_VIDEO_INFO_FPS_N(&info) <= 0)
      break;
    gst_query_set_latency(
        query, gst_base_src_is_live(s.element),
        gst_util_uint64_scale(GST_SECOND, GST_VIDEO_INFO_FPS_D(&info), GST_VIDEO_INFO_FPS_N(&info)),
        GST_CLOCK_TIME_NONE);
    return TRUE;
  case GST_QUERY_CONVERT: {
    GstFormat from, to;
    gint64 value = 0, converted = 0;
    gst_query_parse_convert(query, &from, &value, &to, nullptr);
    if (!gst_video_info_convert(&info, from, value, to, &converted))
      return FALSE;
    gst_query_set_convert(query, from, value, to, converted);
    return TRUE;
  }
  case GST_QUERY_DURATION: {
    GstFormat format;
    gst_query_parse_duration(query, &format, nullptr);
    gint frames = -1;
    g_object_get(s.element, "num-buffers", &frames, nullptr);
    if (frames < 0 || GST_VIDEO_INFO_FPS_N(&info) == 0 ||
        (format != GST_FORMAT_DEFAULT && format != GST_FORMAT_TIME))
      break;
    gint64 duration = 0;
    gst_video_info_convert(&info, GST_FORMAT_DEFAULT, frames, format, &duration);
    gst_query_set_duration(query, format, duration);
    return TRUE;
  }
  default:
    break;
  }
  return GST_BASE_SRC_CLASS(gst_terrain_scene_src_parent_class)->query(s.element, query);
}

void get_times(GstBaseSrc* source, GstBuffer* buffer, GstClockTime* from, GstClockTime* to) {
  if (!gst_base_src_is_live(source) || !GST_BUFFER_PTS_IS_VALID(buffer))
    return;
  *from = GST_BUFFER_PTS(buffer);
  if (GST_BUFFER_DURATION_IS_VALID(buffer))
    *to = *from + GST_BUFFER_DURATION(buffer);
}

/// A camera that is too slow loses frames, it does not fall behind. The base class shifts a live source's
/// time stamps by what starting took, so that lateness is told by the most punctual frame so far.
void skip_missed(SceneSourceState& s) {
  if (!gst_base_src_is_live(s.element) || s.still())
    return;
  g_autoptr(GstClock) clock = gst_element_get_clock(GST_ELEMENT(s.element));
  if (!clock)
    return;
  const GstClockTime running = gst_clock_get_time(clock) - gst_element_get_base_time(GST_ELEMENT(s.element));
  const GstClockTimeDiff behind = GST_CLOCK_DIFF(s.time_of(s.frame), running);
  s.punctual = MIN(s.punctual, behind);
  const auto late = static_cast<GstClockTime>(behind - s.punctual),
             duration = s.time_of(s.frame + 1) - s.time_of(s.frame);
  if (late < 2 * duration)
    return;
  GST_DEBUG_OBJECT(s.element, "late by %" GST_TIME_FORMAT ": frames from %" G_GUINT64_FORMAT " on are lost",
                   GST_TIME_ARGS(late), s.frame);
  // Not late / duration, which is 0 with more frames than nanoseconds.
  s.frame +=
      gst_util_uint64_scale(late, GST_VIDEO_INFO_FPS_N(&s.info), GST_VIDEO_INFO_FPS_D(&s.info) * GST_SECOND);
  s.skipped = true;
}

// ---- frames ----------------------------------------------------------------------------------------------

void set_truth(GstStructure* truth, GstBuffer* labels, int horizon, const scene::View& view) {
  gst_structure_set(truth, "labels", GST_TYPE_BUFFER, labels, "horizon-row", G_TYPE_INT, horizon,
                    "camera-height", G_TYPE_DOUBLE, view.height, "focal-length", G_TYPE_DOUBLE, view.focal,
                    "pitch", G_TYPE_DOUBLE, view.pitch, "roll", G_TYPE_DOUBLE, view.roll, "center-x",
                    G_TYPE_DOUBLE, view.center_x, "center-y", G_TYPE_DOUBLE, view.center_y, nullptr);
}

/// Renders the next frame.
GstFlowReturn render(SceneSourceState& s, std::uint64_t number, GstBuffer* buffer) {
  const scene::Settings wanted = locked_copy(s.element, s.settings.scene);
  const int width = GST_VIDEO_INFO_WIDTH(&s.info), height = GST_VIDEO_INFO_HEIGHT(&s.info);
  if (!s.renderer || wanted != s.rendered) {
    s.renderer.reset();
    s.renderer = std::make_unique<scene::Renderer>(wanted, width, height);
    s.rendered = wanted;
  }
  const OwnedBuffer labels(new_mask_buffer(width, height));
  int horizon = -1;
  {
    const MappedBuffer map(labels.get(), GST_MAP_WRITE);
    if (!map) {
      GST_ELEMENT_ERROR(s.element, RESOURCE, NO_SPACE_LEFT, ("Out of memory for the labels."),
                        ("%d x %d", width, height));
      return GST_FLOW_ERROR;
    }
    const MappedFrame frame(s.info, buffer, GST_MAP_WRITE);
    if (!frame)
      return report_unusable(s.element, buffer, frame);
    horizon = s.renderer->render(number, frame.mutable_view(), {map.data(), width});
  }
  if (GstCustomMeta* meta = gst_buffer_add_custom_meta(buffer, GST_TERRAIN_TRUTH_META_NAME))
    set_truth(gst_custom_meta_get_structure(meta), labels.get(), horizon, s.renderer->view_of(number));
  return GST_FLOW_OK;
}

GstFlowReturn fill(SceneSourceState& s, GstBuffer* buffer) {
  if (GST_VIDEO_INFO_FORMAT(&s.info) == GST_VIDEO_FORMAT_UNKNOWN) {
    GST_ELEMENT_ERROR(s.element, CORE, NEGOTIATION, ("No video format was negotiated."),
                      ("fill() before set_caps()"));
    return GST_FLOW_NOT_NEGOTIATED;
  }
  if (s.reverse ? s.frame == 0 : s.still() && s.frame == 1)
    return GST_FLOW_EOS;
  skip_missed(s);
  const std::uint64_t number = s.reverse ? s.frame - 1 : s.frame;
  if (const GstFlowReturn flow = render(s, number, buffer); flow != GST_FLOW_OK)
    return flow;
  GST_BUFFER_OFFSET(buffer) = number;
  GST_BUFFER_OFFSET_END(buffer) = number + 1;
  GST_BUFFER_DTS(buffer) = GST_CLOCK_TIME_NONE;
  if (s.still()) {
    GST_BUFFER_PTS(buffer) = 0;
    GST_BUFFER_DURATION(buffer) = GST_CLOCK_TIME_NONE;
  } else {
    GST_BUFFER_PTS(buffer) = s.time_of(number);
    GST_BUFFER_DURATION(buffer) = s.time_of(number + 1) - s.time_of(number);
  }
  if (s.skipped) {
    GST_BUFFER_FLAG_SET(buffer, GST_BUFFER_FLAG_DISCONT);
    s.skipped = false;
  }
  GST_LOG_OBJECT(s.element, "frame %" G_GUINT64_FORMAT ": %" GST_PTR_FORMAT, number, printable(buffer));
  s.frame = s.reverse ? number : number + 1;
  return GST_FLOW_OK;
}

void gst_terrain_scene_src_init(GstTerrainSceneSrc* self) {
  const SceneSourceState& s = self->make_state();
  gst_base_src_set_format(s.element, GST_FORMAT_TIME);
  gst_base_src_set_live(s.element, FALSE);
}

void gst_terrain_scene_src_class_init(GstTerrainSceneSrcClass* klass) {
  GST_DEBUG_CATEGORY_INIT(terrainscenesrc_debug, "terrainscenesrc", 0,
                          "A rover's view, rendered, with its ground truth");
  init_class<GstTerrainSceneSrc, gst_terrain_scene_src_parent_class, table>(
      klass, {"Rover scene source", "Source/Video",
              "Renders a moving rover's view, with the true label of every pixel as metadata"});
  G_OBJECT_CLASS(klass)->set_property = set_property;
  add_pad_template(klass, "src", GST_PAD_SRC, TERRAINSEG_VIDEO_CAPS);
  auto* source_class = GST_BASE_SRC_CLASS(klass);
  source_class->start = GstTerrainSceneSrc::call<start>;
  source_class->stop = GstTerrainSceneSrc::call<stop>;
  source_class->fixate = GstTerrainSceneSrc::call<fixate>;
  source_class->set_caps = GstTerrainSceneSrc::call<set_caps>;
  source_class->decide_allocation = GstTerrainSceneSrc::call<decide_allocation>;
  source_class->is_seekable = [](GstBaseSrc* source) -> gboolean { return !gst_base_src_is_live(source); };
  source_class->do_seek = GstTerrainSceneSrc::call<do_seek>;
  source_class->query = GstTerrainSceneSrc::call<query>;
  source_class->get_times = get_times;
  GST_PUSH_SRC_CLASS(klass)->fill = GstTerrainSceneSrc::call<fill>;
}

} // namespace

GST_ELEMENT_REGISTER_DEFINE(terrainscenesrc, "terrainscenesrc", GST_RANK_NONE,
                            gst_terrain_scene_src_get_type())
