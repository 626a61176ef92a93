// SPDX-License-Identifier: LGPL-2.1-or-later
#include "terrainextract.hpp"

#include <gst/video/video.h>

#include <algorithm>
#include <atomic>
#include <cstring>
#include <string>
#include <utility>

#include "estimate_meta.hpp"
#include "exchange/json_lines.hpp"
#include "exchange/vmti_klv.hpp"
#include "guarded.hpp"
#include "mask_picture.hpp"

GST_DEBUG_CATEGORY_STATIC(terrainextract_debug);
#define GST_CAT_DEFAULT terrainextract_debug

#define GRAY_CAPS                                                                                            \
  "video/x-raw, format = (string) GRAY8, width = (int) [ 1, 32767 ], height = (int) [ 1, 32767 ], "          \
  "framerate = (fraction) [ 0, max ]"

namespace terrainseg {
namespace {

enum class Output : std::uint8_t { gray, lines, klv };

/// What is known of the video from its caps.
struct Video {
  bool known = false;
  int width = 0, height = 0; ///< 0 = the caps do not say (encoded video that was not parsed)
  int fps_n = -1, fps_d = 1; ///< -1 = the caps do not say
  int par_n = 1, par_d = 1;
};

} // namespace

/// Everything behind the instance. "streaming": touched by the streaming thread alone, or while there is
/// none.
struct ExtractState {
  std::atomic<bool> json_mask = false;

  Video video;                      // streaming
  bool negotiated = false;          // streaming
  Output output = Output::gray;     // streaming
  GstVideoInfo picture;             // streaming; of the GRAY8 output
  bool video_meta_welcome = false;  // streaming; downstream reads GstVideoMeta, any stride will do
  GstBufferPool* pool = nullptr;    // streaming; pictures that are not the mask's own memory
  GstEvent* held_segment = nullptr; // streaming; waits for the caps
  bool warned = false;              // streaming
  MaskScaler scaler;                // streaming
  KlvEncoder klv;                   // streaming
  std::string line;                 // streaming

  ExtractState() { gst_video_info_init(&picture); }
  ~ExtractState() { reset(); }
  void drop_pool() {
    if (!pool)
      return;
    gst_buffer_pool_set_active(pool, FALSE);
    gst_object_unref(pool);
    pool = nullptr;
  }
  void reset() {
    drop_pool();
    gst_clear_event(&held_segment);
    video = {};
    negotiated = false;
    warned = false;
  }
};

} // namespace terrainseg

using namespace terrainseg;

struct GstTerrainExtract {
  GstElement parent;
  GstPad *sink, *src;
  ExtractState* state;
};
struct GstTerrainExtractClass {
  GstElementClass parent_class;
};

G_DEFINE_TYPE(GstTerrainExtract, gst_terrain_extract, GST_TYPE_ELEMENT)
GST_ELEMENT_REGISTER_DEFINE(terrainextract, "terrainextract", GST_RANK_NONE, gst_terrain_extract_get_type())

namespace {

enum { property_json_mask = 1 };

GstStaticPadTemplate sink_template =
    GST_STATIC_PAD_TEMPLATE("sink", GST_PAD_SINK, GST_PAD_ALWAYS, GST_STATIC_CAPS_ANY);
GstStaticPadTemplate src_template = GST_STATIC_PAD_TEMPLATE(
    "src", GST_PAD_SRC, GST_PAD_ALWAYS,
    GST_STATIC_CAPS(GRAY_CAPS "; application/x-ndjson; meta/x-klv, parsed = (boolean) true"));

GstTerrainExtract* self_of(gpointer object) {
  return reinterpret_cast<GstTerrainExtract*>(object);
}

/// For GST_PTR_FORMAT, which the compiler takes for %p.
void* printable(void* object) {
  return object;
}

// ---- negotiation -----------------------------------------------------------------------------------------

bool is_video(const GstCaps* caps) {
  const gchar* name = gst_structure_get_name(gst_caps_get_structure(caps, 0));
  return g_str_has_prefix(name, "video/") || g_str_has_prefix(name, "image/");
}

Video video_of(const GstCaps* caps) {
  const GstStructure* fields = gst_caps_get_structure(caps, 0);
  Video v;
  v.known = true;
  if (!gst_structure_get_int(fields, "width", &v.width) ||
      !gst_structure_get_int(fields, "height", &v.height) || v.width < 1 || v.height < 1)
    v.width = v.height = 0;
  gst_structure_get_fraction(fields, "framerate", &v.fps_n, &v.fps_d);
  gst_structure_get_fraction(fields, "pixel-aspect-ratio", &v.par_n, &v.par_d);
  return v;
}

/// The size that downstream asks for, as near to the frame's as it lets; a side that is free follows the
/// other.
void fixate_size(GstStructure* s, const Video& v) {
  int width = 0, height = 0;
  const bool width_set = gst_structure_get_int(s, "width", &width);
  const bool height_set = gst_structure_get_int(s, "height", &height);
  if (width_set && !height_set)
    height = static_cast<int>(gst_util_uint64_scale_int_round(width, v.height, v.width));
  else
    height = height_set ? height : v.height;
  if (height_set && !width_set)
    width = static_cast<int>(gst_util_uint64_scale_int_round(height, v.width, v.height));
  else
    width = width_set ? width : v.width;
  gst_structure_fixate_field_nearest_int(s, "height", std::max(height, 1));
  gst_structure_fixate_field_nearest_int(s, "width", std::max(width, 1));
}

/// A pixel is as wide as it makes the picture show the frame's proportions.
void fixate_aspect(GstStructure* s, const Video& v) {
  int width = 1, height = 1;
  gst_structure_get_int(s, "width", &width);
  gst_structure_get_int(s, "height", &height);
  int n = 1, d = 1;
  if (!gst_util_fraction_multiply(v.width, v.height, height, width, &n, &d) ||
      !gst_util_fraction_multiply(n, d, v.par_n, v.par_d, &n, &d))
    n = d = 1;
  if (gst_structure_has_field(s, "pixel-aspect-ratio"))
    gst_structure_fixate_field_nearest_fraction(s, "pixel-aspect-ratio", n, d);
  else
    gst_structure_set(s, "pixel-aspect-ratio", GST_TYPE_FRACTION, n, d, nullptr);
}

/// What downstream takes first of what is there; nullptr with a posted error when it takes nothing.
GstCaps* choose_caps(GstTerrainExtract* self, Output& output) {
  const Video& v = self->state->video;
  GstCaps* offer = gst_pad_get_pad_template_caps(self->src);
  offer = gst_caps_make_writable(offer);
  if (v.fps_n >= 0) // the rate is the video's: it cannot be converted here
    gst_structure_set(gst_caps_get_structure(offer, 0), "framerate", GST_TYPE_FRACTION, v.fps_n, v.fps_d,
                      nullptr);
  GstCaps* taken = gst_pad_peer_query_caps(self->src, offer);
  if (gst_caps_is_empty(taken)) {
    if (!GST_PAD_IS_FLUSHING(self->src))
      GST_ELEMENT_ERROR(
          self, CORE, NEGOTIATION,
          ("What comes after terrainextract takes none of its outputs: GRAY8 video at the frame rate of its "
           "input, application/x-ndjson, or meta/x-klv,parsed=true."),
          ("offered %" GST_PTR_FORMAT, printable(offer)));
    gst_caps_unref(taken);
    gst_caps_unref(offer);
    return nullptr;
  }
  gst_caps_unref(offer);
  GstCaps* chosen = gst_caps_copy_nth(taken, 0);
  gst_caps_unref(taken);
  GstStructure* s = gst_caps_get_structure(chosen, 0);
  output = gst_structure_has_name(s, "video/x-raw")            ? Output::gray
           : gst_structure_has_name(s, "application/x-ndjson") ? Output::lines
                                                               : Output::klv;
  return chosen;
}

/// Asks downstream whether masks may be passed on with their own stride.
void ask_allocation(GstTerrainExtract* self, GstCaps* caps) {
  ExtractState& s = *self->state;
  s.drop_pool();
  GstQuery* query = gst_query_new_allocation(caps, TRUE);
  s.video_meta_welcome = gst_pad_peer_query(self->src, query) &&
                         gst_query_find_allocation_meta(query, GST_VIDEO_META_API_TYPE, nullptr);
  gst_query_unref(query);
  s.pool = gst_video_buffer_pool_new();
  GstStructure* config = gst_buffer_pool_get_config(s.pool);
  gst_buffer_pool_config_set_params(config, caps, static_cast<guint>(GST_VIDEO_INFO_SIZE(&s.picture)), 0, 0);
  if (!gst_buffer_pool_set_config(s.pool, config) || !gst_buffer_pool_set_active(s.pool, TRUE))
    s.drop_pool();
}

/// Settles the output. True also when it has to wait for a frame that tells its size.
bool negotiate(GstTerrainExtract* self) {
  ExtractState& s = *self->state;
  s.negotiated = false;
  Output output = Output::gray;
  GstCaps* caps = choose_caps(self, output);
  if (!caps)
    return false;
  if (output == Output::gray && s.video.width == 0) {
    gst_caps_unref(caps);
    return true;
  }
  GstStructure* fields = gst_caps_get_structure(caps, 0);
  if (output == Output::gray) {
    fixate_size(fields, s.video);
    fixate_aspect(fields, s.video);
    gst_structure_fixate_field_nearest_fraction(fields, "framerate", std::max(s.video.fps_n, 0),
                                                s.video.fps_d);
  }
  caps = gst_caps_fixate(caps);
  if (output == Output::gray && !gst_video_info_from_caps(&s.picture, caps)) {
    GST_ELEMENT_ERROR(self, CORE, NEGOTIATION,
                      ("terrainextract cannot make masks as downstream asks for them."),
                      ("caps %" GST_PTR_FORMAT, printable(caps)));
    gst_caps_unref(caps);
    return false;
  }
  GST_DEBUG_OBJECT(self, "output %" GST_PTR_FORMAT, printable(caps));
  GstCaps* old = gst_pad_get_current_caps(self->src);
  const bool pushed =
      (old && gst_caps_is_equal(old, caps)) || gst_pad_push_event(self->src, gst_event_new_caps(caps));
  gst_clear_caps(&old);
  if (pushed && output == Output::gray)
    ask_allocation(self, caps);
  gst_caps_unref(caps);
  if (!pushed)
    return false;
  s.output = output;
  s.negotiated = true;
  if (s.held_segment)
    gst_pad_push_event(self->src, std::exchange(s.held_segment, nullptr));
  return true;
}

// ---- units -----------------------------------------------------------------------------------------------

/// The mask's own memory as a picture: the buffer stays alive, and out of its pool, as long as the picture.
GstBuffer* share_mask(GstTerrainExtract* self, GstBuffer* mask) {
  ExtractState& s = *self->state;
  const GstVideoMeta* layout = gst_buffer_get_video_meta(mask);
  const bool plain = layout->offset[0] == 0 &&
                     layout->stride[0] == GST_VIDEO_INFO_PLANE_STRIDE(&s.picture, 0) &&
                     gst_buffer_get_size(mask) == GST_VIDEO_INFO_SIZE(&s.picture);
  if (!plain && !s.video_meta_welcome)
    return nullptr;
  GstBuffer* picture = gst_buffer_new();
  if (!gst_buffer_copy_into(picture, mask, GST_BUFFER_COPY_MEMORY, 0, static_cast<gsize>(-1))) {
    gst_buffer_unref(picture);
    return nullptr;
  }
  gst_buffer_add_parent_buffer_meta(picture, mask);
  gsize offset[GST_VIDEO_MAX_PLANES] = {layout->offset[0]};
  gint stride[GST_VIDEO_MAX_PLANES] = {layout->stride[0]};
  gst_buffer_add_video_meta_full(picture, GST_VIDEO_FRAME_FLAG_NONE, GST_VIDEO_FORMAT_GRAY8, layout->width,
                                 layout->height, 1, offset, stride);
  return picture;
}

GstBuffer* make_picture(GstTerrainExtract* self, const EstimateReader& reader) {
  ExtractState& s = *self->state;
  const Estimate& e = reader.estimate();
  if (e.mask.empty())
    return nullptr;
  const int width = GST_VIDEO_INFO_WIDTH(&s.picture), height = GST_VIDEO_INFO_HEIGHT(&s.picture);
  if (MaskScaler::is_identity(e, width, height))
    if (GstBuffer* shared = share_mask(self, reader.mask()))
      return shared;
  GstBuffer* picture = nullptr;
  if (s.pool)
    gst_buffer_pool_acquire_buffer(s.pool, &picture, nullptr);
  GstVideoFrame frame;
  if (!picture || !gst_video_frame_map(&frame, &s.picture, picture, GST_MAP_WRITE)) {
    gst_clear_buffer(&picture);
    return nullptr;
  }
  s.scaler.draw(e,
                {static_cast<std::uint8_t*>(GST_VIDEO_FRAME_PLANE_DATA(&frame, 0)),
                 GST_VIDEO_FRAME_PLANE_STRIDE(&frame, 0)},
                width, height);
  gst_video_frame_unmap(&frame);
  return picture;
}

/// Microseconds since 1970 when upstream knows the time of day, else the PTS, so that a run can be repeated.
std::uint64_t precision_time(GstBuffer* buffer) {
  constexpr std::uint64_t seconds_1900_to_1970 = 2208988800;
  static GstStaticCaps unix_time = GST_STATIC_CAPS("timestamp/x-unix");
  static GstStaticCaps ntp_time = GST_STATIC_CAPS("timestamp/x-ntp");
  const auto timestamp = [&](GstStaticCaps* reference) {
    GstCaps* caps = gst_static_caps_get(reference);
    const GstReferenceTimestampMeta* meta = gst_buffer_get_reference_timestamp_meta(buffer, caps);
    gst_caps_unref(caps);
    return meta ? meta->timestamp : GST_CLOCK_TIME_NONE;
  };
  if (const GstClockTime time = timestamp(&unix_time); GST_CLOCK_TIME_IS_VALID(time))
    return time / 1000;
  if (const GstClockTime time = timestamp(&ntp_time);
      GST_CLOCK_TIME_IS_VALID(time) && time >= seconds_1900_to_1970 * GST_SECOND)
    return (time - seconds_1900_to_1970 * GST_SECOND) / 1000;
  return GST_BUFFER_PTS_IS_VALID(buffer) ? GST_BUFFER_PTS(buffer) / 1000 : 0;
}

GstBuffer* copy_of(const void* data, std::size_t size) {
  GstBuffer* buffer = gst_buffer_new_allocate(nullptr, size, nullptr);
  if (buffer)
    gst_buffer_fill(buffer, 0, data, size);
  return buffer;
}

/// The unit of a frame; nullptr when its metadata holds nothing that this output could show.
GstBuffer* make_unit(GstTerrainExtract* self, GstBuffer* frame, const EstimateReader& reader) {
  ExtractState& s = *self->state;
  if (s.output == Output::gray)
    return make_picture(self, reader);
  if (s.output == Output::klv) {
    const auto unit = s.klv.encode(reader.estimate(), precision_time(frame));
    return unit.empty() ? nullptr : copy_of(unit.data(), unit.size());
  }
  s.line.clear();
  const std::int64_t pts =
      GST_BUFFER_PTS_IS_VALID(frame) ? static_cast<std::int64_t>(GST_BUFFER_PTS(frame)) : -1;
  append_json_line(s.line, reader.estimate(), pts, s.json_mask);
  return copy_of(s.line.data(), s.line.size());
}

GstFlowReturn push_gap(GstTerrainExtract* self, GstBuffer* frame) {
  // Without a time there is nothing to say, and before the caps nobody to say it to.
  if (self->state->negotiated && GST_BUFFER_PTS_IS_VALID(frame))
    gst_pad_push_event(self->src, gst_event_new_gap(GST_BUFFER_PTS(frame), GST_BUFFER_DURATION(frame)));
  return GST_PAD_IS_FLUSHING(self->src) ? GST_FLOW_FLUSHING : GST_FLOW_OK;
}

void warn_once(GstTerrainExtract* self, const char* error) {
  GST_WARNING_OBJECT(self, "unreadable metadata: %s", error);
  if (std::exchange(self->state->warned, true))
    return;
  GST_ELEMENT_WARNING(self, STREAM, DECODE,
                      ("Frames carry metadata that makes no sense and are passed over: %s.", error),
                      ("GstTerrainSegMeta: %s", error));
}

GstFlowReturn extract(GstTerrainExtract* self, GstBuffer* frame) {
  ExtractState& s = *self->state;
  const EstimateReader reader(frame);
  const Estimate& e = reader.estimate();
  bool renegotiate = gst_pad_check_reconfigure(self->src) || !s.negotiated;
  // Where the caps hold no size the metadata tells it.
  if (reader && (s.video.width == 0 || !s.video.known) &&
      (s.video.width != e.frame_width || s.video.height != e.frame_height)) {
    s.video.width = e.frame_width;
    s.video.height = e.frame_height;
    s.video.known = false;
    renegotiate = true;
  }
  if (renegotiate && !negotiate(self)) {
    gst_pad_mark_reconfigure(self->src);
    return GST_PAD_IS_FLUSHING(self->src) ? GST_FLOW_FLUSHING : GST_FLOW_NOT_NEGOTIATED;
  }
  if (reader.error())
    warn_once(self, reader.error());
  if (!reader || !s.negotiated)
    return push_gap(self, frame);
  GstBuffer* unit = make_unit(self, frame, reader);
  if (!unit)
    return push_gap(self, frame);
  GST_BUFFER_PTS(unit) = GST_BUFFER_PTS(frame);
  GST_BUFFER_DURATION(unit) = GST_BUFFER_DURATION(frame);
  // Behind an encoder with B-frames units come in coding order, which muxers need to be told.
  GST_BUFFER_DTS(unit) = s.output == Output::gray ? GST_CLOCK_TIME_NONE : GST_BUFFER_DTS(frame);
  if (GST_BUFFER_IS_DISCONT(frame))
    GST_BUFFER_FLAG_SET(unit, GST_BUFFER_FLAG_DISCONT);
  return gst_pad_push(self->src, unit);
}

GstFlowReturn chain(GstPad*, GstObject* parent, GstBuffer* frame) {
  GstTerrainExtract* self = self_of(parent);
  const GstFlowReturn flow = guarded(self, GST_FLOW_ERROR, [&] { return extract(self, frame); });
  gst_buffer_unref(frame);
  return flow;
}

// ---- events and queries ----------------------------------------------------------------------------------

gboolean take_caps(GstTerrainExtract* self, GstEvent* event) {
  GstCaps* caps = nullptr;
  gst_event_parse_caps(event, &caps);
  if (!is_video(caps)) {
    GST_ELEMENT_ERROR(self, STREAM, WRONG_TYPE,
                      ("terrainextract takes video, raw or encoded, and this is %s.",
                       gst_structure_get_name(gst_caps_get_structure(caps, 0))),
                      ("caps %" GST_PTR_FORMAT, printable(caps)));
    gst_event_unref(event);
    return FALSE;
  }
  self->state->video = video_of(caps);
  gst_event_unref(event);
  gst_pad_check_reconfigure(self->src); // done now
  // A failure here may be one of the moment (a flush); the next frame tries again and reports.
  if (!negotiate(self))
    gst_pad_mark_reconfigure(self->src);
  return TRUE;
}

/// The units are a stream of their own beside the video.
GstEvent* own_stream(GstTerrainExtract* self, GstEvent* event) {
  gchar* id = gst_pad_create_stream_id(self->src, GST_ELEMENT(self), "terrain");
  GstEvent* own = gst_event_new_stream_start(id);
  g_free(id);
  guint group = 0;
  if (gst_event_parse_group_id(event, &group))
    gst_event_set_group_id(own, group);
  GstStreamFlags flags = GST_STREAM_FLAG_NONE;
  gst_event_parse_stream_flags(event, &flags);
  gst_event_set_stream_flags(own, flags);
  gst_event_set_seqnum(own, gst_event_get_seqnum(event));
  gst_event_unref(event);
  return own;
}

gboolean sink_event(GstPad* pad, GstObject* parent, GstEvent* event) {
  GstTerrainExtract* self = self_of(parent);
  ExtractState& s = *self->state;
  switch (GST_EVENT_TYPE(event)) {
  case GST_EVENT_STREAM_START:
    return gst_pad_push_event(self->src, own_stream(self, event));
  case GST_EVENT_CAPS:
    return guarded<gboolean>(self, FALSE, [&] { return take_caps(self, event); });
  case GST_EVENT_SEGMENT:
    if (gst_pad_has_current_caps(self->src))
      break;
    gst_clear_event(&s.held_segment);
    s.held_segment = event;
    return TRUE;
  case GST_EVENT_GAP:
    if (s.negotiated)
      break;
    gst_event_unref(event);
    return TRUE;
  case GST_EVENT_TAG: {
    // The video's codec and bitrate say nothing of the units.
    GstTagList* tags = nullptr;
    gst_event_parse_tag(event, &tags);
    if (gst_tag_list_get_scope(tags) == GST_TAG_SCOPE_GLOBAL)
      break;
    gst_event_unref(event);
    return TRUE;
  }
  case GST_EVENT_FLUSH_STOP:
    gst_clear_event(&s.held_segment);
    break;
  default:
    break;
  }
  return gst_pad_event_default(pad, parent, event);
}

gboolean sink_query(GstPad* pad, GstObject* parent, GstQuery* query) {
  if (GST_QUERY_TYPE(query) != GST_QUERY_ALLOCATION)
    return gst_pad_query_default(pad, parent, query);
  // No pixel is read here, so whatever the other branches of a tee want is right.
  gst_query_add_allocation_meta(query, GST_VIDEO_META_API_TYPE, nullptr);
  return TRUE;
}

gboolean src_event(GstPad* pad, GstObject* parent, GstEvent* event) {
  switch (GST_EVENT_TYPE(event)) {
  case GST_EVENT_QOS:         // a slow reader of masks must not make the camera's branch drop frames
  case GST_EVENT_RECONFIGURE: // settled here: the pad has noted it
    gst_event_unref(event);
    return TRUE;
  default:
    return gst_pad_event_default(pad, parent, event);
  }
}

// ---- the object ------------------------------------------------------------------------------------------

GstStateChangeReturn change_state(GstElement* element, GstStateChange transition) {
  const GstStateChangeReturn result =
      GST_ELEMENT_CLASS(gst_terrain_extract_parent_class)->change_state(element, transition);
  if (transition == GST_STATE_CHANGE_PAUSED_TO_READY)
    self_of(element)->state->reset();
  return result;
}

void set_property(GObject* object, guint id, const GValue* value, GParamSpec* spec) {
  if (id == property_json_mask)
    self_of(object)->state->json_mask = g_value_get_boolean(value);
  else
    G_OBJECT_WARN_INVALID_PROPERTY_ID(object, id, spec);
}

void get_property(GObject* object, guint id, GValue* value, GParamSpec* spec) {
  if (id == property_json_mask)
    g_value_set_boolean(value, self_of(object)->state->json_mask);
  else
    G_OBJECT_WARN_INVALID_PROPERTY_ID(object, id, spec);
}

void finalize(GObject* object) {
  delete self_of(object)->state;
  G_OBJECT_CLASS(gst_terrain_extract_parent_class)->finalize(object);
}

} // namespace

static void gst_terrain_extract_class_init(GstTerrainExtractClass* klass) {
  GST_DEBUG_CATEGORY_INIT(terrainextract_debug, "terrainextract", 0,
                          "terrain masks, lines and KLV from metadata");
  GObjectClass* object_class = G_OBJECT_CLASS(klass);
  object_class->set_property = set_property;
  object_class->get_property = get_property;
  object_class->finalize = finalize;
  g_object_class_install_property(
      object_class, property_json_mask,
      g_param_spec_boolean(
          "json-mask", "JSON mask", "Adds the mask as run lengths to the lines of application/x-ndjson",
          FALSE,
          static_cast<GParamFlags>(G_PARAM_READWRITE | G_PARAM_STATIC_STRINGS | GST_PARAM_MUTABLE_PLAYING)));
  GstElementClass* element_class = GST_ELEMENT_CLASS(klass);
  element_class->change_state = change_state;
  gst_element_class_add_static_pad_template(element_class, &sink_template);
  gst_element_class_add_static_pad_template(element_class, &src_template);
  gst_element_class_set_static_metadata(element_class, "Terrain extractor", "Formatter/Metadata/Video",
                                        "Turns the terrain metadata of video into mask pictures, JSON lines "
                                        "or MISB ST 0903 KLV, one unit a frame",
                                        "terrainseg maintainers");
}

static void gst_terrain_extract_init(GstTerrainExtract* self) {
  self->state = new ExtractState;
  self->sink = gst_pad_new_from_static_template(&sink_template, "sink");
  gst_pad_set_chain_function(self->sink, chain);
  gst_pad_set_event_function(self->sink, sink_event);
  gst_pad_set_query_function(self->sink, sink_query);
  gst_element_add_pad(GST_ELEMENT(self), self->sink);
  self->src = gst_pad_new_from_static_template(&src_template, "src");
  gst_pad_set_event_function(self->src, src_event);
  gst_element_add_pad(GST_ELEMENT(self), self->src);
}
