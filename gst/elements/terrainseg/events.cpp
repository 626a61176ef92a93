// SPDX-License-Identifier: LGPL-2.1-or-later
#include "elements/terrainseg/shared.hpp"

#include <gst/terrainseg/terrainsegmeta.h>

#include <utility>
#include <vector>

#include "elements/terrainseg/metric_stage.hpp"
#include "support/element.hpp"

namespace terrainseg {
namespace {

/// The caller notifies when the lock is free again: of what it sets, because nothing else changes.
void set(GstElement* element, Shared& shared, const char* name, const GValue* value)
    TERRAINSEG_REQUIRES(shared.mutex) {
  const GParamSpec* spec = g_object_class_find_property(G_OBJECT_GET_CLASS(element), name);
  shared.book.set(spec->param_id, value);
}

const char* take_near(GstElement* element, Shared& shared, const GstStructure* fields) {
  const GValue* clear = gst_structure_get_value(fields, "clear");
  if (!clear || !G_VALUE_HOLDS_BOOLEAN(clear))
    return "it lacks the boolean field \"clear\"";
  {
    const Lock lock(shared.mutex);
    set(element, shared, "near-clear", clear);
  }
  g_object_notify(G_OBJECT(element), "near-clear");
  return nullptr;
}

/// Poses come a hundred times a second.
bool is_first_pose_flaw(Shared& shared) {
  const Lock lock(shared.mutex);
  return shared.pose_flaw.first();
}

void post_region(GstElement* element, const char* kind, const Rectangle& r, bool removed) {
  gst_element_post_message(
      element,
      gst_message_new_element(
          GST_OBJECT(element),
          gst_structure_new(GST_TERRAIN_SEG_REGION_MESSAGE, "kind", G_TYPE_STRING, kind, "x", G_TYPE_INT, r.x,
                            "y", G_TYPE_INT, r.y, "width", G_TYPE_INT, r.width, "height", G_TYPE_INT,
                            r.height, "removed", G_TYPE_BOOLEAN, static_cast<gboolean>(removed), nullptr)));
}

void place_window(GstElement* element, Shared& shared, const Rectangle& window, int frame_height) {
  const std::pair<const char*, int> pixels[] = {
      {"window-x", window.x},
      {"window-width", window.width},
      {"window-height", window.height},
      {"window-bottom", frame_height - window.y - window.height},
  };
  {
    GValue value = G_VALUE_INIT;
    g_value_init(&value, G_TYPE_INT);
    GValue none = G_VALUE_INIT; // fractions would have precedence over pixels
    g_value_init(&none, G_TYPE_STRING);
    g_value_set_static_string(&none, "");
    const Lock lock(shared.mutex); // a frame sees all of them or none
    for (const auto& [name, number] : pixels) {
      g_value_set_int(&value, number);
      set(element, shared, name, &value);
    }
    set(element, shared, "window-rect", &none);
  }
  for (const auto& [name, number] : pixels)
    g_object_notify(G_OBJECT(element), name);
  g_object_notify(G_OBJECT(element), "window-rect");
  post_region(element, "window", window, false);
}

/// The window in force, moved so that its middle is at a point, as far as the frame allows; empty before the
/// first frame.
Rectangle moved_window(Shared& shared, int x, int y, int frame_width, int frame_height) {
  Rectangle window = shared.learned.window();
  window.x = std::clamp(x - window.width / 2, 0, std::max(0, frame_width - window.width));
  window.y = std::clamp(y - window.height / 2, 0, std::max(0, frame_height - window.height));
  return window;
}

bool contains(const Rectangle& r, int x, int y) {
  return x >= r.x && y >= r.y && x < r.x + r.width && y < r.y + r.height;
}

/// Adds an ignored region; a click removes those under it.
void change_ignored(GstElement* element, Shared& shared, const RegionDrawer::Drawn& drawn) {
  std::vector<Rectangle> removed;
  {
    const Lock lock(shared.mutex);
    std::vector<Rectangle> kept;
    for (const Rectangle& r : shared.book.settings().core.ignore_regions)
      (drawn.region.empty() && contains(r, drawn.x, drawn.y) ? removed : kept).push_back(r);
    if (!drawn.region.empty())
      kept.push_back(drawn.region);
    else if (removed.empty())
      return;
    g_auto(GValue) array = G_VALUE_INIT;
    g_value_init(&array, GST_TYPE_ARRAY);
    put_regions(kept, &array);
    set(element, shared, "ignore-regions", &array);
  }
  g_object_notify(G_OBJECT(element), "ignore-regions");
  if (!drawn.region.empty())
    post_region(element, "ignore", drawn.region, false);
  for (const Rectangle& r : removed)
    post_region(element, "ignore", r, true);
}

} // namespace

bool take_custom_event(GstElement* element, Shared& shared, MetricStage& metres, GstEvent* event) {
  const GstStructure* fields = gst_event_get_structure(event);
  const bool near = fields && gst_structure_has_name(fields, GST_TERRAIN_SEG_NEAR_EVENT);
  if (!near && !(fields && gst_structure_has_name(fields, GST_TERRAIN_SEG_POSE_EVENT)))
    return false;
  const char* flaw = near ? take_near(element, shared, fields) : metres.take_pose(fields);
  if (flaw && (near || is_first_pose_flaw(shared)))
    GST_ELEMENT_WARNING(element, STREAM, FAILED,
                        ("Invalid event %s, ignored: %s.", gst_structure_get_name(fields), flaw),
                        ("event %" GST_PTR_FORMAT, printable(event)));
  return !flaw;
}

void edit_regions(GstElement* element, Shared& shared, GstEvent* event) {
  const int width = shared.frame_width, height = shared.frame_height;
  std::optional<RegionDrawer::Drawn> drawn;
  {
    const Lock lock(shared.mutex);
    drawn = shared.drawer.take(event, width, height);
  }
  if (!drawn)
    return;
  if (drawn->button == RegionDrawer::ignore_button)
    return change_ignored(element, shared, *drawn);
  const Rectangle window =
      drawn->region.empty() ? moved_window(shared, drawn->x, drawn->y, width, height) : drawn->region;
  if (!window.empty())
    place_window(element, shared, window, height);
}

} // namespace terrainseg
