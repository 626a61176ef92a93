// SPDX-License-Identifier: LGPL-2.1-or-later
// Own chain functions and a task instead of GstAggregator. The same pads on GstAggregator (1.22, latency
// 200 ms) were measured against this element, and four things that pipelines rely on did not hold:
//
// * One thread feeds both pads, not live, and 10 of 40 units are lost: after 10 frames the thread blocks for
//   ever in the chain function of the video pad (here: all 40 frames pass).
// * The source pad is unlinked and linked again: NOT_LINKED from then on (here: the next 10 of 10 frames
// pass).
// * A second stream begins after EOS: its frames are refused with EOS (here: they are taken).
// * The source pad sends a stream-start of its own: the stream id of the video is lost (here: it is kept).
//
// Each of them would need code around the base class: other chain functions, masked flow returns, rewritten
// events.

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

/// A frame or a serialized event on its way through.
struct Item {
  std::unique_ptr<GstMiniObject, ObjectUnref> object;
  Clock::time_point arrival;
  Matcher::Frame frame; ///< with its tolerance when it leaves: the caps decide
  OwnedBuffer unit;     ///< of a frame that leaves, where it has one
  bool is_frame() const { return GST_IS_BUFFER(object.get()); }
  GstEventType event_type() const { return GST_EVENT_TYPE(object.get()); }
  bool is_sticky() const { return gst_event_type_get_flags(event_type()) & GST_EVENT_TYPE_STICKY; }
};

/// Frames and serialized events of the video, in their order. A list of one is spliced into it, which
/// allocates nothing.
using Queue = std::list<Item>;
/// Largest number of waiting frames and events; events alone (GAP) count too, to limit the memory.
constexpr std::size_t most_items = 4096;

/// Half a frame: nearer to it than to its neighbours. `duration` 0 = unknown.
Time half_of(Time duration) {
  return duration > 0 ? std::min(duration / 2, most_tolerance) : default_tolerance;
}

/// Whether the queue has as much video as a frame may wait. `frame_duration` 0 = unknown.
bool is_full(const Queue& queue, Time latency, Time frame_duration) {
  if (queue.size() >= most_items)
    return true;
  std::int64_t frames = 0;
  Time first = never, last = never;
  for (const Item& item : queue)
    if (item.is_frame()) {
      ++frames;
      last = item.frame.time;
      if (first == never)
        first = item.frame.time;
    }
  if (frames < 3)
    return false;
  // Time stamps that stand still must not fill the memory: at most twice the frames that the rate allows.
  const Time half_frame = half_of(frame_duration);
  return first == never || last == never || last - first > latency ||
         frames * half_frame > latency + 4 * half_frame;
}

/// Everything behind the instance.
struct CombineState {
  GstElement* element = nullptr;
  GstPad *sink = nullptr, *meta = nullptr, *src = nullptr;
  CombineSettings settings; ///< read by any thread

  Mutex mutex;                     ///< held for moments only, never while a frame is processed
  std::condition_variable changed; ///< any of what follows
  Queue queue TERRAINSEG_GUARDED_BY(mutex);
  Matcher matcher TERRAINSEG_GUARDED_BY(mutex);
  bool live_is_old TERRAINSEG_GUARDED_BY(mutex) = true;      ///< to be asked before the next frame waits
  unsigned reconfigured TERRAINSEG_GUARDED_BY(mutex) = 0;    ///< counts RECONFIGURE events from downstream
  bool flushing TERRAINSEG_GUARDED_BY(mutex) = true;         ///< the video is
  bool meta_flushing TERRAINSEG_GUARDED_BY(mutex) = true;    ///< the units are
  bool pushing TERRAINSEG_GUARDED_BY(mutex) = false;         ///< the task works on an item that it took
  bool feeder_waits TERRAINSEG_GUARDED_BY(mutex) = false;    ///< the thread that brings the units waits
  std::thread::id video_thread TERRAINSEG_GUARDED_BY(mutex); ///< that brought the last frame
  std::thread::id meta_thread TERRAINSEG_GUARDED_BY(mutex);  ///< that brought the last unit or event of units
  std::uint64_t frames_left TERRAINSEG_GUARDED_BY(mutex) = 0; ///< counts frames that the task took
  Time frame_duration TERRAINSEG_GUARDED_BY(mutex) = 0;       ///< of the caps or the last frame; 0 = unknown
  std::optional<Clock::time_point> warned TERRAINSEG_GUARDED_BY(mutex); ///< of a unit that was rejected
  GstFlowReturn flow TERRAINSEG_GUARDED_BY(mutex) = GST_FLOW_FLUSHING;  ///< of the last push

  GstSegment video_segment = in_time(); ///< the video's chain
  GstSegment meta_segment = in_time();  ///< the units' chain
  KlvUnit checked;                      ///< the units' chain
  UnitAttacher attacher;                ///< the task

  CombineState() noexcept = default;
  Clock::duration latency() const { return std::chrono::milliseconds(settings.latency_ms); }
  /// Why nothing more is taken; OK when it is.
  GstFlowReturn state_of_flow() const TERRAINSEG_REQUIRES(mutex) {
    return flushing ? GST_FLOW_FLUSHING : flow;
  }
  bool takes_frames() const TERRAINSEG_REQUIRES(mutex) {
    return !is_full(queue, static_cast<Time>(settings.latency_ms) * GST_MSECOND, frame_duration);
  }
  bool takes_events() const TERRAINSEG_REQUIRES(mutex) { return queue.size() < most_items; }
  bool is_drained() const TERRAINSEG_REQUIRES(mutex) { return queue.empty() && !pushing; }
  bool lacks_room() const TERRAINSEG_REQUIRES(mutex) {
    return !matcher.has_room() && !meta_flushing && flow == GST_FLOW_OK;
  }
  /// Something of the units has come.
  void note_meta() TERRAINSEG_REQUIRES(mutex) {
    meta_thread = std::this_thread::get_id();
    matcher.note_unit_side(Clock::now());
  }
  /// Waits until `done`, or until there is no reason to wait: returns state_of_flow(). Where this thread
  /// brings the units too, the task does not wait for them meanwhile.
  GstFlowReturn wait_for_task(Lock& lock, bool (CombineState::*done)() const) TERRAINSEG_REQUIRES(mutex) {
    if (state_of_flow() != GST_FLOW_OK || (this->*done)())
      return state_of_flow();
    feeder_waits = meta_thread == std::this_thread::get_id();
    changed.notify_all();
    while (state_of_flow() == GST_FLOW_OK && !(this->*done)())
      lock.wait(changed);
    feeder_waits = false;
    return state_of_flow();
  }
};
static_assert(std::is_nothrow_default_constructible_v<UnitStore> &&
              std::is_nothrow_default_constructible_v<UnitClock> &&
              std::is_nothrow_default_constructible_v<KlvUnit> &&
              std::is_nothrow_default_constructible_v<Queue>);

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
using GstTerrainCombine = Instance<GstElement, CombineState>;
using GstTerrainCombineClass = GstElementClass;

G_DEFINE_TYPE(GstTerrainCombine, gst_terrain_combine, GST_TYPE_ELEMENT)

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

/// What the two upstreams say together.
struct Upstream {
  bool answered = false; ///< the video's
  bool live = false;
  GstClockTime least = 0, most = GST_CLOCK_TIME_NONE;
};

Upstream ask_upstream(CombineState& s) {
  Upstream all;
  for (GstPad* pad : {s.sink, s.meta}) {
    g_autoptr(GstQuery) query = gst_query_new_latency();
    if (gst_pad_peer_query(pad, query)) {
      gboolean live = FALSE;
      GstClockTime least = 0, most = GST_CLOCK_TIME_NONE;
      gst_query_parse_latency(query, &live, &least, &most);
      all.answered = all.answered || pad == s.sink;
      if (live) {
        all.live = true;
        all.least = std::max(all.least, least);
        all.most = std::min(all.most, most); // NONE is the largest number
      }
    }
  }
  return all;
}

/// Waits for the unit of the frame in front, under the lock. False when the frame is not there any more.
bool wait_for_unit(CombineState& s, Lock& lock, const Matcher::Frame& frame, Clock::time_point arrival,
                   OwnedBuffer& unit) TERRAINSEG_REQUIRES(s.mutex) {
  const Clock::time_point since = Clock::now();
  s.matcher.begin_frame(frame);
  for (;;) {
    // One thread for both pads, not live: while it waits for room in the queue it brings no units.
    const bool in_vain = s.meta_flushing || s.feeder_waits || !gst_pad_is_linked(s.meta);
    Matcher::Answer answer = s.matcher.look_for(frame, {arrival, since, s.latency(), in_vain}, Clock::now());
    if (answer.dropped > 0)
      s.changed.notify_all(); // there is room
    if (answer.is_final) {
      unit = std::move(answer.unit);
      return true;
    }
    lock.wait_until(s.changed, answer.until);
    if (s.flushing)
      return false;
  }
}

/// Waits for the next item and, of a frame, for its unit. Nothing when there is none yet: to be called again,
/// unless it is flushing.
std::optional<Item> take_next(CombineState& s) {
  Lock lock(s.mutex);
  while (!s.flushing && s.queue.empty())
    lock.wait(s.changed);
  if (s.flushing)
    return std::nullopt;
  Matcher::Frame frame = s.queue.front().frame;
  OwnedBuffer unit;
  if (s.queue.front().is_frame()) {
    if (std::exchange(s.live_is_old, false)) {
      lock.unlock();
      const Upstream upstream = ask_upstream(s);
      lock.lock();
      // One that does not answer is taken for live, so that no frame waits longer than `latency`.
      s.matcher.set_live(upstream.live || !upstream.answered ? Live::yes : Live::no);
      return std::nullopt;
    }
    const Time duration = duration_of(GST_BUFFER(s.queue.front().object.get()));
    frame.tolerance = half_of(duration > 0 ? duration : duration_of(s.attacher.video()));
    if (!wait_for_unit(s, lock, frame, s.queue.front().arrival, unit))
      return std::nullopt;
    ++s.frames_left;
  }
  Item item{std::move(s.queue.front().object), {}, frame, std::move(unit)};
  s.queue.pop_front();
  s.pushing = true;
  s.changed.notify_all();
  return item;
}

void push_frame(CombineState& s, Item item) {
  OwnedBuffer frame(GST_BUFFER(item.object.release()));
  bool matched = item.unit != nullptr;
  if (matched)
    if (const std::string flaw = s.attacher.decode(item.unit.get()); !flaw.empty()) {
      matched = false;
      reject(s, "useless", flaw);
    }
  std::string reason;
  unsigned reconfigured = 0;
  {
    const Lock lock(s.mutex);
    reason = s.matcher.end_frame(item.frame, matched, s.latency());
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
  s.pushing = false;
  // Where the pad was linked during this push NOT_LINKED is not kept: the next frame arrives.
  if (!s.flushing && !(flow == GST_FLOW_NOT_LINKED && s.reconfigured != reconfigured))
    s.flow = flow;
  if (s.flow == GST_FLOW_NOT_LINKED) // frames of now are too old for a peer that is linked later
    s.queue.remove_if([](const Item& queued) { return queued.is_frame(); });
  s.changed.notify_all();
}

void push_event(CombineState& s, Item item) {
  GstEvent* event = GST_EVENT(item.object.release());
  GST_DEBUG_OBJECT(s.element, "in turn: %" GST_PTR_FORMAT, printable(event));
  const bool eos = GST_EVENT_TYPE(event) == GST_EVENT_EOS;
  if (GST_EVENT_TYPE(event) == GST_EVENT_CAPS) {
    GstCaps* caps = nullptr;
    gst_event_parse_caps(event, &caps);
    s.attacher.set_video(caps);
  }
  gst_pad_push_event(s.src, event);
  const Lock lock(s.mutex);
  s.pushing = false;
  if (eos && s.flow == GST_FLOW_OK)
    s.flow = GST_FLOW_EOS;
  s.changed.notify_all();
}

void loop(gpointer data) {
  CombineState& s = GstTerrainCombine::state_of(data);
  const bool fine = guarded(data, false, [&] {
    std::optional<Item> item = take_next(s);
    if (item && item->is_frame())
      push_frame(s, std::move(*item));
    else if (item)
      push_event(s, std::move(*item));
    return true;
  });
  const Lock lock(s.mutex);
  if (!fine) {
    s.flow = GST_FLOW_ERROR;
    s.pushing = false;
    s.changed.notify_all();
  }
  if (s.flushing || s.flow != GST_FLOW_OK) {
    GST_DEBUG_OBJECT(s.element, "task pauses: %s", gst_flow_get_name(s.flow));
    gst_pad_pause_task(s.src);
  }
}

// ---- the video's side ------------------------------------------------------------------------------------

GstFlowReturn take_frame(CombineState& s, GstBuffer* frame) {
  Queue item;
  item.emplace_back().object.reset(GST_MINI_OBJECT_CAST(frame));
  Matcher::Frame& times = item.front().frame;
  times.time = running_time(s.video_segment, GST_BUFFER_PTS(frame));
  times.stamp = stamp_of(frame);
  Lock lock(s.mutex);
  times.match = s.settings.match;
  if (times.match != Match::automatic)
    times.stamp.reset();
  s.video_thread = std::this_thread::get_id();
  if (const GstFlowReturn flow = s.wait_for_task(lock, &CombineState::takes_frames); flow != GST_FLOW_OK)
    return flow;
  if (const Time duration = duration_of(frame); duration > 0)
    s.frame_duration = duration;
  s.matcher.expect_frame(times.time, times.stamp.has_value(), s.frame_duration);
  item.front().arrival = Clock::now();
  s.queue.splice(s.queue.end(), item);
  s.changed.notify_all();
  return GST_FLOW_OK;
}

void flush_video(CombineState& s, bool flushing) noexcept {
  const Lock lock(s.mutex);
  s.flushing = flushing;
  s.flow = flushing ? GST_FLOW_FLUSHING : GST_FLOW_OK;
  s.live_is_old = true;
  s.matcher.flush_frames();
  // As a pad does: sticky events except EOS and SEGMENT stay.
  s.queue.remove_if([](const Item& item) {
    return item.is_frame() || !item.is_sticky() || item.event_type() == GST_EVENT_EOS ||
           item.event_type() == GST_EVENT_SEGMENT;
  });
  s.changed.notify_all();
}

/// While the source pad is not linked the newest sticky event of each type is kept for a later peer.
bool keeps_unlinked(CombineState& s, const Item& item) TERRAINSEG_REQUIRES(s.mutex) {
  if (s.flow != GST_FLOW_NOT_LINKED || !item.is_sticky())
    return false;
  s.queue.remove_if([type = item.event_type()](const Item& queued) {
    return !queued.is_frame() && queued.event_type() == type;
  });
  return true;
}

/// Why the event was not taken, as a flow: of a plain FALSE the pad that sends a sticky event again makes an
/// error, also while this element is only being stopped or flushed.
GstFlowReturn queue_event(CombineState& s, GstEvent* event) {
  Queue item;
  item.emplace_back().object.reset(GST_MINI_OBJECT_CAST(event));
  GstFlowReturn flow = GST_FLOW_OK;
  const bool eos = GST_EVENT_TYPE(event) == GST_EVENT_EOS;
  {
    Lock lock(s.mutex);
    flow = s.wait_for_task(lock, &CombineState::takes_events);
    // After an end the next stream begins; the task has paused.
    if (GST_EVENT_TYPE(event) == GST_EVENT_STREAM_START) {
      s.live_is_old = true;
      if (flow == GST_FLOW_EOS) {
        s.flow = flow = GST_FLOW_OK;
        gst_pad_start_task(s.src, loop, s.element, nullptr);
      }
    }
    if (flow == GST_FLOW_OK || keeps_unlinked(s, item.front())) {
      s.queue.splice(s.queue.end(), item);
      s.changed.notify_all();
      return GST_FLOW_OK;
    }
  }
  // Errors travel upstream with the next frame; at the end there is none.
  if (eos && (flow == GST_FLOW_NOT_LINKED || flow < GST_FLOW_EOS))
    GST_ELEMENT_FLOW_ERROR(s.element, flow);
  return flow;
}

/// Downstream has changed: it may be linked again.
void resume(CombineState& s) {
  const Lock lock(s.mutex);
  ++s.reconfigured;
  if (s.flow != GST_FLOW_NOT_LINKED || s.flushing)
    return;
  GST_DEBUG_OBJECT(s.element, "linked again, frames go on");
  s.flow = GST_FLOW_OK;
  gst_pad_start_task(s.src, loop, s.element, nullptr);
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

GstFlowReturn video_event(CombineState& s, GstEvent* event) {
  switch (GST_EVENT_TYPE(event)) {
  case GST_EVENT_FLUSH_START: {
    const gboolean pushed = gst_pad_push_event(s.src, event);
    flush_video(s, true);
    gst_pad_pause_task(s.src);
    return flow_of(pushed);
  }
  case GST_EVENT_FLUSH_STOP: {
    s.video_segment = in_time();
    const gboolean pushed = gst_pad_push_event(s.src, event);
    flush_video(s, false);
    if (GST_PAD_IS_ACTIVE(s.src))
      gst_pad_start_task(s.src, loop, s.element, nullptr);
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
  if (!(gst_event_type_get_flags(GST_EVENT_TYPE(event)) & GST_EVENT_TYPE_SERIALIZED))
    return flow_of(gst_pad_event_default(s.sink, GST_OBJECT(s.element), event));
  return queue_event(s, event);
}

/// Adds the frames that wait here to what downstream wants of a pool.
gboolean query_allocation(CombineState& s, GstQuery* query) {
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

gboolean video_query(CombineState& s, GstQuery* query) {
  if (!(gst_query_type_get_flags(GST_QUERY_TYPE(query)) & GST_QUERY_TYPE_SERIALIZED))
    return gst_pad_query_default(s.sink, GST_OBJECT(s.element), query);
  {
    // In order: what came before it has left.
    Lock lock(s.mutex);
    if (s.wait_for_task(lock, &CombineState::is_drained) != GST_FLOW_OK)
      return FALSE;
  }
  if (GST_QUERY_TYPE(query) == GST_QUERY_ALLOCATION)
    return query_allocation(s, query);
  return gst_pad_peer_query(s.src, query);
}

bool video_activate(CombineState& s, GstPadMode mode, gboolean active) {
  if (mode != GST_PAD_MODE_PUSH)
    return false;
  flush_video(s, !active);
  if (!active) {
    const Lock lock(s.mutex);
    s.queue.clear();
  }
  return true;
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
bool meta_event(CombineState& s, GstEvent* event) {
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
  return true;
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

gboolean src_activate(CombineState& s, GstPadMode mode, gboolean active) {
  if (mode != GST_PAD_MODE_PUSH)
    return FALSE;
  flush_video(s, !active);
  return active ? gst_pad_start_task(s.src, loop, s.element, nullptr) : gst_pad_stop_task(s.src);
}

gboolean query_latency(CombineState& s, GstQuery* query) {
  Upstream all = ask_upstream(s);
  if (!all.answered)
    return FALSE;
  const GstClockTime own = s.settings.latency_ms * GST_MSECOND;
  if (all.live) {
    all.least += own;
    if (GST_CLOCK_TIME_IS_VALID(all.most))
      all.most += own;
  }
  gst_query_set_latency(query, all.live, all.least, all.most);
  return TRUE;
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
  if (type == GST_EVENT_RECONFIGURE)
    resume(s);
  return gst_pad_event_default(s.src, GST_OBJECT(s.element), event);
}

/// Video in and video out belong together; the units are an end.
GstIterator* internal_links(GstPad* pad, GstObject* parent) {
  const CombineState& s = GstTerrainCombine::state_of(parent);
  GstPad* other = pad == s.src ? s.sink : pad == s.sink ? s.src : nullptr;
  if (!other)
    return nullptr;
  g_auto(GValue) value = G_VALUE_INIT;
  g_value_init(&value, GST_TYPE_PAD);
  g_value_set_object(&value, other);
  return gst_iterator_new_single(GST_TYPE_PAD, &value);
}

// ---- the object ------------------------------------------------------------------------------------------

GstStateChangeReturn change_state(GstElement* element, GstStateChange transition) {
  CombineState& s = GstTerrainCombine::state_of(element);
  if (transition == GST_STATE_CHANGE_READY_TO_PAUSED) {
    const Lock lock(s.mutex);
    s.matcher.start();
    s.video_thread = s.meta_thread = {};
    s.warned.reset();
  }
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
  add_pad_template(klass, "sink", GST_PAD_SINK, "video/x-raw(ANY)");
  add_pad_template(klass, "meta", GST_PAD_SINK, "meta/x-klv, parsed = (boolean) true");
  add_pad_template(klass, "src", GST_PAD_SRC, "video/x-raw(ANY)");
}

void gst_terrain_combine_init(GstTerrainCombine* self) {
  CombineState& s = self->make_state();
  s.sink = add_pad(s.element, "sink");
  gst_pad_set_chain_function(s.sink, GstTerrainCombine::pad_call<take_frame>);
  gst_pad_set_event_full_function(s.sink, GstTerrainCombine::pad_call<video_event>);
  gst_pad_set_query_function(s.sink, GstTerrainCombine::pad_call<video_query>);
  gst_pad_set_activatemode_function(s.sink, GstTerrainCombine::pad_call<video_activate>);
  GST_PAD_SET_PROXY_CAPS(s.sink);
  s.meta = add_pad(s.element, "meta");
  gst_pad_set_chain_function(s.meta, GstTerrainCombine::pad_call<meta_chain>);
  gst_pad_set_event_function(s.meta, GstTerrainCombine::pad_call<meta_event>);
  gst_pad_set_query_function(s.meta, meta_query);
  gst_pad_set_activatemode_function(s.meta, GstTerrainCombine::pad_call<meta_activate>);
  s.src = add_pad(s.element, "src");
  gst_pad_set_activatemode_function(s.src, GstTerrainCombine::pad_call<src_activate>);
  gst_pad_set_event_function(s.src, GstTerrainCombine::pad_call<src_event>);
  gst_pad_set_query_function(s.src, GstTerrainCombine::pad_call<src_query>);
  GST_PAD_SET_PROXY_CAPS(s.src);
  for (GstPad* pad : {s.sink, s.meta, s.src})
    gst_pad_set_iterate_internal_links_function(pad, internal_links);
}

} // namespace

GST_ELEMENT_REGISTER_DEFINE(terraincombine, "terraincombine", GST_RANK_NONE, gst_terrain_combine_get_type())
