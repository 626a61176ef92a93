// SPDX-License-Identifier: LGPL-2.1-or-later
// The base class holds the video: the queue of its frames, serialized events and serialized queries, the task
// that takes them out in order, and flushes. Its other rules are those of a mixer and are replaced:
//
// * It waits for a buffer on every pad. Here units go to the Matcher, and the base class is told that `meta`
//   has ended. aggregate() waits for the unit of the frame in front.
// * It blocks a pad that is ahead of the others, for ever if one thread feeds both. Here the chain function
//   of the video waits itself, and knows whether its thread brings the units too.
// * A bad flow and EOS are final. Here aggregate() returns OK, and the state keeps the flow of the last push,
//   so that frames go on when the source pad is linked again or a new stream begins.
// * It sends a stream-start and a segment of its own, and answers seeks itself. Here the video's events and
//   frames are pushed as they are, and seeks go upstream as they are.

#include <gst/base/gstaggregator.h>
#include <gst/video/video.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <list>
#include <memory>
#include <optional>
#include <string>
#include <thread>
#include <utility>

#include "elements/terraincombine/matcher.hpp"
#include "elements/terraincombine/unit_attacher.hpp"
#include "exchange/vmti_klv.hpp"
#include "support/buffers.hpp"
#include "support/element.hpp"
#include "support/mutex.hpp"
#include "support/times.hpp"

GST_DEBUG_CATEGORY_STATIC(terraincombine_debug);
#define GST_CAT_DEFAULT terraincombine_debug

using namespace terrainseg;

namespace {

using Clock = Matcher::Clock;

struct CombineSettings {
  std::atomic<guint> latency_ms = 200;
  std::atomic<Match> match = Match::automatic;
};

/// Largest time difference between a frame and its unit when the frame rate is unknown: RTP rounds to 1 ms,
/// MPEG-TS to 11 us.
constexpr Time default_tolerance = 10 * GST_MSECOND;
/// Longer durations are invalid.
constexpr Time most_tolerance = 1800 * Time{GST_SECOND};

/// What is known of a frame that the base class holds.
struct Waiting {
  Clock::time_point arrival;
  Matcher::Frame frame;
};

/// Largest number of waiting frames and events; events alone (GAP) count too, to limit the memory.
constexpr std::size_t most_items = 4096;
/// Name of the event that carries a SEGMENT through the queue of the base class, which would ask the segment
/// for running times. Not every segment has them; GStreamer logs a critical then.
constexpr const char* carrier = "terraincombine-segment";

/// Half a frame: nearer to it than to its neighbours. `duration` 0 = unknown.
Time half_of(Time duration) {
  return duration > 0 ? std::min(duration / 2, most_tolerance) : default_tolerance;
}

/// Everything behind the instance.
struct CombineState {
  GstElement* element = nullptr;
  GstPad *sink = nullptr, *meta = nullptr, *src = nullptr;
  GstPadChainFunction base_chain = nullptr;           ///< of `sink`, the base class's
  GstPadActivateModeFunction base_activate = nullptr; ///< the same
  CombineSettings settings;                           ///< read by any thread
  std::atomic<bool> base_flushes = false;             ///< the base class waits for FLUSH_STOP

  Mutex mutex;                     ///< held for moments only, never while a frame is processed
  std::condition_variable changed; ///< any of what follows
  std::list<Waiting>
      queue TERRAINSEG_GUARDED_BY(mutex);              ///< one entry for each frame that the base class holds
  std::size_t events TERRAINSEG_GUARDED_BY(mutex) = 0; ///< number that it holds
  Matcher matcher TERRAINSEG_GUARDED_BY(mutex);
  bool live_is_old TERRAINSEG_GUARDED_BY(mutex) = true;      ///< to be asked before the next frame waits
  unsigned reconfigured TERRAINSEG_GUARDED_BY(mutex) = 0;    ///< counts RECONFIGURE events from downstream
  bool meta_flushing TERRAINSEG_GUARDED_BY(mutex) = true;    ///< the units are
  bool feeder_waits TERRAINSEG_GUARDED_BY(mutex) = false;    ///< the thread that brings the units waits
  std::thread::id video_thread TERRAINSEG_GUARDED_BY(mutex); ///< that brought the last frame
  std::thread::id meta_thread TERRAINSEG_GUARDED_BY(mutex);  ///< that brought the last unit or event of units
  std::uint64_t frames_left TERRAINSEG_GUARDED_BY(mutex) = 0; ///< counts frames that the task took
  Time frame_duration TERRAINSEG_GUARDED_BY(mutex) = 0;       ///< of the caps or the last frame; 0 = unknown
  std::optional<Clock::time_point> warned TERRAINSEG_GUARDED_BY(mutex); ///< of a unit that was rejected
  /// FLUSHING, or of the last push. When it is not OK no frame is taken, and those that wait are dropped.
  GstFlowReturn flow TERRAINSEG_GUARDED_BY(mutex) = GST_FLOW_FLUSHING;

  GstSegment video_segment = in_time(); ///< the video's chain
  GstSegment meta_segment = in_time();  ///< the units' chain
  KlvUnit checked;                      ///< the units' chain
  UnitAttacher attacher;                ///< the task

  CombineState() noexcept = default;
  Clock::duration latency() const { return std::chrono::milliseconds(settings.latency_ms); }
  GstAggregator* base() const { return GST_AGGREGATOR(element); }
  bool takes_events() const TERRAINSEG_REQUIRES(mutex) { return queue.size() + events < most_items; }
  /// Whether less video waits than a frame may wait.
  bool takes_frames() const TERRAINSEG_REQUIRES(mutex) {
    if (queue.size() < 3 || !takes_events())
      return takes_events();
    // Time stamps that stand still must not fill the memory: at most twice the frames that the rate allows.
    const Time longest = static_cast<Time>(settings.latency_ms) * GST_MSECOND,
               half_frame = half_of(frame_duration);
    const Time first = queue.front().frame.time, last = queue.back().frame.time;
    return first != never && last != never && last - first <= longest &&
           static_cast<Time>(queue.size()) * half_frame <= longest + 4 * half_frame;
  }
  bool lacks_room() const TERRAINSEG_REQUIRES(mutex) {
    return !matcher.has_room() && !meta_flushing && flow == GST_FLOW_OK;
  }
  /// Discards what is known of the frames. FLUSHING refuses the next ones, OK accepts them.
  void reset(GstFlowReturn new_flow) TERRAINSEG_REQUIRES(mutex) {
    flow = new_flow;
    live_is_old = true;
    matcher.flush_frames();
    changed.notify_all();
  }
  /// Something of the units has come.
  void note_meta() TERRAINSEG_REQUIRES(mutex) {
    meta_thread = std::this_thread::get_id();
    matcher.note_unit_side(Clock::now());
  }
  /// The thread that brings video waits for the task. Where it brings the units too, the task does not wait
  /// for them meanwhile.
  void note_wait(bool begins) TERRAINSEG_REQUIRES(mutex) {
    feeder_waits = begins && meta_thread == std::this_thread::get_id();
    changed.notify_all();
  }
  /// Waits until the flow is not OK, or `takes`. Returns the flow.
  GstFlowReturn wait_for_task(Lock& lock, bool (CombineState::*takes)() const) TERRAINSEG_REQUIRES(mutex) {
    if (flow != GST_FLOW_OK || (this->*takes)())
      return flow;
    note_wait(true);
    while (flow == GST_FLOW_OK && !(this->*takes)())
      lock.wait(changed);
    note_wait(false);
    return flow;
  }
};
static_assert(std::is_nothrow_default_constructible_v<UnitStore> &&
              std::is_nothrow_default_constructible_v<UnitClock> &&
              std::is_nothrow_default_constructible_v<KlvUnit> &&
              std::is_nothrow_default_constructible_v<std::list<Waiting>>);

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
using GstTerrainCombine = Instance<GstAggregator, CombineState>;
using GstTerrainCombineClass = GstAggregatorClass;

G_DEFINE_TYPE(GstTerrainCombine, gst_terrain_combine, GST_TYPE_AGGREGATOR)

GstAggregatorClass* base_class() {
  return GST_AGGREGATOR_CLASS(gst_terrain_combine_parent_class);
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

/// Of a frame; 0 when it does not say.
Time duration_of(const GstBuffer* frame) {
  const GstClockTime duration = GST_BUFFER_DURATION(frame);
  return GST_CLOCK_TIME_IS_VALID(duration)
             ? static_cast<Time>(std::min<GstClockTime>(duration, 2 * most_tolerance))
             : 0;
}

/// Of a frame; 0 when the caps do not say.
Time duration_of(const GstVideoInfo& info) {
  if (GST_VIDEO_INFO_FPS_N(&info) <= 0 || GST_VIDEO_INFO_FPS_D(&info) <= 0)
    return 0;
  return static_cast<Time>(
      gst_util_uint64_scale_int(GST_SECOND, GST_VIDEO_INFO_FPS_D(&info), GST_VIDEO_INFO_FPS_N(&info)));
}

// ---- warnings --------------------------------------------------------------------------------------------

void reject(CombineState& s, const char* kind, const std::string& error) {
  std::uint64_t count = 0;
  GST_WARNING_OBJECT(s.element, "KLV unit skipped: %s", error.c_str());
  {
    const Lock lock(s.mutex);
    count = s.matcher.reject_unit();
    // On a bad link this comes many times a second; it is reported once a second.
    const Clock::time_point now = Clock::now();
    if (s.warned && now - *s.warned < std::chrono::seconds(1))
      return;
    s.warned = now;
  }
  GST_ELEMENT_WARNING(s.element, STREAM, DECODE,
                      ("A %s KLV unit was skipped (%" G_GUINT64_FORMAT " so far): %s.", kind,
                       static_cast<guint64>(count), error.c_str()),
                      ("%s", error.c_str()));
}

// ---- the task --------------------------------------------------------------------------------------------

/// What the two upstreams say together, and our own latency. False when the video's does not answer.
bool query_latency(CombineState& s, GstQuery* query) {
  bool answered = false, live = false;
  GstClockTime least = 0, most = GST_CLOCK_TIME_NONE;
  for (GstPad* pad : {s.sink, s.meta}) {
    g_autoptr(GstPad) peer = gst_pad_get_peer(pad);
    g_autoptr(GstQuery) upstream = gst_query_new_latency();
    gboolean its_live = FALSE;
    GstClockTime its_least = 0, its_most = GST_CLOCK_TIME_NONE;
    if (peer && gst_pad_query(peer, upstream)) {
      gst_query_parse_latency(upstream, &its_live, &its_least, &its_most);
      answered = answered || pad == s.sink;
    }
    if (its_live) {
      live = true;
      least = std::max(least, its_least);
      most = std::min(most, its_most); // NONE is the largest number
    }
  }
  const GstClockTime own = live ? s.settings.latency_ms * GST_MSECOND : 0;
  gst_query_set_latency(query, live, least + own, GST_CLOCK_TIME_IS_VALID(most) ? most + own : most);
  return answered;
}

/// One that does not answer is taken for live, so that no frame waits longer than `latency`.
Live ask_upstream(CombineState& s) {
  g_autoptr(GstQuery) query = gst_query_new_latency();
  gboolean live = TRUE;
  if (query_latency(s, query))
    gst_query_parse_latency(query, &live, nullptr, nullptr);
  return live ? Live::yes : Live::no;
}

/// Waits for the unit of the frame in front, as long as the flow is OK.
OwnedBuffer wait_for_unit(CombineState& s, Lock& lock, const Waiting& next) TERRAINSEG_REQUIRES(s.mutex) {
  const Clock::time_point since = Clock::now();
  s.matcher.begin_frame(next.frame);
  while (s.flow == GST_FLOW_OK) {
    // One thread for both pads, not live: while it waits for room in the queue it brings no units.
    const bool in_vain = s.meta_flushing || s.feeder_waits || !gst_pad_is_linked(s.meta);
    Matcher::Answer answer =
        s.matcher.look_for(next.frame, {next.arrival, since, s.latency(), in_vain}, Clock::now());
    if (answer.dropped > 0)
      s.changed.notify_all(); // there is room
    if (answer.is_final)
      return std::move(answer.unit);
    lock.wait_until(s.changed, answer.until);
  }
  return nullptr;
}

void push_frame(CombineState& s, OwnedBuffer frame, const Matcher::Frame& times, const OwnedBuffer& unit) {
  bool matched = unit != nullptr;
  if (matched)
    if (const std::string flaw = s.attacher.decode(unit.get()); !flaw.empty()) {
      matched = false;
      reject(s, "useless", flaw);
    }
  std::string reason;
  unsigned reconfigured = 0;
  {
    const Lock lock(s.mutex);
    reason = s.matcher.end_frame(times, matched, s.latency());
    reconfigured = s.reconfigured;
  }
  GST_LOG_OBJECT(s.element, "%s: %" GST_PTR_FORMAT, matched ? "with its unit" : "without a unit",
                 printable(frame.get()));
  if (!reason.empty() && gst_pad_is_linked(s.meta))
    GST_ELEMENT_WARNING(
        s.element, STREAM, FAILED,
        ("No KLV unit matched the last %u frames: %s.", Matcher::silence_frames, reason.c_str()),
        ("%s", reason.c_str()));
  if (matched)
    frame.reset(s.attacher.attach(frame.release()));
  const GstFlowReturn flow = gst_pad_push(s.src, frame.release());
  const Lock lock(s.mutex);
  // Where the pad was linked during this push NOT_LINKED is not kept: the next frame arrives.
  if (s.flow == GST_FLOW_OK && !(flow == GST_FLOW_NOT_LINKED && s.reconfigured != reconfigured))
    s.flow = flow;
  s.changed.notify_all();
}

/// The base class has a frame. It leaves with or without its unit; when the flow is not OK it is dropped.
GstFlowReturn aggregate(CombineState& s, gboolean) {
  const bool fine = guarded(s.element, false, [&s] {
    OwnedBuffer frame(gst_aggregator_pad_pop_buffer(GST_AGGREGATOR_PAD(s.sink)));
    Lock lock(s.mutex);
    if (std::exchange(s.live_is_old, false)) {
      lock.unlock();
      const Live live = ask_upstream(s);
      lock.lock();
      s.matcher.set_live(live);
    }
    if (s.queue.empty()) // a flush has begun
      return true;
    const Waiting next = s.queue.front();
    const OwnedBuffer unit = wait_for_unit(s, lock, next);
    const bool leaves = frame && s.flow == GST_FLOW_OK;
    if (!s.queue.empty())
      s.queue.pop_front();
    ++s.frames_left;
    s.changed.notify_all();
    lock.unlock();
    if (leaves)
      push_frame(s, std::move(frame), next.frame, unit);
    return true;
  });
  if (!fine) {
    const Lock lock(s.mutex);
    s.flow = GST_FLOW_ERROR;
    s.changed.notify_all();
  }
  return GST_FLOW_OK;
}

/// A serialized event of the video, in its turn.
gboolean sink_event(CombineState& s, GstAggregatorPad*, GstEvent* event) {
  GstEvent* segment = nullptr;
  if (gst_event_has_name(event, carrier) &&
      gst_structure_get(gst_event_get_structure(event), "event", GST_TYPE_EVENT, &segment, nullptr))
    gst_event_unref(std::exchange(event, segment));
  GST_DEBUG_OBJECT(s.element, "in turn: %" GST_PTR_FORMAT, printable(event));
  if (GST_EVENT_TYPE(event) == GST_EVENT_CAPS) {
    GstCaps* caps = nullptr;
    gst_event_parse_caps(event, &caps);
    s.attacher.set_video(caps);
  }
  const bool eos = GST_EVENT_TYPE(event) == GST_EVENT_EOS;
  GstFlowReturn flow = GST_FLOW_OK;
  {
    Lock lock(s.mutex);
    while (eos && s.flow == GST_FLOW_NOT_LINKED) // it is for a peer that is linked later
      lock.wait(s.changed);
    flow = s.flow;
    s.events -= s.events > 0; // after a flush the base class still holds sticky ones
    s.changed.notify_all();
  }
  // Errors travel upstream with the next frame; at the end there is none.
  if (eos && flow < GST_FLOW_EOS)
    GST_ELEMENT_FLOW_ERROR(s.element, flow);
  gst_pad_push_event(s.src, event);
  return TRUE;
}

// ---- the video's side ------------------------------------------------------------------------------------

GstFlowReturn take_frame(CombineState& s, GstBuffer* buffer) {
  OwnedBuffer frame(buffer);
  Waiting waiting;
  waiting.frame.time = running_time(s.video_segment, GST_BUFFER_PTS(buffer));
  waiting.frame.match = s.settings.match;
  if (waiting.frame.match == Match::automatic)
    waiting.frame.stamp = stamp_of(buffer);
  const Time duration = duration_of(buffer);
  {
    Lock lock(s.mutex);
    s.video_thread = std::this_thread::get_id();
    if (const GstFlowReturn flow = s.wait_for_task(lock, &CombineState::takes_frames); flow != GST_FLOW_OK)
      return flow;
    if (duration > 0)
      s.frame_duration = duration;
    waiting.frame.tolerance = half_of(s.frame_duration);
    waiting.arrival = Clock::now();
    s.queue.push_back(waiting);
    s.matcher.expect_frame(waiting.frame.time, waiting.frame.stamp.has_value(), s.frame_duration);
  }
  return s.base_chain(s.sink, GST_OBJECT(s.element), frame.release());
}

void flush_video(CombineState& s, bool flushing) noexcept {
  const Lock lock(s.mutex);
  s.reset(flushing ? GST_FLOW_FLUSHING : GST_FLOW_OK);
  s.queue.clear();
  s.events = 0;
}

/// Tells the base class that no units come, for it waits until every pad has a buffer or has ended.
void end_meta(CombineState& s) {
  base_class()->sink_event(s.base(), GST_AGGREGATOR_PAD(s.meta), gst_event_new_eos());
}

/// The base class passes a flush on when it has come on both pads, and joins the task, which must not wait.
void flush_base(CombineState& s, GstEvent* event) {
  const bool begins = GST_EVENT_TYPE(event) == GST_EVENT_FLUSH_START;
  flush_video(s, begins);
  s.base_flushes = begins;
  base_class()->sink_event(s.base(), GST_AGGREGATOR_PAD(s.meta), gst_event_ref(event));
  if (!begins)
    end_meta(s);
  base_class()->sink_event(s.base(), GST_AGGREGATOR_PAD(s.sink), event);
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

/// As it comes, before it is queued. Returns a flow: of a plain FALSE the pad that sends a sticky event again
/// makes an error, also while this element is only being stopped or flushed.
GstFlowReturn video_event(CombineState& s, GstAggregatorPad* pad, GstEvent* event) {
  const GstEventType type = GST_EVENT_TYPE(event);
  const GstEventTypeFlags flags = gst_event_type_get_flags(type);
  if (type == GST_EVENT_FLUSH_START || type == GST_EVENT_FLUSH_STOP) {
    if (type == GST_EVENT_FLUSH_STOP)
      s.video_segment = in_time();
    flush_base(s, event);
    return GST_FLOW_OK;
  }
  if (!(flags & GST_EVENT_TYPE_SERIALIZED))
    return gst_pad_event_default(s.sink, GST_OBJECT(s.element), event) ? GST_FLOW_OK : GST_FLOW_ERROR;
  if (type == GST_EVENT_CAPS)
    note_caps(s, event);
  {
    Lock lock(s.mutex);
    GstFlowReturn flow = s.wait_for_task(lock, &CombineState::takes_events);
    if (type == GST_EVENT_STREAM_START) {
      s.live_is_old = true;
      if (flow == GST_FLOW_EOS) // after an end the next stream begins
        s.flow = flow = GST_FLOW_OK;
    }
    // The source pad keeps sticky events, also for a peer that is linked later.
    if (flow == GST_FLOW_FLUSHING || (flow != GST_FLOW_OK && !(flags & GST_EVENT_TYPE_STICKY))) {
      gst_event_unref(event);
      return flow;
    }
    ++s.events;
  }
  if (type == GST_EVENT_SEGMENT) {
    gst_event_copy_segment(event, &s.video_segment);
    GstStructure* content = gst_structure_new(carrier, "event", GST_TYPE_EVENT, event, nullptr);
    gst_event_unref(std::exchange(event, gst_event_new_custom(GST_EVENT_CUSTOM_DOWNSTREAM, content)));
  }
  return base_class()->sink_event_pre_queue(s.base(), pad, event);
}

/// Adds the frames that wait here to what downstream wants of a pool. The task comes to it in its turn.
gboolean propose_allocation(CombineState& s, GstAggregatorPad*, GstQuery*, GstQuery* query) {
  gst_pad_peer_query(s.src, query); // without an answer there are no pools
  GstCaps* caps = nullptr;
  gst_query_parse_allocation(query, &caps, nullptr);
  GstVideoInfo info;
  const bool known = caps && gst_video_info_from_caps(&info, caps);
  const Time duration = known ? duration_of(info) : 0;
  const auto held = static_cast<guint>(static_cast<Time>(s.settings.latency_ms) * GST_MSECOND /
                                           (duration > 0 ? duration : 2 * default_tolerance) +
                                       2);
  const guint pools = gst_query_get_n_allocation_pools(query);
  for (guint i = 0; i < pools; ++i) {
    GstBufferPool* pool = nullptr;
    guint size = 0, least = 0, most = 0;
    gst_query_parse_nth_allocation_pool(query, i, &pool, &size, &least, &most);
    gst_query_set_nth_allocation_pool(query, i, pool, size, least + held, most > 0 ? most + held : 0);
    gst_clear_object(&pool);
  }
  if (pools == 0)
    gst_query_add_allocation_pool(query, nullptr, known ? static_cast<guint>(GST_VIDEO_INFO_SIZE(&info)) : 0,
                                  held, 0);
  return TRUE;
}

gboolean video_query(CombineState& s, GstAggregatorPad* pad, GstQuery* query) {
  if (!(gst_query_type_get_flags(GST_QUERY_TYPE(query)) & GST_QUERY_TYPE_SERIALIZED))
    return base_class()->sink_query_pre_queue(s.base(), pad, query);
  {
    const Lock lock(s.mutex);
    if (s.flow != GST_FLOW_OK)
      return FALSE;
    s.note_wait(true);
  }
  const gboolean answered = base_class()->sink_query_pre_queue(s.base(), pad, query);
  const Lock lock(s.mutex);
  s.note_wait(false);
  return answered;
}

bool video_activate(CombineState& s, GstPadMode mode, gboolean active) {
  if (mode != GST_PAD_MODE_PUSH)
    return false;
  flush_video(s, !active);
  return s.base_activate(s.sink, GST_OBJECT(s.element), mode, active);
}

// ---- the units' side -------------------------------------------------------------------------------------

/// Waits for room as long as the video moves on (live: for a moment), then drops the oldest units.
void make_room(CombineState& s, Lock& lock) TERRAINSEG_REQUIRES(s.mutex) {
  const bool alone = s.video_thread == std::thread::id() || s.video_thread == std::this_thread::get_id();
  bool moves_on = !alone;
  while (moves_on && s.lacks_room()) {
    const bool live = s.matcher.live() != Live::no;
    const Clock::time_point until =
        Clock::now() + (live ? std::max<Clock::duration>(s.latency(), std::chrono::seconds(1))
                             : Clock::duration(Matcher::stall_limit));
    const std::uint64_t frames = s.frames_left;
    while (s.lacks_room() && s.frames_left == frames && Clock::now() < until)
      lock.wait_until(s.changed, until);
    moves_on = !live && s.frames_left != frames;
  }
  s.matcher.make_room();
}

void keep_unit(CombineState& s, OwnedBuffer unit) {
  Matcher::UnitTimes times;
  times.time = running_time(s.meta_segment, GST_BUFFER_PTS(unit.get()));
  // Units behind an encoder with B-frames come in coding order: their DTS says which cannot come any more.
  times.decoding = running_time(s.meta_segment, GST_BUFFER_DTS(unit.get()));
  KlvVerdict verdict = KlvVerdict::damaged;
  {
    const MappedBuffer bytes(unit.get(), GST_MAP_READ);
    if (!bytes.data())
      return reject(s, "damaged", "its memory cannot be read");
    verdict = s.checked.decode({bytes.data(), bytes.size()});
  }
  GST_LOG_OBJECT(s.element, "unit: %" GST_PTR_FORMAT, printable(unit.get()));
  bool timeless = false;
  {
    Lock lock(s.mutex);
    s.note_meta();
    if (verdict == KlvVerdict::ok) {
      times.precision = s.checked.time_us();
      times.frame = s.checked.estimate().frame;
      s.matcher.begin_units();
      make_room(s, lock);
      timeless = s.matcher.add_unit(times, std::move(unit));
      s.changed.notify_all();
    }
  }
  if (verdict != KlvVerdict::ok)
    return reject(s, verdict == KlvVerdict::foreign ? "foreign" : "damaged", s.checked.error());
  if (timeless)
    GST_ELEMENT_WARNING(s.element, STREAM, FORMAT,
                        ("The KLV units carry no time stamps. They are matched by the precision times in "
                         "them, starting with the first frame and the first unit. If the two streams do not "
                         "start together, masks appear on wrong frames: mux the units with time stamps "
                         "(mpegtsmux keeps those of terrainextract; \"ffmpeg -c copy\" drops them)."),
                        ("units without PTS, or in a segment that is not in time"));
}

GstFlowReturn meta_chain(CombineState& s, GstBuffer* unit) {
  keep_unit(s, OwnedBuffer(unit));
  const Lock lock(s.mutex);
  return s.meta_flushing ? GST_FLOW_FLUSHING : GST_FLOW_OK;
}

void flush_meta(CombineState& s, bool flushing) noexcept {
  const Lock lock(s.mutex);
  s.meta_flushing = flushing;
  s.matcher.flush_units();
  s.live_is_old = true;
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
  s.matcher.add_gap(time);
  s.changed.notify_all();
}

/// Nothing of the units' stream goes on: the video's events are the output's.
GstFlowReturn meta_event(CombineState& s, GstEvent* event) {
  {
    const Lock lock(s.mutex);
    s.note_meta();
  }
  switch (GST_EVENT_TYPE(event)) {
  case GST_EVENT_FLUSH_START:
    flush_meta(s, true);
    break;
  case GST_EVENT_FLUSH_STOP:
    s.meta_segment = in_time();
    flush_meta(s, false);
    break;
  case GST_EVENT_SEGMENT:
    gst_event_copy_segment(event, &s.meta_segment);
    break;
  case GST_EVENT_GAP:
    take_gap(s, event);
    break;
  case GST_EVENT_STREAM_START: {
    const Lock lock(s.mutex);
    s.matcher.begin_units();
    s.live_is_old = true;
    break;
  }
  case GST_EVENT_EOS: {
    const Lock lock(s.mutex);
    s.matcher.end_units();
    s.changed.notify_all();
    break;
  }
  default:
    break;
  }
  gst_event_unref(event);
  return GST_FLOW_OK;
}

gboolean meta_query(GstPad* pad, GstObject* parent, GstQuery* query) {
  return GST_QUERY_TYPE(query) != GST_QUERY_ALLOCATION && gst_pad_query_default(pad, parent, query);
}

bool meta_activate(CombineState& s, GstPadMode mode, gboolean active) {
  if (mode != GST_PAD_MODE_PUSH)
    return false;
  flush_meta(s, !active);
  return true;
}

// ---- the output's side -----------------------------------------------------------------------------------

bool src_activate(CombineState& s, GstPadMode mode, gboolean active) {
  const Lock lock(s.mutex);
  s.reset(active ? GST_FLOW_OK : GST_FLOW_FLUSHING);
  return mode == GST_PAD_MODE_PUSH;
}

gboolean src_query(CombineState& s, GstQuery* query) {
  if (GST_QUERY_TYPE(query) == GST_QUERY_LATENCY)
    return query_latency(s, query);
  return gst_pad_query_default(s.src, GST_OBJECT(s.element), query);
}

gboolean src_event(CombineState& s, GstEvent* event) {
  // Seeks also reach a separate source of the units; a source that knows the latency waits for it.
  const GstEventType type = GST_EVENT_TYPE(event);
  if ((type == GST_EVENT_SEEK || type == GST_EVENT_LATENCY) && gst_pad_is_linked(s.meta))
    gst_pad_push_event(s.meta, gst_event_ref(event));
  if (type == GST_EVENT_RECONFIGURE) { // it may be linked again
    const Lock lock(s.mutex);
    ++s.reconfigured;
    if (s.flow == GST_FLOW_NOT_LINKED)
      s.flow = GST_FLOW_OK;
    s.changed.notify_all();
  }
  return gst_pad_event_default(s.src, GST_OBJECT(s.element), event);
}

/// Video in and video out belong together; the units are an end.
GstIterator* internal_links(GstPad* pad, GstObject* parent) {
  const CombineState& s = GstTerrainCombine::state_of(parent);
  GstPad* other = pad == s.src ? s.sink : pad == s.sink ? s.src : nullptr;
  if (!other)
    return nullptr;
  g_auto(GValue) value = G_VALUE_INIT;
  g_value_set_object(g_value_init(&value, GST_TYPE_PAD), other);
  return gst_iterator_new_single(GST_TYPE_PAD, &value);
}

// ---- the object ------------------------------------------------------------------------------------------

GstStateChangeReturn change_state(GstElement* element, GstStateChange transition) {
  CombineState& s = GstTerrainCombine::state_of(element);
  if (transition == GST_STATE_CHANGE_READY_TO_PAUSED) {
    end_meta(s);
    const Lock lock(s.mutex);
    s.matcher.start();
    s.video_thread = s.meta_thread = {};
    s.warned.reset();
  }
  // A flush that upstream has not ended: the base class would still wait for its end after the next start.
  if (transition == GST_STATE_CHANGE_PAUSED_TO_READY && s.base_flushes)
    flush_base(s, gst_event_new_flush_stop(TRUE));
  const GstStateChangeReturn result =
      GST_ELEMENT_CLASS(gst_terrain_combine_parent_class)->change_state(element, transition);
  if (transition == GST_STATE_CHANGE_PAUSED_TO_READY) {
    s.attacher.drop();
    s.video_segment = in_time();
    s.meta_segment = in_time();
  }
  return result;
}

GstStructure* statistics_of(gpointer object) {
  CombineState& s = GstTerrainCombine::state_of(object);
  Lock lock(s.mutex);
  const Matcher::Counts counts = s.matcher.counts();
  lock.unlock();
  return gst_structure_new("terraincombine-stats", "matched", G_TYPE_UINT64, counts.matched,
                           "matched-precisely", G_TYPE_UINT64, counts.precise, "lost", G_TYPE_UINT64,
                           counts.lost, "rejected", G_TYPE_UINT64, counts.rejected, "unused", G_TYPE_UINT64,
                           counts.unused, nullptr);
}

constexpr Choice matches[] = {
    {"auto",
     "By precision time, to the microsecond, if frames carry a stamp (terrainstamp), else by time stamps"},
    {"time-stamps", "By time stamps only"},
};

const Property<CombineSettings> table[] = {
    {"latency", "Latency",
     "Longest time in milliseconds that a frame of a live pipeline waits for its KLV unit, which adds this "
     "latency; in other pipelines the amount of video that may wait",
     property_playing, field<&CombineSettings::latency_ms>(0, 60000)},
    stats_row<CombineSettings>("Counts since the start: frames matched (matched-precisely: by precision "
                               "time) and lost, KLV units rejected and unused",
                               statistics_of),
    {"match", "Match", "How KLV units are matched to frames", property_playing,
     field<&CombineSettings::match>("GstTerrainMatch", matches)},
};

void set_property(GObject* object, guint id, const GValue* value, GParamSpec* spec) {
  set_in_table<GstTerrainCombine, table>(object, id, value, spec);
  if (g_str_equal(spec->name, "latency"))
    gst_element_post_message(GST_ELEMENT(object), gst_message_new_latency(GST_OBJECT(object)));
}

void gst_terrain_combine_class_init(GstTerrainCombineClass* klass) {
  GST_DEBUG_CATEGORY_INIT(terraincombine_debug, "terraincombine", 0, "terrain metadata from KLV");
  init_class<GstTerrainCombine, gst_terrain_combine_parent_class, table>(
      klass, {"Terrain combiner", "Combiner/Metadata/Video",
              "Attaches the terrain metadata in KLV units to the video they belong to"});
  G_OBJECT_CLASS(klass)->set_property = set_property;
  GST_ELEMENT_CLASS(klass)->change_state = change_state;
  add_pad_template(klass, "sink", GST_PAD_SINK, "video/x-raw(ANY)", GST_TYPE_AGGREGATOR_PAD);
  add_pad_template(klass, "meta", GST_PAD_SINK, "meta/x-klv, parsed = (boolean) true",
                   GST_TYPE_AGGREGATOR_PAD);
  add_pad_template(klass, "src", GST_PAD_SRC, "video/x-raw(ANY)", GST_TYPE_AGGREGATOR_PAD);
  klass->aggregate = GstTerrainCombine::call<aggregate>;
  klass->sink_event_pre_queue = GstTerrainCombine::call<video_event>;
  klass->sink_event = GstTerrainCombine::call<sink_event>;
  klass->sink_query_pre_queue = GstTerrainCombine::call<video_query>;
  klass->propose_allocation = GstTerrainCombine::call<propose_allocation>;
  klass->src_activate = GstTerrainCombine::call<src_activate>;
  klass->src_event = GstTerrainCombine::call<src_event>;
  klass->src_query = GstTerrainCombine::call<src_query>;
  klass->negotiate = [](GstAggregator*) -> gboolean { return TRUE; }; // the caps are the video's
}

/// The base class asks upstream for its latency too, at every frame until it has an answer, and posts a
/// warning of latencies that do not fit. It never waits for a time: it is told that nothing is live.
GstPadProbeReturn answer_base(GstPad*, GstPadProbeInfo* info, gpointer) {
  GstQuery* query = GST_PAD_PROBE_INFO_QUERY(info);
  if (GST_QUERY_TYPE(query) != GST_QUERY_LATENCY)
    return GST_PAD_PROBE_OK;
  gst_query_set_latency(query, FALSE, 0, GST_CLOCK_TIME_NONE);
  return GST_PAD_PROBE_HANDLED;
}

/// With a latency of 0 the base class blocks a pad that holds a frame, else one that holds more than that
/// time. It sees no segment, so no frame has a time. The property of this element hides that of the base
/// class.
void never_block(CombineState& s) {
  GObjectClass* base = G_OBJECT_CLASS(gst_terrain_combine_parent_class);
  GParamSpec* latency = g_object_class_find_property(base, "latency");
  g_auto(GValue) value = G_VALUE_INIT;
  g_value_set_uint64(g_value_init(&value, G_TYPE_UINT64), 1);
  base->set_property(G_OBJECT(s.element), latency->param_id, &value, latency);
}

void gst_terrain_combine_init(GstTerrainCombine* self) {
  CombineState& s = self->make_state();
  never_block(s);
  s.sink = add_pad(s.element, "sink");
  s.base_chain = GST_PAD_CHAINFUNC(s.sink);
  s.base_activate = GST_PAD_ACTIVATEMODEFUNC(s.sink);
  gst_pad_add_probe(s.sink, GST_PAD_PROBE_TYPE_QUERY_UPSTREAM, answer_base, nullptr, nullptr);
  gst_pad_set_chain_function(s.sink, GstTerrainCombine::pad_call<take_frame>);
  gst_pad_set_activatemode_function(s.sink, GstTerrainCombine::pad_call<video_activate>);
  GST_PAD_SET_PROXY_CAPS(s.sink);
  s.meta = add_pad(s.element, "meta");
  gst_pad_set_chain_function(s.meta, GstTerrainCombine::pad_call<meta_chain>);
  gst_pad_set_event_full_function(s.meta, GstTerrainCombine::pad_call<meta_event>);
  gst_pad_set_query_function(s.meta, meta_query);
  gst_pad_set_activatemode_function(s.meta, GstTerrainCombine::pad_call<meta_activate>);
  s.src = GST_AGGREGATOR_SRC_PAD(self);
  GST_PAD_SET_PROXY_CAPS(s.src);
  for (GstPad* pad : {s.sink, s.meta, s.src})
    gst_pad_set_iterate_internal_links_function(pad, internal_links);
}

} // namespace

GST_ELEMENT_REGISTER_DEFINE(terraincombine, "terraincombine", GST_RANK_NONE, gst_terrain_combine_get_type())
