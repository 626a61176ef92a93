// SPDX-License-Identifier: LGPL-2.1-or-later
// Own chain functions and a task, not GstAggregator: an aggregator holds one buffer a pad and then blocks, so
// that a demuxer that feeds both pads from one thread could not bring the unit of the frame that waits for
// it.
#include "terraincombine.hpp"

#include <gst/video/video.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <condition_variable>
#include <cstring>
#include <deque>
#include <memory>
#include <mutex>
#include <vector>

#include "buffer_pool.hpp"
#include "estimate_meta.hpp"
#include "exchange/vmti_klv.hpp"
#include "guarded.hpp"
#include "unit_store.hpp"

GST_DEBUG_CATEGORY_STATIC(terraincombine_debug);
#define GST_CAT_DEFAULT terraincombine_debug

namespace terrainseg {
namespace {

using Clock = std::chrono::steady_clock;

constexpr guint default_latency = 200;
/// Units that may wait for video: more than two minutes at 30 frames a second.
constexpr std::size_t most_units = 4096;
/// How near a unit must be when nothing tells the frame rate: RTP brings 1 ms, MPEG-TS 11 us of rounding.
constexpr Time default_tolerance = 10 * GST_MSECOND;

struct ObjectUnref {
  void operator()(gpointer object) const { gst_mini_object_unref(GST_MINI_OBJECT_CAST(object)); }
};

/// A frame or a serialized event on its way through.
struct Item {
  std::unique_ptr<GstMiniObject, ObjectUnref> object;
  Clock::time_point arrival;
  Time time = never; ///< of a frame; never = unknown
  bool is_frame() const { return GST_IS_BUFFER(object.get()); }
};

struct Counts {
  std::uint64_t matched = 0;  ///< frames with metadata
  std::uint64_t lost = 0;     ///< frames without
  std::uint64_t rejected = 0; ///< units that were damaged or foreign
  std::uint64_t unused = 0;   ///< units whose frame never came
};

} // namespace

/// Everything behind the instance. "lock": `mutex`, held for moments only, never while a frame is processed.
struct CombineState {
  std::atomic<guint> latency_ms = default_latency;

  std::mutex mutex;
  std::condition_variable changed;        // any of what follows
  std::deque<Item> items;                 // lock
  UnitStore units;                        // lock
  Counts counts;                          // lock
  bool flushing = true;                   // lock; of the video's way
  bool meta_flushing = true;              // lock
  bool meta_eos = false;                  // lock
  bool meta_stalled = false;              // lock; a frame waited in vain and no unit has come since
  bool pushing = false;                   // lock; the task works on an item that it took
  GstFlowReturn flow = GST_FLOW_FLUSHING; // lock; of the last push

  GstSegment video_segment; // the video's chain
  GstSegment meta_segment;  // the meta's chain
  KlvUnit checked;          // the meta's chain
  Clock::time_point warned; // the meta's chain
  bool ever_warned = false; // the meta's chain

  GstVideoInfo info;               // the task
  KlvUnit unit;                    // the task
  MaskPool masks;                  // the task
  SmallPool boundaries;            // the task
  std::vector<std::uint16_t> rows; // the task

  CombineState() {
    gst_segment_init(&video_segment, GST_FORMAT_TIME);
    gst_segment_init(&meta_segment, GST_FORMAT_TIME);
    gst_video_info_init(&info);
  }
};

} // namespace terrainseg

using namespace terrainseg;

struct GstTerrainCombine {
  GstElement parent;
  GstPad *sink, *meta, *src;
  CombineState* state;
};
struct GstTerrainCombineClass {
  GstElementClass parent_class;
};

G_DEFINE_TYPE(GstTerrainCombine, gst_terrain_combine, GST_TYPE_ELEMENT)
GST_ELEMENT_REGISTER_DEFINE(terraincombine, "terraincombine", GST_RANK_NONE, gst_terrain_combine_get_type())

namespace {

enum { property_latency = 1, property_stats };

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

/// Signed running time of a position in a segment; never when it has none.
Time running_time(const GstSegment& segment, GstClockTime position) {
  guint64 time = 0;
  if (!GST_CLOCK_TIME_IS_VALID(position) || segment.format != GST_FORMAT_TIME)
    return never;
  const int sign = gst_segment_to_running_time_full(&segment, GST_FORMAT_TIME, position, &time);
  return sign == 0 ? never : sign > 0 ? static_cast<Time>(time) : -static_cast<Time>(time);
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
  e.mask_region = scaled(e.mask_region, e, width, height);
  e.window = scaled(e.window, e, width, height);
  e.frame_width = width;
  e.frame_height = height;
}

/// The frame with what the unit says; the frame as it was when the unit cannot be used.
GstBuffer* attach_unit(GstTerrainCombine* self, GstBuffer* frame, GstBuffer* klv) {
  CombineState& s = *self->state;
  GstMapInfo map;
  if (!gst_buffer_map(klv, &map, GST_MAP_READ))
    return frame;
  const KlvVerdict verdict = s.unit.decode({map.data, map.size});
  gst_buffer_unmap(klv, &map);
  if (verdict != KlvVerdict::ok) // it was, when it came: somebody wrote into it
    return frame;
  Estimate e = s.unit.estimate();
  const int width = GST_VIDEO_INFO_WIDTH(&s.info), height = GST_VIDEO_INFO_HEIGHT(&s.info);
  if (width > 0 && height > 0 && (e.frame_width != width || e.frame_height != height))
    fit(e, s.rows, width, height);

  OwnedBuffer mask = s.masks.acquire(e.mask.width, e.mask.height);
  OwnedBuffer boundary = e.boundary.empty() ? nullptr : s.boundaries.acquire(e.boundary.size() * 2);
  GstMapInfo pixels, columns;
  if (!mask || (!boundary && !e.boundary.empty()) || !gst_buffer_map(mask.get(), &pixels, GST_MAP_WRITE))
    return frame;
  s.unit.draw_mask({pixels.data, gst_buffer_get_video_meta(mask.get())->stride[0]});
  gst_buffer_unmap(mask.get(), &pixels);
  if (boundary) {
    if (!gst_buffer_map(boundary.get(), &columns, GST_MAP_WRITE))
      return frame;
    for (std::size_t i = 0; i < e.boundary.size(); ++i)
      GST_WRITE_UINT16_LE(columns.data + 2 * i, e.boundary[i]);
    gst_buffer_unmap(boundary.get(), &columns);
  }
  frame = gst_buffer_make_writable(frame);
  attach(frame, e, mask.get(), boundary.get());
  return frame;
}

// ---- the task --------------------------------------------------------------------------------------------

/// Half a frame: nearer to this frame than to its neighbours.
Time tolerance_of(const CombineState& s, GstBuffer* frame) {
  if (GST_BUFFER_DURATION_IS_VALID(frame) && GST_BUFFER_DURATION(frame) > 0)
    return static_cast<Time>(GST_BUFFER_DURATION(frame) / 2);
  if (GST_VIDEO_INFO_FPS_N(&s.info) > 0)
    return static_cast<Time>(gst_util_uint64_scale_int(GST_SECOND / 2, GST_VIDEO_INFO_FPS_D(&s.info),
                                                       GST_VIDEO_INFO_FPS_N(&s.info)));
  return default_tolerance;
}

/// Waits for the unit of the first item, a frame. nullptr: there is none, or `s.flushing`.
OwnedBuffer wait_for_unit(GstTerrainCombine* self, Lock& lock) {
  CombineState& s = *self->state;
  const Time time = s.items.front().time;
  const Clock::time_point deadline = s.items.front().arrival + std::chrono::milliseconds(s.latency_ms);
  const Time tolerance = tolerance_of(s, GST_BUFFER(s.items.front().object.get()));
  OwnedBuffer unit;
  while (!s.flushing && time != never) {
    unit = s.units.take(time, tolerance);
    if (unit || s.meta_eos || s.meta_flushing || s.meta_stalled || s.units.is_past(time, tolerance) ||
        !gst_pad_is_linked(self->meta))
      break;
    if (Clock::now() >= deadline) {
      s.meta_stalled = true;
      break;
    }
    s.changed.wait_until(lock, deadline);
  }
  if (time != never)
    s.counts.unused += s.units.drop_before(time - tolerance);
  return unit;
}

void push_frame(GstTerrainCombine* self, Lock& lock) {
  CombineState& s = *self->state;
  OwnedBuffer klv = wait_for_unit(self, lock);
  if (s.flushing)
    return;
  GstBuffer* frame = GST_BUFFER(s.items.front().object.release());
  s.items.pop_front();
  ++(klv ? s.counts.matched : s.counts.lost);
  s.pushing = true;
  s.changed.notify_all();
  lock.unlock();
  if (klv)
    frame = attach_unit(self, frame, klv.get());
  const GstFlowReturn flow = gst_pad_push(self->src, frame);
  lock.lock();
  s.pushing = false;
  if (!s.flushing)
    s.flow = flow;
  s.changed.notify_all();
}

void push_event(GstTerrainCombine* self, Lock& lock) {
  CombineState& s = *self->state;
  GstEvent* event = GST_EVENT(s.items.front().object.release());
  s.items.pop_front();
  s.pushing = true;
  s.changed.notify_all();
  lock.unlock();
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
  std::size_t frames = 0;
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
  return first == never || last == never || last - first > latency || frames > 64;
}

GstFlowReturn take_frame(GstTerrainCombine* self, GstBuffer* frame) {
  CombineState& s = *self->state;
  Item item{std::unique_ptr<GstMiniObject, ObjectUnref>(GST_MINI_OBJECT_CAST(frame)), Clock::now(),
            running_time(s.video_segment, GST_BUFFER_PTS(frame))};
  Lock lock(s.mutex);
  s.changed.wait(lock, [&] { return s.flushing || s.flow != GST_FLOW_OK || !is_full(s); });
  if (s.flushing)
    return GST_FLOW_FLUSHING;
  if (s.flow != GST_FLOW_OK)
    return s.flow;
  item.arrival = Clock::now();
  s.items.push_back(std::move(item));
  s.changed.notify_all();
  return GST_FLOW_OK;
}

GstFlowReturn video_chain(GstPad*, GstObject* parent, GstBuffer* frame) {
  return guarded(parent, GST_FLOW_ERROR, [&] { return take_frame(self_of(parent), frame); });
}

void flush_video(GstTerrainCombine* self, bool flushing) {
  CombineState& s = *self->state;
  const Lock lock(s.mutex);
  s.flushing = flushing;
  s.flow = flushing ? GST_FLOW_FLUSHING : GST_FLOW_OK;
  // What was queued before the flush is dropped on both of its sides.
  std::deque<Item> sticky;
  for (Item& item : s.items)
    if (!item.is_frame() && has_flag(GST_EVENT(item.object.get()), GST_EVENT_TYPE_STICKY) &&
        GST_EVENT_TYPE(item.object.get()) != GST_EVENT_EOS &&
        GST_EVENT_TYPE(item.object.get()) != GST_EVENT_SEGMENT)
      sticky.push_back(std::move(item));
  s.items = std::move(sticky);
  s.changed.notify_all();
}

gboolean queue_event(GstTerrainCombine* self, GstEvent* event) {
  CombineState& s = *self->state;
  Item item{std::unique_ptr<GstMiniObject, ObjectUnref>(GST_MINI_OBJECT_CAST(event)), Clock::now(), never};
  GstFlowReturn flow = GST_FLOW_OK;
  const bool eos = GST_EVENT_TYPE(event) == GST_EVENT_EOS;
  {
    const Lock lock(s.mutex);
    flow = s.flow;
    // After an end the next stream begins; the task has paused.
    if (GST_EVENT_TYPE(event) == GST_EVENT_STREAM_START && flow == GST_FLOW_EOS && !s.flushing) {
      s.flow = flow = GST_FLOW_OK;
      gst_pad_start_task(self->src, guarded_loop, self, nullptr);
    }
    if (flow == GST_FLOW_OK) {
      s.items.push_back(std::move(item));
      s.changed.notify_all();
      return TRUE;
    }
  }
  // Errors travel upstream with the next frame; at the end there is none.
  if (eos && (flow == GST_FLOW_NOT_LINKED || flow < GST_FLOW_EOS))
    GST_ELEMENT_FLOW_ERROR(self, flow);
  return FALSE;
}

gboolean video_event(GstPad* pad, GstObject* parent, GstEvent* event) {
  GstTerrainCombine* self = self_of(parent);
  CombineState& s = *self->state;
  switch (GST_EVENT_TYPE(event)) {
  case GST_EVENT_FLUSH_START: {
    const gboolean pushed = gst_pad_push_event(self->src, event);
    flush_video(self, true);
    gst_pad_pause_task(self->src);
    return pushed;
  }
  case GST_EVENT_FLUSH_STOP: {
    gst_segment_init(&s.video_segment, GST_FORMAT_TIME);
    const gboolean pushed = gst_pad_push_event(self->src, event);
    flush_video(self, false);
    if (GST_PAD_IS_ACTIVE(self->src))
      gst_pad_start_task(self->src, guarded_loop, self, nullptr);
    return pushed;
  }
  case GST_EVENT_SEGMENT:
    gst_event_copy_segment(event, &s.video_segment);
    break;
  default:
    break;
  }
  if (!has_flag(event, GST_EVENT_TYPE_SERIALIZED))
    return gst_pad_event_default(pad, parent, event);
  return guarded<gboolean>(self, FALSE, [&] { return queue_event(self, event); });
}

gboolean video_query(GstPad* pad, GstObject* parent, GstQuery* query) {
  GstTerrainCombine* self = self_of(parent);
  CombineState& s = *self->state;
  if (!(gst_query_type_get_flags(GST_QUERY_TYPE(query)) & GST_QUERY_TYPE_SERIALIZED))
    return gst_pad_query_default(pad, parent, query);
  {
    // In order: what came before it has left.
    Lock lock(s.mutex);
    s.changed.wait(lock,
                   [&] { return s.flushing || s.flow != GST_FLOW_OK || (s.items.empty() && !s.pushing); });
    if (s.flushing || s.flow != GST_FLOW_OK)
      return FALSE;
  }
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

void reject(GstTerrainCombine* self, KlvVerdict verdict, const std::string& error) {
  CombineState& s = *self->state;
  std::uint64_t count = 0;
  {
    const Lock lock(s.mutex);
    count = ++s.counts.rejected;
  }
  GST_WARNING_OBJECT(self, "KLV unit skipped: %s", error.c_str());
  // On a bad link this comes many times a second; the bus hears of it once a second.
  const Clock::time_point now = Clock::now();
  if (s.ever_warned && now - s.warned < std::chrono::seconds(1))
    return;
  s.ever_warned = true;
  s.warned = now;
  GST_ELEMENT_WARNING(self, STREAM, DECODE,
                      ("A %s KLV unit was skipped (%" G_GUINT64_FORMAT " so far): %s.",
                       verdict == KlvVerdict::foreign ? "foreign" : "damaged", static_cast<guint64>(count),
                       error.c_str()),
                      ("%s", error.c_str()));
}

void take_unit(GstTerrainCombine* self, OwnedBuffer unit) {
  CombineState& s = *self->state;
  const Time time = running_time(s.meta_segment, GST_BUFFER_PTS(unit.get()));
  // Units behind an encoder with B-frames come in coding order: only their DTS tells what cannot come any
  // more.
  const Time decoding = running_time(s.meta_segment, GST_BUFFER_DTS(unit.get()));
  GstMapInfo map;
  if (!gst_buffer_map(unit.get(), &map, GST_MAP_READ))
    return reject(self, KlvVerdict::damaged, "its memory cannot be read");
  const KlvVerdict verdict = s.checked.decode({map.data, map.size});
  gst_buffer_unmap(unit.get(), &map);
  if (verdict != KlvVerdict::ok)
    return reject(self, verdict, s.checked.error());

  Lock lock(s.mutex);
  s.meta_stalled = false;
  s.meta_eos = false;
  if (time == never) {
    GST_DEBUG_OBJECT(self, "a KLV unit without a time stamp matches no frame");
    ++s.counts.unused;
    return;
  }
  if (s.units.size() >= most_units) {
    s.changed.wait_for(lock, std::chrono::milliseconds(std::max<guint>(s.latency_ms, 1000)),
                       [&] { return s.meta_flushing || s.units.size() < most_units; });
    while (s.units.size() >= most_units)
      s.counts.unused += s.units.drop_oldest();
  }
  s.counts.unused += s.units.add(time, std::move(unit), decoding != never ? std::min(decoding, time) : time);
  s.changed.notify_all();
}

GstFlowReturn meta_chain(GstPad*, GstObject* parent, GstBuffer* buffer) {
  OwnedBuffer unit(buffer);
  return guarded(parent, GST_FLOW_ERROR, [&] {
    GstTerrainCombine* self = self_of(parent);
    take_unit(self, std::move(unit));
    const Lock lock(self->state->mutex);
    return self->state->meta_flushing ? GST_FLOW_FLUSHING : GST_FLOW_OK;
  });
}

void flush_meta(GstTerrainCombine* self, bool flushing) {
  CombineState& s = *self->state;
  const Lock lock(s.mutex);
  s.meta_flushing = flushing;
  s.meta_eos = s.meta_stalled = false;
  s.units.clear();
  s.changed.notify_all();
}

/// Nothing of the units' stream goes on: the video's events are the output's.
gboolean meta_event(GstPad*, GstObject* parent, GstEvent* event) {
  GstTerrainCombine* self = self_of(parent);
  CombineState& s = *self->state;
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
  case GST_EVENT_GAP: {
    GstClockTime start = GST_CLOCK_TIME_NONE, duration = GST_CLOCK_TIME_NONE;
    gst_event_parse_gap(event, &start, &duration);
    if (GST_CLOCK_TIME_IS_VALID(start) && GST_CLOCK_TIME_IS_VALID(duration))
      start += duration;
    const Time time = running_time(s.meta_segment, start);
    const Lock lock(s.mutex);
    if (time != never)
      s.units.advance(time);
    s.changed.notify_all();
    break;
  }
  case GST_EVENT_STREAM_START: {
    const Lock lock(s.mutex);
    s.meta_eos = s.meta_stalled = false;
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
  // Units must follow where the video goes, also when they come from a source of their own.
  if (GST_EVENT_TYPE(event) == GST_EVENT_SEEK && gst_pad_is_linked(self->meta))
    gst_pad_push_event(self->meta, gst_event_ref(event));
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
    s.ever_warned = false;
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
    g_value_take_boxed(value, gst_structure_new("terraincombine-stats", "matched", G_TYPE_UINT64,
                                                static_cast<guint64>(counts.matched), "lost", G_TYPE_UINT64,
                                                static_cast<guint64>(counts.lost), "rejected", G_TYPE_UINT64,
                                                static_cast<guint64>(counts.rejected), "unused",
                                                G_TYPE_UINT64, static_cast<guint64>(counts.unused), nullptr));
  } else
    G_OBJECT_WARN_INVALID_PROPERTY_ID(object, id, spec);
}

void finalize(GObject* object) {
  delete self_of(object)->state;
  G_OBJECT_CLASS(gst_terrain_combine_parent_class)->finalize(object);
}

} // namespace

static void gst_terrain_combine_class_init(GstTerrainCombineClass* klass) {
  GST_DEBUG_CATEGORY_INIT(terraincombine_debug, "terraincombine", 0, "terrain metadata from KLV");
  GObjectClass* object_class = G_OBJECT_CLASS(klass);
  object_class->set_property = set_property;
  object_class->get_property = get_property;
  object_class->finalize = finalize;
  g_object_class_install_property(
      object_class, property_latency,
      g_param_spec_uint(
          "latency", "Latency",
          "Milliseconds that a frame waits at most for its KLV unit; live pipelines are delayed by it", 0,
          60000, default_latency,
          static_cast<GParamFlags>(G_PARAM_READWRITE | G_PARAM_STATIC_STRINGS | GST_PARAM_MUTABLE_PLAYING)));
  g_object_class_install_property(
      object_class, property_stats,
      g_param_spec_boxed("stats", "Statistics",
                         "Counts since the start: frames matched and lost, KLV units rejected and unused",
                         GST_TYPE_STRUCTURE,
                         static_cast<GParamFlags>(G_PARAM_READABLE | G_PARAM_STATIC_STRINGS)));
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
  self->state = new CombineState;
  self->sink = gst_pad_new_from_static_template(&sink_template, "sink");
  gst_pad_set_chain_function(self->sink, video_chain);
  gst_pad_set_event_function(self->sink, video_event);
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
