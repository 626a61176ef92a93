// SPDX-License-Identifier: LGPL-2.1-or-later
// Frames and serialized events of the video, in their order.
#pragma once

#include <gst/gst.h>

#include <algorithm>
#include <chrono>
#include <list>
#include <memory>
#include <optional>
#include <utility>

#include "elements/terraincombine/matcher.hpp"

namespace terrainseg {

/// Largest time difference between a frame and its unit when the frame rate is unknown: RTP rounds to 1 ms,
/// MPEG-TS to 11 us.
inline constexpr Time default_tolerance = 10 * GST_MSECOND;
/// Longer durations are invalid.
inline constexpr Time most_tolerance = 1800 * Time{GST_SECOND};

/// A frame or a serialized event on its way through.
struct Item {
  std::unique_ptr<GstMiniObject, ObjectUnref> object;
  Matcher::Clock::time_point arrival;
  Matcher::Frame frame; ///< without its tolerance, which the caps decide
  bool is_frame() const { return GST_IS_BUFFER(object.get()); }
  GstEventType event_type() const { return GST_EVENT_TYPE(object.get()); }
  bool is_sticky() const { return gst_event_type_get_flags(event_type()) & GST_EVENT_TYPE_STICKY; }
};

/// Not locked: the owner does.
class FrameQueue {
 public:
  /// Largest number of waiting frames and events; events alone (GAP) count too, to limit the memory.
  static constexpr std::size_t most_items = 4096;

  bool empty() const { return items_.empty(); }
  bool has_room() const { return items_.size() < most_items; }
  const Item& front() const { return items_.front(); }
  /// A list of one: adding it allocates nothing.
  void push(std::list<Item>& item) { items_.splice(items_.end(), item); }
  Item pop() {
    Item item = std::move(items_.front());
    items_.pop_front();
    return item;
  }
  void clear() { items_.clear(); }
  void drop_frames() {
    items_.remove_if([](const Item& item) { return item.is_frame(); });
  }
  void drop_events(GstEventType type) {
    items_.remove_if([=](const Item& item) { return !item.is_frame() && item.event_type() == type; });
  }
  /// Flush: drops all queued items like a pad does; sticky events except EOS and SEGMENT stay.
  void flush() {
    items_.remove_if([](const Item& item) {
      return item.is_frame() || !item.is_sticky() || item.event_type() == GST_EVENT_EOS ||
             item.event_type() == GST_EVENT_SEGMENT;
    });
  }
  /// Whether the queue has as much video as a frame may wait. `frame_duration` 0 = unknown.
  bool is_full(Time latency, Time frame_duration) const {
    if (!has_room())
      return true;
    std::int64_t frames = 0;
    Time first = never, last = never;
    for (const Item& item : items_)
      if (item.is_frame()) {
        ++frames;
        last = item.frame.time;
        if (first == never)
          first = item.frame.time;
      }
    if (frames < 3)
      return false;
    // Time stamps that stand still must not fill the memory: at most twice the frames that the rate allows.
    const Time half_frame =
        frame_duration > 0 ? std::min(frame_duration / 2, most_tolerance) : default_tolerance;
    return first == never || last == never || last - first > latency ||
           frames * half_frame > latency + 4 * half_frame;
  }

 private:
  std::list<Item> items_;
};

} // namespace terrainseg
