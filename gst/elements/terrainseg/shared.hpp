// SPDX-License-Identifier: LGPL-2.1-or-later
// The part of the element that any thread may touch, and the events that it understands: terrainseg-near and
// terrainseg-pose, which come from either side and on any thread, and the pointer in a video window
// downstream.
#pragma once

#include <gst/video/navigation.h>

#include <algorithm>
#include <atomic>
#include <cstdlib>
#include <optional>

#include "elements/terrainseg/learned_terrain.hpp"
#include "elements/terrainseg/settings_book.hpp"
#include "elements/terrainseg/statistics.hpp"
#include "support/mutex.hpp"
#include "support/properties.hpp"
#include "support/warnings.hpp"

// The category that all of the element's sources log and post under: GST_DEBUG=terrainseg:5.
GST_DEBUG_CATEGORY_EXTERN(terrainseg_debug);
#define GST_CAT_DEFAULT terrainseg_debug

namespace terrainseg {

class MetricStage;

/// What a pointer did between press and release. Not locked: the owner does.
class RegionDrawer {
 public:
  static constexpr int window_button = 1, ignore_button = 3; ///< left and right
  static constexpr int least_side = 8; ///< pixels; what is drawn smaller in one direction is a click

  struct Drawn {
    int button;
    Rectangle region; ///< inside the frame; empty where it was a click
    int x, y;         ///< where it was released, inside the frame
  };

  /// Takes a navigation event in pixels of a frame of that size. Something when it was drawn to its end.
  std::optional<Drawn> take(GstEvent* event, int frame_width, int frame_height) {
    const GstNavigationEventType type = gst_navigation_event_get_type(event);
    const bool press = type == GST_NAVIGATION_EVENT_MOUSE_BUTTON_PRESS;
    gint button = 0;
    gdouble x = 0, y = 0;
    if ((!press && type != GST_NAVIGATION_EVENT_MOUSE_BUTTON_RELEASE) || frame_width < 1 ||
        frame_height < 1 || !gst_navigation_event_parse_mouse_button_event(event, &button, &x, &y) ||
        (button != window_button && button != ignore_button))
      return std::nullopt;
    const Point here{inside(x, frame_width), inside(y, frame_height)};
    if (press) {
      button_ = button;
      start_ = here;
      return std::nullopt;
    }
    if (button_ != button) // pressed outside of the picture
      return std::nullopt;
    button_ = 0;
    Rectangle region{std::min(start_.x, here.x), std::min(start_.y, here.y), std::abs(here.x - start_.x) + 1,
                     std::abs(here.y - start_.y) + 1};
    region.width = std::min(region.width, frame_width - region.x); // the frame may have shrunk meanwhile
    region.height = std::min(region.height, frame_height - region.y);
    if (region.width < least_side || region.height < least_side)
      region = {};
    return Drawn{button, region, here.x, here.y};
  }

 private:
  struct Point {
    int x, y;
  };
  /// A pointer that is held may leave the picture; no number at all is its edge too.
  static int inside(double position, int size) {
    return position >= size - 1 ? size - 1 : position > 0 ? static_cast<int>(position) : 0;
  }

  int button_ = 0; ///< that is held, 0 = none
  Point start_{};
};

struct Shared {
  InternedName instance;
  std::atomic<bool> navigation = false;
  std::atomic<int> frame_width = 0, frame_height = 0; ///< of the caps
  LearnedTerrain learned;                             ///< locks by itself

  Mutex mutex; ///< held for copies only, never while a frame is processed
  SettingsBook book TERRAINSEG_GUARDED_BY(mutex);
  Statistics statistics TERRAINSEG_GUARDED_BY(mutex);
  RegionDrawer drawer TERRAINSEG_GUARDED_BY(mutex);
  Once<> pose_flaw TERRAINSEG_GUARDED_BY(mutex); ///< of this start
};

/// True when the event was one of them and was understood. The caller forwards it all the same.
bool take_custom_event(GstElement* element, Shared& shared, MetricStage& metres, GstEvent* event);

/// Takes a navigation event in pixels of the element's frames (elements that scale have rewritten it): sets
/// properties of `element`, notifies, and posts the message terrainseg-region.
void edit_regions(GstElement* element, Shared& shared, GstEvent* event);

} // namespace terrainseg
