// SPDX-License-Identifier: LGPL-2.1-or-later

#include <gst/video/video.h>

#include <algorithm>
#include <optional>
#include <string>
#include <utility>

#include "elements/terrainextract/mask_picture.hpp"
#include "exchange/counted.hpp"
#include "exchange/json_lines.hpp"
#include "exchange/mavlink_stream.hpp"
#include "exchange/vmti_klv.hpp"
#include "support/buffers.hpp"
#include "support/element.hpp"
#include "support/estimate_meta.hpp"
#include "support/times.hpp"
#include "support/warnings.hpp"

GST_DEBUG_CATEGORY_STATIC(terrainextract_debug);
#define GST_CAT_DEFAULT terrainextract_debug

using namespace terrainseg;

namespace {

enum class Output : std::uint8_t { gray, lines, klv, mavlink };

/// What is known of the video from its caps.
struct Video {
  bool sized = false;        ///< the caps say the size (not those of encoded video that was not parsed)
  int width = 0, height = 0; ///< of the caps, else of the metadata; 0 = not known yet
  int fps_n = -1, fps_d = 1; ///< -1 = the caps do not say
  int par_n = 1, par_d = 1;
};

enum class KlvForm : std::uint8_t { vmti, uas_datalink };

/// Properties of one output.
struct ExtractSettings {
  bool json_mask = false;
  InternedName source;
  KlvForm klv_form = KlvForm::vmti;
  std::string klv_position;
  MavlinkLayout mavlink_layout = MavlinkLayout::portable;
  MavlinkUnknown mavlink_unknown = MavlinkUnknown::obstacle;
  std::uint32_t system_id = 1, component_id = 196;
};

constexpr Choice forms[] = {
    {"vmti", "A VMTI Local Set (ST 0903) alone"},
    {"uas-datalink",
     "A VMTI Local Set in a UAS Datalink Local Set (ST 0601), with attitude and position if known"},
};
constexpr Choice layouts[] = {
    {"portable", "72 sectors of 5 degrees, all around the vehicle: ArduPilot and PX4"},
    {"fine", "72 sectors across the field of view: ArduPilot only"},
};
constexpr Choice unknowns[] = {
    {"obstacle", "Sent as an obstacle at the minimum distance"},
    {"nothing", "Sent as no value (65535), which ArduPilot treats as free"},
};

const Property<ExtractSettings> table[] = {
    {"json-mask", "JSON mask", "Add the mask as run lengths to the lines of application/x-ndjson",
     property_playing, field<&ExtractSettings::json_mask>()},
    source_row<&ExtractSettings::source>(),
    {"klv-form", "KLV form", "Form of the units of meta/x-klv", property_playing,
     field<&ExtractSettings::klv_form>("GstTerrainKlvForm", forms)},
    {"klv-position", "KLV position",
     "Position of the camera for klv-form=uas-datalink: latitude,longitude,altitude in degrees and metres "
     "above mean sea level, optionally followed by the vehicle's heading in degrees",
     property_playing, field<&ExtractSettings::klv_position>()},
    {"mavlink-layout", "MAVLink layout", "Layout of the 72 sectors of application/x-mavlink",
     property_playing, field<&ExtractSettings::mavlink_layout>("GstTerrainMavlinkLayout", layouts)},
    {"mavlink-unknown", "MAVLink unknown",
     "How application/x-mavlink reports visible directions whose range is unknown", property_playing,
     field<&ExtractSettings::mavlink_unknown>("GstTerrainMavlinkUnknown", unknowns)},
    {"system-id", "System id", "MAVLink system id of the sender of application/x-mavlink: the vehicle's",
     property_playing, field<&ExtractSettings::system_id>(1, 255)},
    {"component-id", "Component id",
     "MAVLink component id of the sender of application/x-mavlink, 196 = obstacle avoidance",
     property_playing, field<&ExtractSettings::component_id>(1, 255)},
};

/// Everything behind the instance.
struct ExtractState {
  GstElement* element = nullptr;
  GstPad *sink = nullptr, *src = nullptr;
  Video video;                       // streaming
  GstSegment segment = in_time();    // streaming
  bool negotiated = false;           // streaming
  Output output = Output::gray;      // streaming; what downstream takes
  GstVideoInfo picture = no_video(); // streaming; of the GRAY8 output
  bool video_meta_welcome = false;   // streaming; downstream reads GstVideoMeta, any stride will do
  SmallPool pictures;                // streaming; pictures that are not the mask's own memory
  OwnedEvent held_segment;           // streaming; waits for the caps
  Once<> unreadable, unmeasured;     // streaming
  MetadataWatch metadata;            // streaming
  MaskScaler scaler;                 // streaming
  KlvEncoder klv;                    // streaming
  UasPlatform place;                 // streaming; what klv-position says
  std::string place_text;            // streaming; the klv-position that was read
  std::string line;                  // streaming
  MavlinkStream mavlink;             // streaming
  ExtractSettings settings;          // under the object lock

  void reset() {
    pictures.drop();
    held_segment.reset();
    video = {};
    negotiated = false;
    unreadable.again();
    unmeasured.again();
    place = {};
    place_text.clear();
    mavlink = {};
    metadata = {};
  }
};

/**
 * SECTION:element-terrainextract
 * @title: terrainextract
 * @short_description: terrain metadata as masks, JSON lines, KLV or MAVLink
 *
 * Turns the terrain metadata of video, raw or encoded, into mask pictures, JSON lines or MISB ST 0903 KLV,
 * one unit a frame, or MAVLink for autopilots, up to 15 messages a second. What comes out is chosen by the
 * caps behind it.
 *
 * ## Example launch line
 * |[
 * gst-launch-1.0 terrainscenesrc num-buffers=60 ! terrainseg ! terrainextract ! application/x-ndjson !
 * filesink location=terrain.jsonl
 * ]|
 *
 * Since: 0.1
 */
using GstTerrainExtract = Instance<GstElement, ExtractState>;
using GstTerrainExtractClass = GstElementClass;

G_DEFINE_TYPE(GstTerrainExtract, gst_terrain_extract, GST_TYPE_ELEMENT)

// ---- negotiation -----------------------------------------------------------------------------------------

bool is_video(const GstCaps* caps) {
  const gchar* name = gst_structure_get_name(gst_caps_get_structure(caps, 0));
  return g_str_has_prefix(name, "video/") || g_str_has_prefix(name, "image/");
}

Video video_of(const GstCaps* caps) {
  const GstStructure* fields = gst_caps_get_structure(caps, 0);
  Video v;
  v.sized = gst_structure_get_int(fields, "width", &v.width) &&
            gst_structure_get_int(fields, "height", &v.height) && v.width > 0 && v.height > 0;
  if (!v.sized)
    v.width = v.height = 0;
  gst_structure_get_fraction(fields, "framerate", &v.fps_n, &v.fps_d);
  gst_structure_get_fraction(fields, "pixel-aspect-ratio", &v.par_n, &v.par_d);
  return v;
}

/// The size that downstream asks for, as near to the frame's as it lets; a side that is free follows the
/// other.
void fixate_size(GstStructure* s, const Video& v) {
  int width = v.width, height = v.height;
  const bool width_set = gst_structure_get_int(s, "width", &width);
  const bool height_set = gst_structure_get_int(s, "height", &height);
  if (width_set && !height_set)
    height = static_cast<int>(gst_util_uint64_scale_int_round(width, v.height, v.width));
  if (height_set && !width_set)
    width = static_cast<int>(gst_util_uint64_scale_int_round(height, v.width, v.height));
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

/// What downstream takes first of what is there, which decides the output; nullptr with a posted error when
/// it takes nothing.
GstCaps* choose_caps(ExtractState& s) {
  const Video& v = s.video;
  g_autoptr(GstCaps) offer = gst_caps_make_writable(gst_pad_get_pad_template_caps(s.src));
  if (v.fps_n >= 0) // the rate is the video's: it cannot be converted here
    gst_structure_set(gst_caps_get_structure(offer, 0), "framerate", GST_TYPE_FRACTION, v.fps_n, v.fps_d,
                      nullptr);
  g_autoptr(GstCaps) taken = gst_pad_peer_query_caps(s.src, offer);
  if (gst_caps_is_empty(taken)) {
    if (!GST_PAD_IS_FLUSHING(s.src))
      GST_ELEMENT_ERROR(
          s.element, CORE, NEGOTIATION,
          ("Downstream of terrainextract accepts none of its outputs: GRAY8 video at the frame rate of its "
           "input, application/x-ndjson, meta/x-klv,parsed=true, or application/x-mavlink."),
          ("offered %" GST_PTR_FORMAT, printable(offer)));
    return nullptr;
  }
  GstCaps* chosen = gst_caps_copy_nth(taken, 0);
  const GstStructure* fields = gst_caps_get_structure(chosen, 0);
  s.output = gst_structure_has_name(fields, "video/x-raw")            ? Output::gray
             : gst_structure_has_name(fields, "application/x-ndjson") ? Output::lines
             : gst_structure_has_name(fields, "meta/x-klv")           ? Output::klv
                                                                      : Output::mavlink;
  return chosen;
}

/// Asks downstream whether masks may be passed on with their own stride.
void ask_allocation(ExtractState& s, GstCaps* caps) {
  s.pictures.drop();
  g_autoptr(GstQuery) query = gst_query_new_allocation(caps, TRUE);
  s.video_meta_welcome = gst_pad_peer_query(s.src, query) &&
                         gst_query_find_allocation_meta(query, GST_VIDEO_META_API_TYPE, nullptr);
}

/// Settles the output. True also when it has to wait for a frame that tells its size.
bool negotiate(ExtractState& s) {
  s.negotiated = false;
  g_autoptr(GstCaps) caps = choose_caps(s);
  if (!caps)
    return false;
  const bool gray = s.output == Output::gray;
  if (gray && s.video.width == 0)
    return true;
  if (gray) {
    GstStructure* fields = gst_caps_get_structure(caps, 0);
    fixate_size(fields, s.video);
    fixate_aspect(fields, s.video);
    gst_structure_fixate_field_nearest_fraction(fields, "framerate", std::max(s.video.fps_n, 0),
                                                s.video.fps_d);
  }
  caps = gst_caps_fixate(caps);
  if (gray && !gst_video_info_from_caps(&s.picture, caps)) {
    GST_ELEMENT_ERROR(s.element, CORE, NEGOTIATION,
                      ("terrainextract cannot produce masks in the format that downstream requests."),
                      ("caps %" GST_PTR_FORMAT, printable(caps)));
    return false;
  }
  GST_DEBUG_OBJECT(s.element, "output %" GST_PTR_FORMAT, printable(caps));
  g_autoptr(GstCaps) old = gst_pad_get_current_caps(s.src);
  const bool pushed =
      (old && gst_caps_is_equal(old, caps)) || gst_pad_push_event(s.src, gst_event_new_caps(caps));
  if (!pushed)
    return false;
  if (gray)
    ask_allocation(s, caps);
  s.negotiated = true;
  if (s.held_segment)
    gst_pad_push_event(s.src, s.held_segment.release());
  return true;
}

// ---- units -----------------------------------------------------------------------------------------------

/// The mask's own memory as a picture: the buffer stays alive, and out of its pool, as long as the picture.
GstBuffer* share_mask(ExtractState& s, GstBuffer* mask) {
  const GstVideoMeta* layout = gst_buffer_get_video_meta(mask);
  const bool plain = layout->offset[0] == 0 &&
                     layout->stride[0] == GST_VIDEO_INFO_PLANE_STRIDE(&s.picture, 0) &&
                     gst_buffer_get_size(mask) == GST_VIDEO_INFO_SIZE(&s.picture);
  if (!plain && !s.video_meta_welcome)
    return nullptr;
  GstBuffer* picture = gst_buffer_copy_region(mask, GST_BUFFER_COPY_MEMORY, 0, static_cast<gsize>(-1));
  if (!picture)
    return nullptr;
  gst_buffer_add_parent_buffer_meta(picture, mask);
  describe_mask(picture, static_cast<int>(layout->width), static_cast<int>(layout->height), layout->stride[0],
                layout->offset[0]);
  return picture;
}

GstBuffer* make_picture(ExtractState& s, const EstimateReader& reader) {
  const Estimate& e = reader.estimate();
  if (e.mask.empty())
    return nullptr;
  const int width = GST_VIDEO_INFO_WIDTH(&s.picture), height = GST_VIDEO_INFO_HEIGHT(&s.picture);
  if (MaskScaler::is_identity(e, width, height))
    if (GstBuffer* shared = share_mask(s, reader.mask()))
      return shared;
  OwnedBuffer picture = s.pictures.acquire(GST_VIDEO_INFO_SIZE(&s.picture));
  if (!picture)
    return nullptr;
  const MappedFrame frame(s.picture, picture.get(), GST_MAP_WRITE);
  if (!frame)
    return nullptr;
  s.scaler.draw(e, frame.mutable_view().planes[0], width, height);
  return picture.release();
}

/// The times that upstream noted (a camera's clock, NTP) are the unit's too.
void copy_reference_timestamps(GstBuffer* unit, GstBuffer* frame) {
  GstMetaTransformCopy whole = {FALSE, 0, static_cast<gsize>(-1)};
  gpointer state = nullptr;
  while (GstMeta* meta =
             gst_buffer_iterate_meta_filtered(frame, &state, GST_REFERENCE_TIMESTAMP_META_API_TYPE))
    if (meta->info->transform_func)
      meta->info->transform_func(unit, meta, frame, _gst_meta_transform_copy, &whole);
}

/// Once, of metadata that cannot be read.
void check(ExtractState& s, const MetaReader& reader) {
  if (!reader.error())
    return;
  GST_WARNING_OBJECT(s.element, "unreadable metadata: %s", reader.error());
  if (s.unreadable.first())
    GST_ELEMENT_WARNING(s.element, STREAM, DECODE, ("Invalid terrain metadata, ignored: %s.", reader.error()),
                        ("%s", reader.error()));
}

/// Without ranges the autopilot receives an obstacle in all directions: the user has to know.
void warn_unmeasured(ExtractState& s, const char* error) {
  GST_LOG_OBJECT(s.element, "no metres: %s", error ? error : "no metadata");
  if (!s.unmeasured.first())
    return;
  GST_ELEMENT_WARNING(s.element, STREAM, FORMAT,
                      ("The autopilot receives an obstacle in all directions: %s.",
                       error ? error : "frames carry no ranges (set camera-info and mount of terrainseg)"),
                      ("GstTerrainMetricMeta is missing or cannot be read"));
}

/// The messages of a frame; nullptr when it is not time for one.
GstBuffer* make_messages(ExtractState& s, GstBuffer* frame) {
  const ExtractSettings set = locked_copy(s.element, s.settings);
  const MetricReader metres(frame, s.settings.source.c_str());
  if (!metres)
    warn_unmeasured(s, metres.error());
  const std::int64_t time = GST_BUFFER_PTS_IS_VALID(frame) ? static_cast<std::int64_t>(GST_BUFFER_PTS(frame))
                                                           : g_get_monotonic_time() * 1000;
  const auto bytes =
      s.mavlink.at(time, time_of_frame(frame, s.segment).value_or(0), metres ? &metres.metric() : nullptr,
                   {set.mavlink_layout,
                    set.mavlink_unknown,
                    {static_cast<std::uint8_t>(set.system_id), static_cast<std::uint8_t>(set.component_id)}});
  return bytes.empty() ? nullptr : copy_of(bytes).release();
}

/// Position and heading of klv-position, which is read, and told when it cannot be, each time that it
/// changes.
void read_place(ExtractState& s, const std::string& text) {
  if (text == s.place_text)
    return;
  s.place_text = text;
  s.place = {};
  if (text.empty())
    return;
  if (const char* flaw = read_position(text, s.place))
    GST_ELEMENT_WARNING(
        s.element, RESOURCE, SETTINGS,
        ("KLV units carry no position: klv-position=\"%s\" is invalid: %s. Set latitude,longitude,altitude "
         "or latitude,longitude,altitude,heading, such as 52.5163,13.3777,34.",
         text.c_str(), flaw),
        ("%s", flaw));
}

/// What is known of the camera, which is the platform of ST 0601: the attitude that the metres were measured
/// with, and where klv-position has it.
UasPlatform platform_of(ExtractState& s, GstBuffer* frame, const std::string& position) {
  read_place(s, position);
  UasPlatform platform = s.place;
  const MetricReader metres(frame, s.settings.source.c_str());
  check(s, metres);
  if (!metres)
    return platform;
  // Ours are radians, pitch positive = down, yaw positive = left.
  constexpr double degrees = 180 / G_PI;
  const MetricEstimate& metric = metres.metric();
  platform.attitude = UasAttitude{-metric.pitch * degrees, metric.roll * degrees};
  if (platform.heading)
    *platform.heading -= metric.yaw * degrees;
  return platform;
}

GstBuffer* make_klv(ExtractState& s, GstBuffer* frame, const EstimateReader& reader) {
  const ExtractSettings set = locked_copy(s.element, s.settings);
  std::optional<UasPlatform> platform;
  if (set.klv_form == KlvForm::uas_datalink)
    platform = platform_of(s, frame, set.klv_position);
  const auto unit = s.klv.encode(reader.estimate(), precision_time(frame, s.segment).value_or(0),
                                 platform ? &*platform : nullptr);
  return unit.empty() ? nullptr : copy_of(unit).release();
}

/// The unit of a frame; nullptr when its metadata holds nothing that this output could show, or it is not
/// time for messages.
GstBuffer* make_unit(ExtractState& s, GstBuffer* frame, const EstimateReader& reader) {
  if (s.output == Output::gray)
    return make_picture(s, reader);
  if (s.output == Output::klv)
    return make_klv(s, frame, reader);
  if (s.output == Output::mavlink)
    return make_messages(s, frame);
  s.line.clear();
  const auto pts = static_cast<std::int64_t>(GST_BUFFER_PTS(frame)); // none is -1
  const MetricReader metres(frame, s.settings.source.c_str());
  check(s, metres);
  append_json_line(s.line, reader.estimate(), pts, locked_copy(s.element, s.settings.json_mask),
                   {metres ? &metres.metric() : nullptr, utc_of(frame)});
  return copy_of({reinterpret_cast<const std::uint8_t*>(s.line.data()), s.line.size()}).release();
}

GstFlowReturn push_gap(ExtractState& s, GstBuffer* frame) {
  GST_LOG_OBJECT(s.element, "no unit for %" GST_PTR_FORMAT, printable(frame));
  // A gap needs a time, and caps before it.
  if (s.negotiated && GST_BUFFER_PTS_IS_VALID(frame))
    gst_pad_push_event(s.src, gst_event_new_gap(GST_BUFFER_PTS(frame), GST_BUFFER_DURATION(frame)));
  return GST_PAD_IS_FLUSHING(s.src) ? GST_FLOW_FLUSHING : GST_FLOW_OK;
}

/// Says that nothing can come out, when no frame had metadata.
void warn_bare(ExtractState& s) {
  TERRAINSEG_POST_WARNING(
      s.element, STREAM, FAILED,
      s.metadata.warning("terrainextract", "nothing is written", s.settings.source.c_str()));
}

GstFlowReturn extract(ExtractState& s, GstBuffer* frame) {
  const OwnedBuffer owned(frame);
  const EstimateReader reader(frame, s.settings.source.c_str());
  const Estimate& e = reader.estimate();
  if (s.metadata.see(reader || reader.error()))
    warn_bare(s);
  bool renegotiate = gst_pad_check_reconfigure(s.src) || !s.negotiated;
  // Where the caps hold no size the metadata tells it.
  if (reader && !s.video.sized && (s.video.width != e.frame_width || s.video.height != e.frame_height)) {
    s.video.width = e.frame_width;
    s.video.height = e.frame_height;
    renegotiate = true;
  }
  if (renegotiate && !negotiate(s)) {
    gst_pad_mark_reconfigure(s.src);
    return GST_PAD_IS_FLUSHING(s.src) ? GST_FLOW_FLUSHING : GST_FLOW_NOT_NEGOTIATED;
  }
  check(s, reader);
  // An autopilot treats silence as free: it also receives frames without ranges.
  const bool wanted = s.negotiated && (reader || s.output == Output::mavlink);
  GstBuffer* unit = wanted ? make_unit(s, frame, reader) : nullptr;
  if (!unit)
    return push_gap(s, frame);
  GST_LOG_OBJECT(s.element, "frame %" G_GUINT64_FORMAT " as a unit of %" G_GSIZE_FORMAT " bytes", e.frame,
                 gst_buffer_get_size(unit));
  GST_BUFFER_PTS(unit) = GST_BUFFER_PTS(frame);
  GST_BUFFER_DURATION(unit) = GST_BUFFER_DURATION(frame);
  // Behind an encoder with B-frames units come in coding order, which muxers need to know.
  GST_BUFFER_DTS(unit) = s.output == Output::gray ? GST_CLOCK_TIME_NONE : GST_BUFFER_DTS(frame);
  copy_reference_timestamps(unit, frame);
  if (GST_BUFFER_IS_DISCONT(frame))
    GST_BUFFER_FLAG_SET(unit, GST_BUFFER_FLAG_DISCONT);
  return gst_pad_push(s.src, unit);
}

// ---- events and queries ----------------------------------------------------------------------------------

gboolean take_caps(ExtractState& s, GstEvent* event) {
  GstCaps* caps = nullptr;
  gst_event_parse_caps(event, &caps);
  if (!is_video(caps)) {
    GST_ELEMENT_ERROR(s.element, STREAM, WRONG_TYPE,
                      ("terrainextract needs raw or encoded video, but its input is %s.",
                       gst_structure_get_name(gst_caps_get_structure(caps, 0))),
                      ("caps %" GST_PTR_FORMAT, printable(caps)));
    return FALSE;
  }
  s.video = video_of(caps);
  gst_pad_check_reconfigure(s.src); // done now
  // A failure here may be one of the moment (a flush); the next frame tries again and reports.
  if (!negotiate(s))
    gst_pad_mark_reconfigure(s.src);
  return TRUE;
}

/// The units are a stream of their own beside the video.
GstEvent* own_stream(ExtractState& s, GstEvent* event) {
  g_autofree gchar* id = gst_pad_create_stream_id(s.src, s.element, "terrain");
  GstEvent* own = gst_event_new_stream_start(id);
  guint group = 0;
  if (gst_event_parse_group_id(event, &group))
    gst_event_set_group_id(own, group);
  GstStreamFlags flags = GST_STREAM_FLAG_NONE;
  gst_event_parse_stream_flags(event, &flags);
  gst_event_set_stream_flags(own, flags);
  gst_event_set_seqnum(own, gst_event_get_seqnum(event));
  return own;
}

gboolean sink_event(ExtractState& s, OwnedEvent event) {
  switch (GST_EVENT_TYPE(event.get())) {
  case GST_EVENT_STREAM_START:
    return gst_pad_push_event(s.src, own_stream(s, event.get()));
  case GST_EVENT_CAPS:
    return take_caps(s, event.get());
  case GST_EVENT_SEGMENT:
    gst_event_copy_segment(event.get(), &s.segment);
    if (gst_pad_has_current_caps(s.src))
      break;
    s.held_segment = std::move(event);
    return TRUE;
  case GST_EVENT_EOS:
    if (s.metadata.end())
      warn_bare(s);
    break;
  case GST_EVENT_GAP:
    if (!s.negotiated)
      return TRUE;
    break;
  case GST_EVENT_TAG: {
    // The video's codec and bitrate say nothing of the units.
    GstTagList* tags = nullptr;
    gst_event_parse_tag(event.get(), &tags);
    if (gst_tag_list_get_scope(tags) != GST_TAG_SCOPE_GLOBAL)
      return TRUE;
    break;
  }
  case GST_EVENT_FLUSH_STOP:
    s.segment = in_time();
    s.held_segment.reset();
    s.mavlink.restart();
    break;
  default:
    break;
  }
  return gst_pad_event_default(s.sink, GST_OBJECT(s.element), event.release());
}

/// Of a plain FALSE the pad that sends a sticky event again makes an error, also while this element is only
/// being stopped: its output goes first.
GstFlowReturn sink_event_full(ExtractState& s, GstEvent* event) {
  const bool caps = GST_EVENT_TYPE(event) == GST_EVENT_CAPS;
  if (sink_event(s, OwnedEvent(event)))
    return GST_FLOW_OK;
  return GST_PAD_IS_FLUSHING(s.src) ? GST_FLOW_FLUSHING : caps ? GST_FLOW_NOT_NEGOTIATED : GST_FLOW_ERROR;
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
    GstTerrainExtract::state_of(element).reset();
  return result;
}

void gst_terrain_extract_class_init(GstTerrainExtractClass* klass) {
  GST_DEBUG_CATEGORY_INIT(terrainextract_debug, "terrainextract", 0,
                          "terrain masks, lines, KLV and MAVLink from metadata");
  init_class<GstTerrainExtract, gst_terrain_extract_parent_class, table>(
      klass,
      {"Terrain extractor", "Formatter/Metadata/Video",
       "Turns the terrain metadata of video into mask pictures, JSON lines, MISB ST 0903 KLV or MAVLink"});
  GST_ELEMENT_CLASS(klass)->change_state = change_state;
  add_pad_template(klass, "sink", GST_PAD_SINK, "ANY");
  add_pad_template(klass, "src", GST_PAD_SRC,
                   "video/x-raw, format = (string) GRAY8, width = (int) [ 1, 32767 ], height = (int) [ 1, "
                   "32767 ], framerate = (fraction) [ 0, max ]; application/x-ndjson; meta/x-klv, parsed = "
                   "(boolean) true; application/x-mavlink");
}

void gst_terrain_extract_init(GstTerrainExtract* self) {
  ExtractState& s = self->make_state();
  s.sink = add_pad(s.element, "sink");
  gst_pad_set_chain_function(s.sink, GstTerrainExtract::pad_call<extract>);
  gst_pad_set_event_full_function(s.sink, GstTerrainExtract::pad_call<sink_event_full>);
  gst_pad_set_query_function(s.sink, sink_query);
  s.src = add_pad(s.element, "src");
  gst_pad_set_event_function(s.src, src_event);
}

} // namespace

GST_ELEMENT_REGISTER_DEFINE(terrainextract, "terrainextract", GST_RANK_NONE, gst_terrain_extract_get_type())
