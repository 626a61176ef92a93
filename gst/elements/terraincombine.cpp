// SPDX-License-Identifier: LGPL-2.1-or-later
// Own chain functions and a task, not GstAggregator: an aggregator holds one buffer a pad and then blocks, so
// that a demuxer that feeds both pads from one thread could not bring the unit of the frame that waits for
// it.
#include "elements/terraincombine.hpp"

#include <gst/video/video.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <list>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <type_traits>
#include <utility>
#include <vector>

#include "elements/terraincombine/unit_clock.hpp"
#include "elements/terraincombine/unit_store.hpp"
#include "exchange/vmti_klv.hpp"
#include "support/buffer_pool.hpp"
#include "support/estimate_meta.hpp"
#include "support/guarded.hpp"
#include "support/instance_state.hpp"
#include "support/object.hpp"
#include "support/plugin_api.hpp"
#include "support/precision_time.hpp"
#include "support/properties.hpp"
#include "support/segment_time.hpp"
#include "support/wall_clock.hpp"

GST_DEBUG_CATEGORY_STATIC(terraincombine_debug);
#define GST_CAT_DEFAULT terraincombine_debug

namespace terrainseg {
namespace {

using Clock = std::chrono::steady_clock;

constexpr guint default_latency = 200;
/// Units that may wait for video: more than two minutes at 30 frames a second, and as they came, not decoded.
constexpr std::size_t most_units = 4096;
constexpr std::size_t most_unit_bytes = std::size_t{64} << 20;
/// Frames and events that may wait: events alone (GAP) must not fill the memory either.
constexpr std::size_t most_items = 4096;
/// How near a unit must be when nothing tells the frame rate: RTP brings 1 ms, MPEG-TS 11 us of rounding.
constexpr Time default_tolerance = 10 * GST_MSECOND;
/// Half a frame of a film of an hour a picture: beyond it a duration is a mistake.
constexpr Time most_tolerance = 1800 * Time{GST_SECOND};
/// Not live, nobody's clock runs: only when neither units nor gaps have come for that long is the way of the
/// units taken for blocked (a demuxer that waits for the video to move on).
constexpr std::chrono::seconds stall_limit{5};
/// A mask may have that many pixels for every one of the frame: video scaled to a quarter of its sides.
constexpr std::int64_t most_mask_per_frame = 16;
/// Frames without metadata in a row after which the bus hears why.
constexpr unsigned silence_frames = 60;
/// Frames without a stamp in a row, behind stamped ones, after which the sender is taken to stamp no more.
/// Before, a frame without has lost its stamp on the way: a unit that its time stamp fits may be a
/// neighbour's.
constexpr unsigned stampless_frames = 25;
/// Frames with a stamp leave units alone that lie that near: links shift time stamps by less.
constexpr Time most_shift = 10 * Time{GST_SECOND};

struct ObjectUnref {
  void operator()(gpointer object) const { gst_mini_object_unref(GST_MINI_OBJECT_CAST(object)); }
};

enum class Match : std::uint8_t { automatic, time_stamps };

/// A frame or a serialized event on its way through.
struct Item {
  std::unique_ptr<GstMiniObject, ObjectUnref> object;
  Clock::time_point arrival;
  Time time = never;                  ///< of a frame; never = unknown
  std::optional<PrecisionTime> stamp; ///< of a frame; what its video says, where it goes by that
  Match match = Match::automatic;     ///< of a frame
  bool is_frame() const { return GST_IS_BUFFER(object.get()); }
};

enum class Live : std::uint8_t { unknown, no, yes };

struct CombineSettings {
  Match match = Match::automatic;
};

GType match_type() {
  static const GEnumValue values[] = {
      {static_cast<int>(Match::automatic),
       "By precision time, to the microsecond, where frames carry a stamp (terrainstamp); else by time "
       "stamps",
       "auto"},
      {static_cast<int>(Match::time_stamps), "By time stamps, whatever stamps frames carry", "time-stamps"},
      {0, nullptr, nullptr}};
  static const GType type = g_enum_register_static("GstTerrainMatch", values);
  return type;
}

const Property<CombineSettings> combine_table[] = {
    {"match", "Match", "What a frame and its KLV unit find each other by", property_playing,
     TERRAINSEG_CHOICE(CombineSettings, match, match_type)},
};

struct Counts {
  std::uint64_t matched = 0;  ///< frames with metadata
  std::uint64_t precise = 0;  ///< of those, by precision time
  std::uint64_t lost = 0;     ///< frames without
  std::uint64_t rejected = 0; ///< units that were damaged or foreign
  std::uint64_t unused = 0;   ///< units whose frame never came
};

} // namespace

/// Everything behind the instance. "lock": `mutex`, held for moments only, never while a frame is processed.
struct CombineState {
  std::atomic<guint> latency_ms = default_latency;
  CombineSettings settings; // object lock

  std::mutex mutex;
  std::condition_variable changed;        // any of what follows
  std::list<Item> items;                  // lock
  UnitStore units;                        // lock
  UnitClock clock;                        // lock; times of units without a PTS
  Counts counts;                          // lock
  Live live = Live::unknown;              // lock; asked by the task before it waits
  bool live_is_old = true;                // lock; to be asked again before the next frame waits
  unsigned reconfigured = 0;              // lock; counts RECONFIGURE events from downstream
  bool flushing = true;                   // lock; of the video's way
  bool meta_flushing = true;              // lock
  bool meta_eos = false;                  // lock
  bool meta_stalled = false;              // lock; a frame waited in vain and no unit has come since
  bool pushing = false;                   // lock; the task works on an item that it took
  bool feeder_waits = false;              // lock; the thread that brings the units waits for the task
  std::thread::id video_thread;           // lock; that brought the last frame
  std::thread::id meta_thread;            // lock; that brought the last unit or event of the units
  Clock::time_point meta_came;            // lock; when that was
  std::uint64_t frames_left = 0;          // lock; counts frames that the task took
  Time frame_duration = 0;                // lock; of the caps or the last frame; 0 = unknown
  Time newest_unit = never;               // lock; largest time of a unit since the last flush
  Time newest_frame = never;              // lock; largest time of a frame since the last flush
  bool stamps_came = false;               // lock; a frame with a stamp has come since the last flush
  bool stamped = false;                   // lock; frames carry stamps
  unsigned stampless = 0;                 // lock; frames without a stamp in a row
  PrecisionTime last_stamp = 0;           // lock; of a frame
  unsigned silent_frames = 0;             // lock; since the last match
  unsigned silent_units = 0;              // lock; units, since the last match
  unsigned silent_gaps = 0;               // lock; gaps of the units, since the last match
  bool told_silence = false;              // lock
  bool told_timeless = false;             // lock
  bool ever_warned = false;               // lock
  Clock::time_point warned;               // lock
  GstFlowReturn flow = GST_FLOW_FLUSHING; // lock; of the last push

  GstSegment video_segment; // the video's chain
  GstSegment meta_segment;  // the meta's chain
  KlvUnit checked;          // the meta's chain

  GstVideoInfo info;               // the task
  KlvUnit unit;                    // the task
  MaskPool masks;                  // the task
  SmallPool boundaries;            // the task
  std::vector<std::uint16_t> rows; // the task

  CombineState() noexcept {
    gst_segment_init(&video_segment, GST_FORMAT_TIME);
    gst_segment_init(&meta_segment, GST_FORMAT_TIME);
    gst_video_info_init(&info);
  }
};
static_assert(std::is_nothrow_default_constructible_v<UnitStore> &&
              std::is_nothrow_default_constructible_v<UnitClock> &&
              std::is_nothrow_default_constructible_v<KlvUnit> &&
              std::is_nothrow_default_constructible_v<std::list<Item>>);

} // namespace terrainseg

using namespace terrainseg;

/**
 * SECTION:element-terraincombine
 * @title: terraincombine
 * @short_description: attaches terrain metadata from KLV to the video it belongs to
 *
 * The other end of a link: takes video and the KLV units that #GstTerrainExtract made of it, matches them by
 * time and attaches each unit to its frame as `GstTerrainSegMeta`, which #GstTerrainOverlay draws. A frame
 * waits at most #GstTerrainCombine:latency for its unit where the pipeline is live.
 *
 * Where the video carries the precision times that #GstTerrainStamp wrote, a unit goes to the frame of
 * exactly its time and to no other, whatever the link did to the time stamps.
 *
 * ## Example launch line
 * |[
 * gst-launch-1.0 filesrc location=drive.ts ! tsdemux name=d d. ! queue ! h264parse ! avdec_h264 ! c.sink
 * d. ! queue ! meta/x-klv ! c.meta terraincombine name=c ! terrainoverlay ! videoconvert ! autovideosink
 * ]|
 *
 * Since: 0.1
 */
struct GstTerrainCombine {
  GstElement parent;
  GstPad *sink, *meta, *src;
  InstanceState<CombineState> state;
};
struct GstTerrainCombineClass {
  GstElementClass parent_class;
};

G_DEFINE_TYPE(GstTerrainCombine, gst_terrain_combine, GST_TYPE_ELEMENT)
GST_ELEMENT_REGISTER_DEFINE(terraincombine, "terraincombine", GST_RANK_NONE, gst_terrain_combine_get_type())

namespace {

enum { property_latency = 1, property_stats, property_match };

GstStaticPadTemplate sink_template =
    GST_STATIC_PAD_TEMPLATE("sink", GST_PAD_SINK, GST_PAD_ALWAYS, GST_STATIC_CAPS("video/x-raw(ANY)"));
GstStaticPadTemplate meta_template = GST_STATIC_PAD_TEMPLATE(
    "meta", GST_PAD_SINK, GST_PAD_ALWAYS, GST_STATIC_CAPS("meta/x-klv, parsed = (boolean) true"));
GstStaticPadTemplate src_template =
    GST_STATIC_PAD_TEMPLATE("src", GST_PAD_SRC, GST_PAD_ALWAYS, GST_STATIC_CAPS("video/x-raw(ANY)"));

GstTerrainCombine* self_of(gpointer object) {
  return reinterpret_cast<GstTerrainCombine*>(object);
}

using Lock = std::unique_lock<std::mutex>;

/// The macros of GStreamer mix enumerations, which C++20 warns of.
bool has_flag(GstEvent* event, GstEventTypeFlags flag) {
  return gst_event_type_get_flags(GST_EVENT_TYPE(event)) & flag;
}

/// Signed running time of a position in a segment; never when it has none, or one of centuries that no sum
/// of times must overflow with.
Time running_time(const GstSegment& segment, GstClockTime position) {
  guint64 time = 0;
  if (!GST_CLOCK_TIME_IS_VALID(position) || !has_running_time(segment))
    return never;
  const int sign = gst_segment_to_running_time_full(&segment, GST_FORMAT_TIME, position, &time);
  if (sign == 0 || time > static_cast<guint64>(most_time))
    return never;
  return sign > 0 ? static_cast<Time>(time) : -static_cast<Time>(time);
}

/// Of a frame; 0 when the caps do not say.
Time duration_of(const GstVideoInfo& info) {
  if (GST_VIDEO_INFO_FPS_N(&info) <= 0 || GST_VIDEO_INFO_FPS_D(&info) <= 0)
    return 0;
  return static_cast<Time>(
      gst_util_uint64_scale_int(GST_SECOND, GST_VIDEO_INFO_FPS_D(&info), GST_VIDEO_INFO_FPS_N(&info)));
}

// ---- attaching -------------------------------------------------------------------------------------------

int scaled(int position, int to, int from) {
  return static_cast<int>(gst_util_uint64_scale_int(static_cast<guint64>(position), to, from));
}

Rectangle scaled(const Rectangle& r, const Estimate& e, int width, int height) {
  const int x = scaled(r.x, width, e.frame_width), y = scaled(r.y, height, e.frame_height);
  return {x, y, scaled(r.x + r.width, width, e.frame_width) - x,
          scaled(r.y + r.height, height, e.frame_height) - y};
}

/// The estimate in pixels of a picture that was scaled on its way here: the rules of the metadata itself.
void fit(Estimate& e, std::vector<std::uint16_t>& rows, int width, int height) {
  const auto row_of = [&](int row) {
    return std::min(
        static_cast<int>(gst_util_uint64_scale_int_round(static_cast<guint64>(row), height, e.frame_height)),
        height - 1);
  };
  rows.assign(e.boundary.begin(), e.boundary.end());
  for (std::uint16_t& row : rows)
    row = static_cast<std::uint16_t>(row >= e.frame_height ? height : row_of(row));
  e.boundary = rows;
  if (e.horizon_row >= 0)
    e.horizon_row = row_of(e.horizon_row);
  if (e.vanishing_row >= 0)
    e.vanishing_row = static_cast<std::int32_t>(
        gst_util_uint64_scale_int_round(static_cast<guint64>(e.vanishing_row), height, e.frame_height));
  e.mask_region = scaled(e.mask_region, e, width, height);
  e.window = scaled(e.window, e, width, height);
  e.frame_width = width;
  e.frame_height = height;
}

/// Pixels that the mask of a unit may have on this video.
std::int64_t most_mask_pixels(const CombineState& s) {
  const std::int64_t width = GST_VIDEO_INFO_WIDTH(&s.info), height = GST_VIDEO_INFO_HEIGHT(&s.info);
  return most_mask_per_frame * (width > 0 && height > 0 ? width * height : std::int64_t{1920} * 1080);
}

/// Decodes the unit into `s.unit`; what is wrong with it, or an empty text.
std::string decode_for_frame(CombineState& s, GstBuffer* klv) {
  GstMapInfo map;
  if (!gst_buffer_map(klv, &map, GST_MAP_READ))
    return "its memory cannot be read";
  const KlvVerdict verdict = s.unit.decode({map.data, map.size});
  gst_buffer_unmap(klv, &map);
  if (verdict != KlvVerdict::ok) // it was, when it came: somebody wrote into it
    return s.unit.error();
  const GrayView& mask = s.unit.estimate().mask;
  if (std::int64_t{mask.width} * mask.height > most_mask_pixels(s))
    return "its mask of " + std::to_string(mask.width) + "x" + std::to_string(mask.height) +
           " is more than four times as wide and high as the video of " +
           std::to_string(GST_VIDEO_INFO_WIDTH(&s.info)) + "x" +
           std::to_string(GST_VIDEO_INFO_HEIGHT(&s.info)) + ": send it smaller (mask-level)";
  return {};
}

/// The frame with what `s.unit` says; as it was when there is no memory for it.
GstBuffer* attach_unit(CombineState& s, GstBuffer* frame) {
  Estimate e = s.unit.estimate();
  const int width = GST_VIDEO_INFO_WIDTH(&s.info), height = GST_VIDEO_INFO_HEIGHT(&s.info);
  if (width > 0 && height > 0 && (e.frame_width != width || e.frame_height != height))
    fit(e, s.rows, width, height);

  OwnedBuffer mask = s.masks.acquire(e.mask.width, e.mask.height);
  const OwnedBuffer boundary = e.boundary.empty() ? nullptr : boundary_buffer(s.boundaries, e.boundary);
  GstMapInfo pixels;
  if (!mask || (!boundary && !e.boundary.empty()) || !gst_buffer_map(mask.get(), &pixels, GST_MAP_WRITE))
    return frame;
  s.unit.draw_mask({pixels.data, gst_buffer_get_video_meta(mask.get())->stride[0]});
  gst_buffer_unmap(mask.get(), &pixels);
  frame = gst_buffer_make_writable(frame);
  attach(frame, e, mask.get(), boundary.get());
  stamp_unit_time(frame, s.unit.time_us());
  return frame;
}

// ---- what the bus hears ----------------------------------------------------------------------------------

void reject(GstTerrainCombine* self, const char* kind, const std::string& error) {
  CombineState& s = *self->state;
  std::uint64_t count = 0;
  GST_WARNING_OBJECT(self, "KLV unit skipped: %s", error.c_str());
  {
    const Lock lock(s.mutex);
    count = ++s.counts.rejected;
    // On a bad link this comes many times a second; the bus hears of it once a second.
    const Clock::time_point now = Clock::now();
    if (s.ever_warned && now - s.warned < std::chrono::seconds(1))
      return;
    s.ever_warned = true;
    s.warned = now;
  }
  GST_ELEMENT_WARNING(self, STREAM, DECODE,
                      ("A %s KLV unit was skipped (%" G_GUINT64_FORMAT " so far): %s.", kind,
                       static_cast<guint64>(count), error.c_str()),
                      ("%s", error.c_str()));
}

std::string seconds_text(Time time) {
  gchar text[32];
  g_snprintf(text, sizeof text, "%.3f s", static_cast<double>(time) / GST_SECOND);
  return text;
}

/// By what a frame is matched.
struct FrameTimes {
  Time time, tolerance;
  std::optional<PrecisionTime> stamp;
  Match match;
};

std::string late_units(const CombineState& s, Time behind) {
  return "the units come " + seconds_text(behind) + " behind their frames: set latency to " +
         std::to_string(s.latency_ms + static_cast<guint>(std::min<Time>(behind / GST_MSECOND, 60000))) +
         " or more";
}

/// The same where frames carry stamps.
std::string precise_silence(const CombineState& s, PrecisionTime frame) {
  constexpr PrecisionTime most_delay = 60'000'000;
  const PrecisionTime newest = s.units.precision_progress().value_or(0);
  if (newest < frame && frame - newest <= most_delay && s.live != Live::no)
    return late_units(s, static_cast<Time>(frame - newest) * static_cast<Time>(GST_USECOND));
  return "the frames' precision times (now " + std::to_string(frame) + " us) are none of the units' (now " +
         std::to_string(newest) +
         " us): do the sender's terrainstamp and terrainextract see the same frames? match=time-stamps does "
         "without the stamps";
}

/// Why no frame has met a unit for a while, and what to do; empty while there is nothing to tell. The caller
/// holds the lock.
std::string silence_reason(CombineState& s, const FrameTimes& frame) {
  if (s.told_silence || s.silent_frames < silence_frames || s.meta_eos ||
      (s.silent_units == 0 && s.silent_gaps > 0))
    return {};
  s.told_silence = true;
  if (s.silent_units == 0)
    return "no KLV unit has come: is the sender's branch with terrainextract linked to the muxer, and the "
           "demuxer's meta/x-klv pad to this element?";
  if (frame.stamp)
    return precise_silence(s, *frame.stamp);
  if (frame.time == never)
    return "the frames carry no time stamps: put an element that sets them (a parser, or appsrc with "
           "do-timestamp=true) in front";
  if (s.newest_unit == never)
    return "neither time stamps nor contents of the units tell their times: send them with time stamps";
  if (s.newest_unit < frame.time - frame.tolerance) {
    const Time behind = frame.time - s.newest_unit;
    if (s.live != Live::no)
      return late_units(s, behind);
    return "the units' time stamps lie " + seconds_text(behind) +
           " before the video's: both streams need the same clock and segment";
  }
  if (s.newest_unit > frame.time + frame.tolerance)
    return "the units' time stamps lie " + seconds_text(s.newest_unit - frame.time) +
           " after the video's: both streams need the same clock and segment";
  return "the units lie between the frames, more than half a frame away: is a videorate between the sender's "
         "terrainextract and the encoder?";
}

void tell_silence(GstTerrainCombine* self, const std::string& reason) {
  if (reason.empty())
    return;
  GST_ELEMENT_WARNING(self, STREAM, FAILED,
                      ("No frame has met its KLV unit for %u frames: %s.", silence_frames, reason.c_str()),
                      ("%s", reason.c_str()));
}

// ---- the task --------------------------------------------------------------------------------------------

/// Half a frame: nearer to this frame than to its neighbours.
Time tolerance_of(const CombineState& s, GstBuffer* frame) {
  if (GST_BUFFER_DURATION_IS_VALID(frame) && GST_BUFFER_DURATION(frame) > 0)
    return static_cast<Time>(
        std::min(GST_BUFFER_DURATION(frame) / 2, static_cast<GstClockTime>(most_tolerance)));
  const Time duration = duration_of(s.info);
  return duration > 0 ? std::min(duration / 2, most_tolerance) : default_tolerance;
}

/// Whether one of the two upstreams is live; one that does not answer is taken for live, so that no frame
/// waits longer than `latency` in it.
Live ask_live(GstTerrainCombine* self) {
  bool live = false, answered = false;
  for (GstPad* pad : {self->sink, self->meta}) {
    GstQuery* query = gst_query_new_latency();
    if (gst_pad_peer_query(pad, query)) {
      gboolean pad_live = FALSE;
      gst_query_parse_latency(query, &pad_live, nullptr, nullptr);
      live = live || pad_live;
      answered = answered || pad == self->sink;
    }
    gst_query_unref(query);
  }
  return live || !answered ? Live::yes : Live::no;
}

/// Until when the first item, a frame, waits.
Clock::time_point deadline_of(const CombineState& s, Clock::time_point waiting_since) {
  const std::chrono::milliseconds latency(s.latency_ms);
  if (s.live == Live::no)
    return std::max(waiting_since, s.meta_came) + std::max<Clock::duration>(stall_limit, latency);
  return s.items.front().arrival + latency;
}

FrameTimes times_of(const CombineState& s, const Item& frame) {
  return {frame.time, tolerance_of(s, GST_BUFFER(frame.object.get())), frame.stamp, frame.match};
}

/// Whether the sender's time begins anew with this frame. Where the units' has, any step back is that one,
/// and frames that meet no unit for long are behind it, too. Where it has not, neither a single wrong stamp
/// nor a clock that is set back a little is taken for it.
bool begins_anew(const CombineState& s, PrecisionTime stamp) {
  if (s.units.has_later_run())
    return stamp < s.last_stamp || s.silent_frames >= silence_frames;
  const auto progress = s.units.precision_progress();
  return is_anew(stamp, s.last_stamp) && progress && is_anew(stamp, *progress);
}

/// Whether the frames carry stamps by now, and in which run of the sender they are.
void follow_stamps(CombineState& s, const FrameTimes& frame) {
  if (!frame.stamp) {
    s.stamped = s.stamped && frame.match == Match::automatic && ++s.stampless < stampless_frames;
    return;
  }
  s.stampless = 0;
  if (!std::exchange(s.stamped, true))
    s.units.begin_precisely();
  else if (begins_anew(s, *frame.stamp))
    s.counts.unused += s.units.leave_run();
  s.last_stamp = *frame.stamp;
}

/// False for a frame that lost its stamp, too: a unit that lies nearest may be its neighbour's.
bool can_match(const CombineState& s, const FrameTimes& frame) {
  return frame.stamp || (frame.time != never && !s.stamped);
}

OwnedBuffer take_unit(CombineState& s, const FrameTimes& frame) {
  return frame.stamp ? s.units.take_precise(*frame.stamp) : s.units.take(frame.time, frame.tolerance);
}

/// Drops units that neither this frame nor a later one can match; returns how many.
std::uint64_t drop_past(CombineState& s, const FrameTimes& frame) {
  if (!frame.stamp)
    return s.units.drop_before(frame.time - frame.tolerance);
  // A stamp beyond all units may be damaged: then the next frame's decides.
  const auto progress = s.units.precision_progress();
  const bool beyond = !s.units.has_later_run() && progress && *frame.stamp > *progress;
  const std::uint64_t past = beyond ? 0 : s.units.drop_before_precisely(*frame.stamp);
  return frame.time == never ? past : past + s.units.drop_before(frame.time - most_shift);
}

/// Whether the frame's unit cannot come any more. Of gaps a stamp says nothing, and their time stamps lie
/// with the link: live, the frame rather waits.
bool is_past(const CombineState& s, const FrameTimes& frame) {
  if (!frame.stamp)
    return s.units.is_past(frame.time, frame.tolerance);
  return s.units.is_past_precisely(*frame.stamp) ||
         (s.live == Live::no && frame.time != never && s.units.is_gap(frame.time, frame.tolerance));
}

/// Waits for the unit of the first item, a frame of those times. nullptr: there is none, or `s.flushing`.
///
/// Live, a frame waits `latency` from its arrival. Not live, the data alone decide: until the unit is there,
/// or past, or the units have ended, or (one thread feeds both pads) the video ahead of it fills the queue.
OwnedBuffer wait_for_unit(GstTerrainCombine* self, const FrameTimes& times, Lock& lock) {
  CombineState& s = *self->state;
  if (s.live_is_old) {
    s.live_is_old = false;
    lock.unlock();
    const Live live = ask_live(self);
    lock.lock();
    s.live = live;
    if (s.flushing)
      return nullptr;
  }
  const Clock::time_point since = Clock::now();
  follow_stamps(s, times);
  OwnedBuffer unit;
  while (!s.flushing && can_match(s, times)) {
    unit = take_unit(s, times);
    if (const std::uint64_t past = drop_past(s, times); past > 0) {
      s.counts.unused += past;
      s.changed.notify_all(); // there is room
    }
    if (unit || s.meta_eos || s.meta_flushing || s.meta_stalled || s.feeder_waits || is_past(s, times) ||
        !gst_pad_is_linked(self->meta))
      break;
    if (Clock::now() >= deadline_of(s, since)) {
      GST_DEBUG_OBJECT(self, "no unit came in time; frames do not wait until one comes");
      s.meta_stalled = true;
      break;
    }
    s.changed.wait_until(lock, deadline_of(s, since));
  }
  return unit;
}

/// Counts what became of a frame; what to tell of it. The caller holds the lock.
std::string count_frame(CombineState& s, bool matched, const FrameTimes& frame) {
  if (matched) {
    ++s.counts.matched;
    s.counts.precise += frame.stamp ? 1 : 0;
    s.silent_frames = s.silent_units = s.silent_gaps = 0;
    return {};
  }
  ++s.counts.lost;
  ++s.silent_frames;
  return silence_reason(s, frame);
}

void push_frame(GstTerrainCombine* self, Lock& lock) {
  CombineState& s = *self->state;
  const FrameTimes times = times_of(s, s.items.front());
  OwnedBuffer klv = wait_for_unit(self, times, lock);
  if (s.flushing)
    return;
  OwnedBuffer frame(GST_BUFFER(s.items.front().object.release()));
  s.items.pop_front();
  ++s.frames_left;
  s.pushing = true;
  s.changed.notify_all();
  const bool linked = gst_pad_is_linked(self->meta);
  lock.unlock();
  bool matched = klv != nullptr;
  if (klv)
    if (const std::string flaw = decode_for_frame(s, klv.get()); !flaw.empty()) {
      matched = false;
      reject(self, "useless", flaw);
    }
  lock.lock();
  const std::string reason = count_frame(s, matched, times);
  const unsigned reconfigured = s.reconfigured;
  lock.unlock();
  GST_LOG_OBJECT(self, "%s: %" GST_PTR_FORMAT, matched ? "with its unit" : "without a unit",
                 printable(frame.get()));
  if (linked)
    tell_silence(self, reason);
  if (matched)
    frame.reset(attach_unit(s, frame.release()));
  const GstFlowReturn flow = gst_pad_push(self->src, frame.release());
  lock.lock();
  s.pushing = false;
  // Linked while this frame found nobody: the next one finds somebody.
  if (!s.flushing && !(flow == GST_FLOW_NOT_LINKED && s.reconfigured != reconfigured))
    s.flow = flow;
  if (s.flow == GST_FLOW_NOT_LINKED) // nobody will want them any more when somebody is there again
    s.items.remove_if([](const Item& item) { return item.is_frame(); });
  s.changed.notify_all();
}

void push_event(GstTerrainCombine* self, Lock& lock) {
  CombineState& s = *self->state;
  GstEvent* event = GST_EVENT(s.items.front().object.release());
  s.items.pop_front();
  s.pushing = true;
  s.changed.notify_all();
  lock.unlock();
  GST_DEBUG_OBJECT(self, "in turn: %" GST_PTR_FORMAT, printable(event));
  const bool eos = GST_EVENT_TYPE(event) == GST_EVENT_EOS;
  if (GST_EVENT_TYPE(event) == GST_EVENT_CAPS) {
    GstCaps* caps = nullptr;
    gst_event_parse_caps(event, &caps);
    if (!gst_video_info_from_caps(&s.info, caps))
      gst_video_info_init(&s.info);
  }
  gst_pad_push_event(self->src, event);
  lock.lock();
  s.pushing = false;
  if (eos && s.flow == GST_FLOW_OK)
    s.flow = GST_FLOW_EOS;
  s.changed.notify_all();
}

void loop(gpointer data) {
  GstTerrainCombine* self = self_of(data);
  CombineState& s = *self->state;
  Lock lock(s.mutex);
  s.changed.wait(lock, [&] { return s.flushing || !s.items.empty(); });
  if (!s.flushing) {
    if (s.items.front().is_frame())
      push_frame(self, lock);
    else
      push_event(self, lock);
  }
  if (s.flushing || s.flow != GST_FLOW_OK) {
    GST_DEBUG_OBJECT(self, "task pauses: %s", gst_flow_get_name(s.flow));
    gst_pad_pause_task(self->src);
  }
}

void guarded_loop(gpointer data) {
  const bool fine = guarded(data, false, [&] {
    loop(data);
    return true;
  });
  if (fine)
    return;
  CombineState& s = *self_of(data)->state;
  const Lock lock(s.mutex);
  s.flow = GST_FLOW_ERROR;
  s.pushing = false;
  s.changed.notify_all();
  gst_pad_pause_task(self_of(data)->src);
}

// ---- the video's side ------------------------------------------------------------------------------------

/// Whether the queue holds as much video as a frame may wait.
bool is_full(const CombineState& s) {
  if (s.items.size() >= most_items)
    return true;
  std::int64_t frames = 0;
  Time first = never, last = never;
  for (const Item& item : s.items)
    if (item.is_frame()) {
      ++frames;
      last = item.time;
      if (first == never)
        first = item.time;
    }
  if (frames < 3)
    return false;
  const Time latency = static_cast<Time>(s.latency_ms) * GST_MSECOND;
  // Time stamps that stand still must not fill the memory: at most twice the frames that the rate allows.
  const Time half_frame =
      s.frame_duration > 0 ? std::min(s.frame_duration / 2, most_tolerance) : default_tolerance;
  return first == never || last == never || last - first > latency ||
         frames * half_frame > latency + 4 * half_frame;
}

/// Waits until `done`, which is asked under the lock. Where this thread brings the units too, the task is
/// told that none will come meanwhile.
template <class Done> void wait_for_task(CombineState& s, Lock& lock, Done done) {
  if (done())
    return;
  s.feeder_waits = s.meta_thread == std::this_thread::get_id();
  s.changed.notify_all();
  s.changed.wait(lock, done);
  s.feeder_waits = false;
}

/// Gives the units without a PTS that wait for the first frame their times; where frames have stamps, others
/// stay as long as those of this moment. The caller holds the lock.
void place_units(CombineState& s) {
  for (UnitClock::Placed& placed : s.clock.place(s.stamps_came)) {
    const Time time = placed.time != never ? placed.time : std::max({s.newest_unit, s.newest_frame, Time{0}});
    s.newest_unit = std::max(s.newest_unit, placed.time);
    s.counts.unused +=
        s.units.add({time, time, placed.time_us, placed.time_us}, std::move(placed.unit), s.stamped);
  }
}

Match match_of(GstTerrainCombine* self) {
  ObjectLock lock(self);
  return self->state->settings.match;
}

GstFlowReturn take_frame(GstTerrainCombine* self, GstBuffer* frame) {
  CombineState& s = *self->state;
  const Match match = match_of(self);
  std::list<Item> item;
  item.push_back({std::unique_ptr<GstMiniObject, ObjectUnref>(GST_MINI_OBJECT_CAST(frame)), Clock::now(),
                  running_time(s.video_segment, GST_BUFFER_PTS(frame)),
                  match == Match::automatic ? stamp_of(frame) : std::nullopt, match});
  Lock lock(s.mutex);
  s.video_thread = std::this_thread::get_id();
  wait_for_task(s, lock, [&] { return s.flushing || s.flow != GST_FLOW_OK || !is_full(s); });
  if (s.flushing)
    return GST_FLOW_FLUSHING;
  if (s.flow != GST_FLOW_OK)
    return s.flow;
  if (GST_BUFFER_DURATION_IS_VALID(frame) && GST_BUFFER_DURATION(frame) > 0)
    s.frame_duration = static_cast<Time>(
        std::min(GST_BUFFER_DURATION(frame), static_cast<GstClockTime>(2 * most_tolerance)));
  s.newest_frame = std::max(s.newest_frame, item.front().time);
  const bool first_stamp = item.front().stamp && !std::exchange(s.stamps_came, true);
  if (s.clock.see_frame(item.front().time, s.frame_duration) || first_stamp)
    place_units(s);
  item.front().arrival = Clock::now();
  s.items.splice(s.items.end(), item);
  s.changed.notify_all();
  return GST_FLOW_OK;
}

GstFlowReturn video_chain(GstPad*, GstObject* parent, GstBuffer* frame) {
  return guarded(parent, GST_FLOW_ERROR, [&] { return take_frame(self_of(parent), frame); });
}

void flush_video(GstTerrainCombine* self, bool flushing) noexcept {
  CombineState& s = *self->state;
  const Lock lock(s.mutex);
  s.flushing = flushing;
  s.flow = flushing ? GST_FLOW_FLUSHING : GST_FLOW_OK;
  s.live_is_old = true;
  s.stamped = s.stamps_came = false;
  s.newest_frame = never;
  s.clock.reset();
  // What was queued before the flush is dropped on both of its sides.
  s.items.remove_if([](const Item& item) {
    return item.is_frame() || !has_flag(GST_EVENT(item.object.get()), GST_EVENT_TYPE_STICKY) ||
           GST_EVENT_TYPE(item.object.get()) == GST_EVENT_EOS ||
           GST_EVENT_TYPE(item.object.get()) == GST_EVENT_SEGMENT;
  });
  s.changed.notify_all();
}

/// While nobody is linked only the newest sticky event of a type is kept, for whoever comes.
bool keeps_unlinked(CombineState& s, GstEvent* event) {
  if (s.flow != GST_FLOW_NOT_LINKED || !has_flag(event, GST_EVENT_TYPE_STICKY))
    return false;
  s.items.remove_if(
      [&](const Item& item) { return GST_EVENT_TYPE(item.object.get()) == GST_EVENT_TYPE(event); });
  return true;
}

/// Why the event was not taken, as a flow: of a plain FALSE the pad that sends a sticky event again makes an
/// error, also while this element is only being stopped or flushed.
GstFlowReturn queue_event(GstTerrainCombine* self, GstEvent* event) {
  CombineState& s = *self->state;
  std::list<Item> item;
  item.push_back({std::unique_ptr<GstMiniObject, ObjectUnref>(GST_MINI_OBJECT_CAST(event)), Clock::now(),
                  never, std::nullopt, Match::automatic});
  GstFlowReturn flow = GST_FLOW_OK;
  const bool eos = GST_EVENT_TYPE(event) == GST_EVENT_EOS;
  {
    Lock lock(s.mutex);
    wait_for_task(s, lock,
                  [&] { return s.flushing || s.flow != GST_FLOW_OK || s.items.size() < most_items; });
    flow = s.flushing ? GST_FLOW_FLUSHING : s.flow;
    // After an end the next stream begins; the task has paused.
    if (GST_EVENT_TYPE(event) == GST_EVENT_STREAM_START) {
      s.live_is_old = true;
      if (flow == GST_FLOW_EOS && !s.flushing) {
        s.flow = flow = GST_FLOW_OK;
        gst_pad_start_task(self->src, guarded_loop, self, nullptr);
      }
    }
    if (flow == GST_FLOW_OK || keeps_unlinked(s, event)) {
      s.items.splice(s.items.end(), item);
      s.changed.notify_all();
      return GST_FLOW_OK;
    }
  }
  // Errors travel upstream with the next frame; at the end there is none.
  if (eos && (flow == GST_FLOW_NOT_LINKED || flow < GST_FLOW_EOS))
    GST_ELEMENT_FLOW_ERROR(self, flow);
  return flow;
}

/// Downstream has changed: it may be linked again.
void resume(GstTerrainCombine* self) {
  CombineState& s = *self->state;
  const Lock lock(s.mutex);
  ++s.reconfigured;
  if (s.flow != GST_FLOW_NOT_LINKED || s.flushing)
    return;
  GST_DEBUG_OBJECT(self, "linked again, frames go on");
  s.flow = GST_FLOW_OK;
  gst_pad_start_task(self->src, guarded_loop, self, nullptr);
}

/// The caps' frame rate, as soon as they come: the task sees them later.
void note_caps(CombineState& s, GstEvent* event) {
  GstCaps* caps = nullptr;
  gst_event_parse_caps(event, &caps);
  GstVideoInfo info;
  if (!gst_video_info_from_caps(&info, caps))
    return;
  const Lock lock(s.mutex);
  s.frame_duration = duration_of(info);
}

GstFlowReturn flow_of(gboolean done) {
  return done ? GST_FLOW_OK : GST_FLOW_ERROR;
}

GstFlowReturn video_event(GstPad* pad, GstObject* parent, GstEvent* event) {
  GstTerrainCombine* self = self_of(parent);
  CombineState& s = *self->state;
  switch (GST_EVENT_TYPE(event)) {
  case GST_EVENT_FLUSH_START: {
    const gboolean pushed = gst_pad_push_event(self->src, event);
    flush_video(self, true);
    gst_pad_pause_task(self->src);
    return flow_of(pushed);
  }
  case GST_EVENT_FLUSH_STOP: {
    gst_segment_init(&s.video_segment, GST_FORMAT_TIME);
    const gboolean pushed = gst_pad_push_event(self->src, event);
    flush_video(self, false);
    if (GST_PAD_IS_ACTIVE(self->src))
      gst_pad_start_task(self->src, guarded_loop, self, nullptr);
    return flow_of(pushed);
  }
  case GST_EVENT_SEGMENT:
    gst_event_copy_segment(event, &s.video_segment);
    break;
  case GST_EVENT_CAPS:
    note_caps(s, event);
    break;
  default:
    break;
  }
  if (!has_flag(event, GST_EVENT_TYPE_SERIALIZED))
    return flow_of(gst_pad_event_default(pad, parent, event));
  return guarded(self, GST_FLOW_ERROR, [&] { return queue_event(self, event); });
}

/// Frames that wait here at most: they are not in the hands of downstream, but not upstream's either.
guint held_frames(const CombineState& s, GstQuery* query) {
  GstCaps* caps = nullptr;
  gst_query_parse_allocation(query, &caps, nullptr);
  GstVideoInfo info;
  Time duration = 0;
  if (caps && gst_video_info_from_caps(&info, caps))
    duration = duration_of(info);
  if (duration <= 0)
    duration = 2 * default_tolerance;
  return static_cast<guint>(static_cast<Time>(s.latency_ms) * GST_MSECOND / duration + 2);
}

/// Adds the frames that wait here to what downstream wants of a pool.
gboolean query_allocation(GstTerrainCombine* self, GstQuery* query) {
  gst_pad_peer_query(self->src, query); // nobody's answer is an answer without pools
  const guint held = held_frames(*self->state, query);
  const guint pools = gst_query_get_n_allocation_pools(query);
  for (guint i = 0; i < pools; ++i) {
    GstBufferPool* pool = nullptr;
    guint size = 0, least = 0, most = 0;
    gst_query_parse_nth_allocation_pool(query, i, &pool, &size, &least, &most);
    gst_query_set_nth_allocation_pool(query, i, pool, size, least + held, most > 0 ? most + held : 0);
    gst_clear_object(&pool);
  }
  if (pools == 0) {
    GstCaps* caps = nullptr;
    gst_query_parse_allocation(query, &caps, nullptr);
    GstVideoInfo info;
    const guint size =
        caps && gst_video_info_from_caps(&info, caps) ? static_cast<guint>(GST_VIDEO_INFO_SIZE(&info)) : 0;
    gst_query_add_allocation_pool(query, nullptr, size, held, 0);
  }
  return TRUE;
}

gboolean video_query(GstPad* pad, GstObject* parent, GstQuery* query) {
  GstTerrainCombine* self = self_of(parent);
  CombineState& s = *self->state;
  if (!(gst_query_type_get_flags(GST_QUERY_TYPE(query)) & GST_QUERY_TYPE_SERIALIZED))
    return gst_pad_query_default(pad, parent, query);
  {
    // In order: what came before it has left.
    Lock lock(s.mutex);
    wait_for_task(s, lock,
                  [&] { return s.flushing || s.flow != GST_FLOW_OK || (s.items.empty() && !s.pushing); });
    if (s.flushing || s.flow != GST_FLOW_OK)
      return FALSE;
  }
  if (GST_QUERY_TYPE(query) == GST_QUERY_ALLOCATION)
    return query_allocation(self, query);
  return gst_pad_peer_query(self->src, query);
}

gboolean video_activate(GstPad*, GstObject* parent, GstPadMode mode, gboolean active) {
  GstTerrainCombine* self = self_of(parent);
  if (mode != GST_PAD_MODE_PUSH)
    return FALSE;
  flush_video(self, !active);
  if (!active) {
    const Lock lock(self->state->mutex);
    self->state->items.clear();
  }
  return TRUE;
}

// ---- the units' side -------------------------------------------------------------------------------------

/// Something of the units' way has come. The caller holds the lock.
void note_meta(CombineState& s) {
  s.meta_thread = std::this_thread::get_id();
  s.meta_came = Clock::now();
}

bool has_room(const CombineState& s) {
  return s.units.size() + s.clock.waiting() < most_units &&
         s.units.bytes() + s.clock.waiting_bytes() < most_unit_bytes;
}

/// Waits for room as long as the video moves on (live: for a moment), then drops the oldest.
void make_room(CombineState& s, Lock& lock) {
  const bool alone = s.video_thread == std::thread::id() || s.video_thread == std::this_thread::get_id();
  while (!alone && !has_room(s) && !s.meta_flushing && s.flow == GST_FLOW_OK) {
    const std::uint64_t frames = s.frames_left;
    const Clock::duration limit =
        s.live == Live::no ? Clock::duration(stall_limit)
                           : Clock::duration(std::chrono::milliseconds(std::max<guint>(s.latency_ms, 1000)));
    if (!s.changed.wait_for(lock, limit,
                            [&] {
                              return s.meta_flushing || s.flow != GST_FLOW_OK || has_room(s) ||
                                     s.frames_left != frames;
                            }) ||
        s.live != Live::no)
      break;
  }
  while (!has_room(s) && s.units.size() + s.clock.waiting() > 0)
    s.counts.unused += s.units.size() > 0 ? s.units.drop_oldest() : s.clock.drop_oldest();
}

/// Once: the units are matched by less than a time stamp of the stream.
void tell_timeless(GstTerrainCombine* self, Lock& lock) {
  if (std::exchange(self->state->told_timeless, true))
    return;
  lock.unlock();
  GST_ELEMENT_WARNING(
      self, STREAM, FORMAT,
      ("The KLV units carry no time stamps: they are matched by the times in themselves, the first with the "
       "first frame. Where the two streams do not begin together, masks lie on wrong frames: mux them with "
       "time stamps (mpegtsmux keeps those of terrainextract; \"ffmpeg -c copy\" loses them)."),
      ("units without PTS, or in a segment that is not in time"));
  lock.lock();
}

void keep_unit(GstTerrainCombine* self, OwnedBuffer unit) {
  CombineState& s = *self->state;
  const Time time = running_time(s.meta_segment, GST_BUFFER_PTS(unit.get()));
  // Units behind an encoder with B-frames come in coding order: only their DTS tells what cannot come any
  // more.
  const Time decoding = running_time(s.meta_segment, GST_BUFFER_DTS(unit.get()));
  GstMapInfo map;
  if (!gst_buffer_map(unit.get(), &map, GST_MAP_READ))
    return reject(self, "damaged", "its memory cannot be read");
  const KlvVerdict verdict = s.checked.decode({map.data, map.size});
  gst_buffer_unmap(unit.get(), &map);
  {
    const Lock lock(s.mutex);
    note_meta(s);
  }
  GST_LOG_OBJECT(self, "unit of %" G_GSIZE_FORMAT " bytes: %" GST_PTR_FORMAT, map.size,
                 printable(unit.get()));
  if (verdict != KlvVerdict::ok)
    return reject(self, verdict == KlvVerdict::foreign ? "foreign" : "damaged", s.checked.error());

  Lock lock(s.mutex);
  s.meta_stalled = false;
  s.meta_eos = false;
  ++s.silent_units;
  if (!has_room(s))
    make_room(s, lock);
  if (time == never) {
    if (s.newest_frame != never && !s.stamps_came)
      tell_timeless(self, lock);
    s.clock.add({s.checked.time_us(), s.checked.estimate().frame}, std::move(unit));
    place_units(s);
  } else {
    s.newest_unit = std::max(s.newest_unit, time);
    const Time progress = decoding != never ? std::min(decoding, time) : time;
    const PrecisionTime precision = s.checked.time_us();
    const PrecisionTime ahead = static_cast<PrecisionTime>(time - progress) / GST_USECOND;
    s.counts.unused += s.units.add({time, progress, precision, precision - std::min(precision, ahead)},
                                   std::move(unit), s.stamped);
  }
  s.changed.notify_all();
}

GstFlowReturn meta_chain(GstPad*, GstObject* parent, GstBuffer* buffer) {
  OwnedBuffer unit(buffer);
  return guarded(parent, GST_FLOW_ERROR, [&] {
    GstTerrainCombine* self = self_of(parent);
    keep_unit(self, std::move(unit));
    const Lock lock(self->state->mutex);
    return self->state->meta_flushing ? GST_FLOW_FLUSHING : GST_FLOW_OK;
  });
}

void flush_meta(GstTerrainCombine* self, bool flushing) noexcept {
  CombineState& s = *self->state;
  const Lock lock(s.mutex);
  s.meta_flushing = flushing;
  s.meta_eos = s.meta_stalled = false;
  s.newest_unit = never;
  s.live_is_old = true;
  s.units.clear();
  s.clock.forget_units();
  s.changed.notify_all();
}

/// Where the units are, although none has come.
void take_gap(CombineState& s, GstEvent* event) {
  GstClockTime start = GST_CLOCK_TIME_NONE, duration = GST_CLOCK_TIME_NONE;
  gst_event_parse_gap(event, &start, &duration);
  if (GST_CLOCK_TIME_IS_VALID(start) && GST_CLOCK_TIME_IS_VALID(duration))
    start = duration < GST_CLOCK_TIME_NONE - start ? start + duration : GST_CLOCK_TIME_NONE;
  const Time time = running_time(s.meta_segment, start);
  const Lock lock(s.mutex);
  if (time != never)
    s.units.advance(time);
  ++s.silent_gaps;
  s.changed.notify_all();
}

/// Nothing of the units' stream goes on: the video's events are the output's.
gboolean meta_event(GstPad*, GstObject* parent, GstEvent* event) {
  GstTerrainCombine* self = self_of(parent);
  CombineState& s = *self->state;
  {
    const Lock lock(s.mutex);
    note_meta(s);
  }
  switch (GST_EVENT_TYPE(event)) {
  case GST_EVENT_FLUSH_START:
    flush_meta(self, true);
    break;
  case GST_EVENT_FLUSH_STOP:
    gst_segment_init(&s.meta_segment, GST_FORMAT_TIME);
    flush_meta(self, false);
    break;
  case GST_EVENT_SEGMENT:
    gst_event_copy_segment(event, &s.meta_segment);
    break;
  case GST_EVENT_GAP:
    take_gap(s, event);
    break;
  case GST_EVENT_STREAM_START: {
    const Lock lock(s.mutex);
    s.meta_eos = s.meta_stalled = false;
    s.live_is_old = true;
    break;
  }
  case GST_EVENT_EOS: {
    const Lock lock(s.mutex);
    s.meta_eos = true;
    s.changed.notify_all();
    break;
  }
  default:
    break;
  }
  gst_event_unref(event);
  return TRUE;
}

gboolean meta_query(GstPad* pad, GstObject* parent, GstQuery* query) {
  if (GST_QUERY_TYPE(query) == GST_QUERY_ALLOCATION)
    return FALSE;
  return gst_pad_query_default(pad, parent, query);
}

gboolean meta_activate(GstPad*, GstObject* parent, GstPadMode mode, gboolean active) {
  if (mode != GST_PAD_MODE_PUSH)
    return FALSE;
  flush_meta(self_of(parent), !active);
  return TRUE;
}

// ---- the output's side -----------------------------------------------------------------------------------

gboolean src_activate(GstPad* pad, GstObject* parent, GstPadMode mode, gboolean active) {
  GstTerrainCombine* self = self_of(parent);
  if (mode != GST_PAD_MODE_PUSH)
    return FALSE;
  flush_video(self, !active);
  return active ? gst_pad_start_task(pad, guarded_loop, self, nullptr) : gst_pad_stop_task(pad);
}

gboolean query_latency(GstTerrainCombine* self, GstQuery* query) {
  gboolean live = FALSE;
  GstClockTime least = 0, most = GST_CLOCK_TIME_NONE;
  bool answered = false;
  for (GstPad* pad : {self->sink, self->meta}) {
    GstQuery* upstream = gst_query_new_latency();
    if (gst_pad_peer_query(pad, upstream)) {
      gboolean pad_live = FALSE;
      GstClockTime pad_least = 0, pad_most = GST_CLOCK_TIME_NONE;
      gst_query_parse_latency(upstream, &pad_live, &pad_least, &pad_most);
      answered = answered || pad == self->sink;
      if (pad_live) {
        live = TRUE;
        least = std::max(least, pad_least);
        most = std::min(most, pad_most); // NONE is the largest number
      }
    }
    gst_query_unref(upstream);
  }
  if (!answered)
    return FALSE;
  const GstClockTime own = self->state->latency_ms * GST_MSECOND;
  if (live) {
    least += own;
    if (GST_CLOCK_TIME_IS_VALID(most))
      most += own;
  }
  gst_query_set_latency(query, live, least, most);
  return TRUE;
}

gboolean src_query(GstPad* pad, GstObject* parent, GstQuery* query) {
  if (GST_QUERY_TYPE(query) == GST_QUERY_LATENCY)
    return query_latency(self_of(parent), query);
  return gst_pad_query_default(pad, parent, query);
}

gboolean src_event(GstPad* pad, GstObject* parent, GstEvent* event) {
  GstTerrainCombine* self = self_of(parent);
  // Units must follow where the video goes, also when they come from a source of their own; a source that is
  // told the latency waits by it.
  const GstEventType type = GST_EVENT_TYPE(event);
  if ((type == GST_EVENT_SEEK || type == GST_EVENT_LATENCY) && gst_pad_is_linked(self->meta))
    gst_pad_push_event(self->meta, gst_event_ref(event));
  if (type == GST_EVENT_RECONFIGURE)
    resume(self);
  return gst_pad_event_default(pad, parent, event);
}

/// Video in and video out belong together; the units are an end.
GstIterator* internal_links(GstPad* pad, GstObject* parent) {
  GstTerrainCombine* self = self_of(parent);
  GstPad* other = pad == self->src ? self->sink : pad == self->sink ? self->src : nullptr;
  if (!other)
    return nullptr;
  GValue value = G_VALUE_INIT;
  g_value_init(&value, GST_TYPE_PAD);
  g_value_set_object(&value, other);
  GstIterator* iterator = gst_iterator_new_single(GST_TYPE_PAD, &value);
  g_value_unset(&value);
  return iterator;
}

// ---- the object ------------------------------------------------------------------------------------------

GstStateChangeReturn change_state(GstElement* element, GstStateChange transition) {
  CombineState& s = *self_of(element)->state;
  if (transition == GST_STATE_CHANGE_READY_TO_PAUSED) {
    const Lock lock(s.mutex);
    s.counts = {};
    s.live = Live::unknown;
    s.video_thread = s.meta_thread = {};
    s.ever_warned = s.told_silence = s.told_timeless = false;
    s.silent_frames = s.silent_units = s.silent_gaps = 0;
  }
  const GstStateChangeReturn result =
      GST_ELEMENT_CLASS(gst_terrain_combine_parent_class)->change_state(element, transition);
  if (transition == GST_STATE_CHANGE_PAUSED_TO_READY) {
    s.masks.drop();
    s.boundaries.drop();
    gst_segment_init(&s.video_segment, GST_FORMAT_TIME);
    gst_segment_init(&s.meta_segment, GST_FORMAT_TIME);
  }
  return result;
}

void set_property(GObject* object, guint id, const GValue* value, GParamSpec* spec) {
  if (id == property_match) {
    ObjectLock lock(object);
    set_field(combine_table[0], self_of(object)->state->settings, value);
    return;
  }
  if (id != property_latency) {
    G_OBJECT_WARN_INVALID_PROPERTY_ID(object, id, spec);
    return;
  }
  self_of(object)->state->latency_ms = g_value_get_uint(value);
  gst_element_post_message(GST_ELEMENT(object), gst_message_new_latency(GST_OBJECT(object)));
}

void get_property(GObject* object, guint id, GValue* value, GParamSpec* spec) {
  CombineState& s = *self_of(object)->state;
  if (id == property_latency)
    g_value_set_uint(value, s.latency_ms);
  else if (id == property_stats) {
    Counts counts;
    {
      const Lock lock(s.mutex);
      counts = s.counts;
    }
    g_value_take_boxed(value,
                       gst_structure_new("terraincombine-stats", "matched", G_TYPE_UINT64,
                                         static_cast<guint64>(counts.matched), "matched-precisely",
                                         G_TYPE_UINT64, static_cast<guint64>(counts.precise), "lost",
                                         G_TYPE_UINT64, static_cast<guint64>(counts.lost), "rejected",
                                         G_TYPE_UINT64, static_cast<guint64>(counts.rejected), "unused",
                                         G_TYPE_UINT64, static_cast<guint64>(counts.unused), nullptr));
  } else if (id == property_match) {
    ObjectLock lock(object);
    get_field(combine_table[0], s.settings, value);
  } else
    G_OBJECT_WARN_INVALID_PROPERTY_ID(object, id, spec);
}

} // namespace

static void gst_terrain_combine_class_init(GstTerrainCombineClass* klass) {
  GST_DEBUG_CATEGORY_INIT(terraincombine_debug, "terraincombine", 0, "terrain metadata from KLV");
  GObjectClass* object_class = G_OBJECT_CLASS(klass);
  object_class->set_property = set_property;
  object_class->get_property = get_property;
  object_class->finalize = finalize_state<GstTerrainCombine, gst_terrain_combine_parent_class>;
  g_object_class_install_property(
      object_class, property_latency,
      g_param_spec_uint(
          "latency", "Latency",
          "Milliseconds that a frame of a live pipeline waits at most for its KLV unit, by which the "
          "pipeline is "
          "delayed; in others how much video may wait",
          0, 60000, default_latency,
          static_cast<GParamFlags>(G_PARAM_READWRITE | G_PARAM_STATIC_STRINGS | GST_PARAM_MUTABLE_PLAYING)));
  g_object_class_install_property(
      object_class, property_stats,
      g_param_spec_boxed(
          "stats", "Statistics",
          "Counts since the start: frames matched (of those, by precision time: matched-precisely) and lost, "
          "KLV units rejected and unused",
          GST_TYPE_STRUCTURE, static_cast<GParamFlags>(G_PARAM_READABLE | G_PARAM_STATIC_STRINGS)));
  install_properties<CombineSettings>(object_class, property_match, combine_table);
  mark_enums_as_plugin_api(object_class);
  GstElementClass* element_class = GST_ELEMENT_CLASS(klass);
  element_class->change_state = change_state;
  gst_element_class_add_static_pad_template(element_class, &sink_template);
  gst_element_class_add_static_pad_template(element_class, &meta_template);
  gst_element_class_add_static_pad_template(element_class, &src_template);
  gst_element_class_set_static_metadata(
      element_class, "Terrain combiner", "Combiner/Metadata/Video",
      "Attaches the terrain metadata in KLV units to the video they belong to", "terrainseg maintainers");
}

static void gst_terrain_combine_init(GstTerrainCombine* self) {
  self->state.make();
  self->sink = gst_pad_new_from_static_template(&sink_template, "sink");
  gst_pad_set_chain_function(self->sink, video_chain);
  gst_pad_set_event_full_function(self->sink, video_event);
  gst_pad_set_query_function(self->sink, video_query);
  gst_pad_set_activatemode_function(self->sink, video_activate);
  gst_pad_set_iterate_internal_links_function(self->sink, internal_links);
  GST_PAD_SET_PROXY_CAPS(self->sink);
  gst_element_add_pad(GST_ELEMENT(self), self->sink);
  self->meta = gst_pad_new_from_static_template(&meta_template, "meta");
  gst_pad_set_chain_function(self->meta, meta_chain);
  gst_pad_set_event_function(self->meta, meta_event);
  gst_pad_set_query_function(self->meta, meta_query);
  gst_pad_set_activatemode_function(self->meta, meta_activate);
  gst_pad_set_iterate_internal_links_function(self->meta, internal_links);
  gst_element_add_pad(GST_ELEMENT(self), self->meta);
  self->src = gst_pad_new_from_static_template(&src_template, "src");
  gst_pad_set_activatemode_function(self->src, src_activate);
  gst_pad_set_event_function(self->src, src_event);
  gst_pad_set_query_function(self->src, src_query);
  gst_pad_set_iterate_internal_links_function(self->src, internal_links);
  GST_PAD_SET_PROXY_CAPS(self->src);
  gst_element_add_pad(GST_ELEMENT(self), self->src);
}
