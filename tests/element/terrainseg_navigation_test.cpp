// SPDX-License-Identifier: LGPL-2.1-or-later
// Rectangles that a pointer in a video window draws.
#include <gst/terrainseg/terrainsegmeta.h>
#include <gst/video/navigation.h>

#include <map>

#include "harness.hpp"

namespace terrainseg::test {
namespace {

const std::string caps = caps_text("I420", 320, 240);

/// terrainseg as "seg" in a chain; what comes out is `out_caps`.
class Drawing {
 public:
  explicit Drawing(const std::string& chain = "terrainseg name=seg navigation=true ! identity")
      : harness_(gst_harness_new_parse(chain.c_str())), bus_(gst_bus_new()) {
    seg_.reset(gst_bin_get_by_name(GST_BIN(harness_->element), "seg"));
    gst_element_set_bus(harness_->element, bus_.get());
    gst_harness_set_src_caps(harness_.get(), gst_caps_from_string(caps.c_str()));
    g_signal_connect(
        seg_.get(), "notify",
        G_CALLBACK(+[](GObject*, GParamSpec* spec, Drawing* self) { ++self->notified[spec->name]; }), this);
    frame();
  }
  ~Drawing() { gst_element_set_bus(harness_->element, nullptr); }

  /// The window in force, of the frame that is pushed.
  Rectangle frame() {
    const Owned<GstBuffer> out(gst_harness_push_and_pull(harness_.get(), new_frame(info_of(caps), index_++)));
    EXPECT_TRUE(out);
    GstVideoRectangle r{};
    gst_terrain_seg_meta_get_window(gst_buffer_get_terrain_seg_structure(out.get()), &r);
    return {r.x, r.y, r.w, r.h};
  }
  void press(int button, double x, double y) {
    send(gst_navigation_event_new_mouse_button_press(button, x, y, GST_NAVIGATION_MODIFIER_NONE));
  }
  void release(int button, double x, double y) {
    send(gst_navigation_event_new_mouse_button_release(button, x, y, GST_NAVIGATION_MODIFIER_NONE));
  }
  void drag(int button, double x0, double y0, double x1, double y1) {
    press(button, x0, y0);
    send(gst_navigation_event_new_mouse_move((x0 + x1) / 2, (y0 + y1) / 2, GST_NAVIGATION_MODIFIER_NONE));
    release(button, x1, y1);
  }
  std::string ignored() {
    GValue value = G_VALUE_INIT;
    g_object_get_property(G_OBJECT(seg_.get()), "ignore-regions", &value);
    gchar* text = gst_value_serialize(&value);
    std::string result = text;
    g_free(text);
    g_value_unset(&value);
    return result;
  }
  /// What the messages since the last call say: kind x y width height removed.
  std::string told() {
    std::string text;
    while (GstMessage* message = gst_bus_pop_filtered(bus_.get(), GST_MESSAGE_ELEMENT)) {
      const GstStructure* s = gst_message_get_structure(message);
      EXPECT_STREQ(gst_structure_get_name(s), GST_TERRAIN_SEG_REGION_MESSAGE);
      text += gst_structure_get_string(s, "kind");
      for (const char* name : {"x", "y", "width", "height"}) {
        gint number = -1;
        EXPECT_TRUE(gst_structure_get_int(s, name, &number));
        text.append(" ").append(std::to_string(number));
      }
      gboolean removed = FALSE;
      EXPECT_TRUE(gst_structure_get_boolean(s, "removed", &removed));
      text += removed ? " removed;" : ";";
      gst_message_unref(message);
    }
    return text;
  }
  GstElement* seg() { return seg_.get(); }
  GstHarness* harness() { return harness_.get(); }
  std::map<std::string, int> notified;

 private:
  void send(GstEvent* event) { gst_harness_push_upstream_event(harness_.get(), event); }

  Owned<GstHarness> harness_;
  Owned<GstBus> bus_;
  struct Free {
    void operator()(GstElement* p) const { gst_object_unref(p); }
  };
  std::unique_ptr<GstElement, Free> seg_;
  int index_ = 0;
};

TEST(Navigation, ADragPlacesTheWindow) {
  Drawing d;
  d.drag(1, 200, 120, 100, 60); // from the lower right to the upper left
  EXPECT_EQ(d.frame(), (Rectangle{100, 60, 101, 61}));
  EXPECT_EQ(d.told(), "window 100 60 101 61;");
  for (const char* name : {"window-x", "window-width", "window-height", "window-bottom"})
    EXPECT_EQ(d.notified[name], 1) << name;
}

TEST(Navigation, AClickMovesTheWindowAsItIs) {
  Drawing d;
  const Rectangle before = d.frame();
  d.drag(1, 160, 120, 163, 122); // a hand is not steady
  Rectangle now = d.frame();
  EXPECT_EQ(now, (Rectangle{163 - before.width / 2, 122 - before.height / 2, before.width, before.height}));
  d.drag(1, 319, 0, 319, 0); // as far as the frame lets
  now = d.frame();
  EXPECT_EQ(now, (Rectangle{320 - before.width, 0, before.width, before.height}));
}

TEST(Navigation, TheRightButtonDrawsAndTakesAwayIgnoredRegions) {
  Drawing d;
  g_object_set(d.seg(), "window-x", 3, nullptr);
  d.drag(3, 0, 200, 319, 239);
  d.drag(3, 10, 190, 59, 229);
  EXPECT_EQ(d.ignored(), "< (array)< (int)0, (int)200, (int)320, (int)40 >, "
                         "(array)< (int)10, (int)190, (int)50, (int)40 > >");
  EXPECT_EQ(d.told(), "ignore 0 200 320 40;ignore 10 190 50 40;");
  d.drag(3, 300, 100, 300, 100); // nothing is there
  EXPECT_EQ(d.told(), "");
  EXPECT_EQ(d.notified["ignore-regions"], 2);
  d.drag(3, 300, 210, 301, 210);
  EXPECT_EQ(d.told(), "ignore 0 200 320 40 removed;");
  EXPECT_EQ(d.ignored(), "< (array)< (int)10, (int)190, (int)50, (int)40 > >");
  gint x = 0;
  g_object_get(d.seg(), "window-x", &x, nullptr);
  EXPECT_EQ(x, 3);
  d.frame();
}

TEST(Navigation, OutsideOfThePictureIsItsEdgeAndStrangeEventsAreNothing) {
  Drawing d;
  d.drag(1, -50, 100, 1e9, 1e9);
  EXPECT_EQ(d.frame(), (Rectangle{0, 100, 320, 140}));
  EXPECT_EQ(d.told(), "window 0 100 320 140;");
  d.drag(2, 10, 10, 100, 100);
  d.release(1, 100, 100); // was never pressed
  d.press(1, 10, 10);
  d.release(3, 100, 100); // another button
  EXPECT_EQ(d.told(), "");
}

TEST(Navigation, RightThroughScaling) {
  Drawing d("terrainseg name=seg navigation=true ! videoscale ! "
            "capsfilter caps=video/x-raw,width=160,height=60,pixel-aspect-ratio=1/2");
  d.drag(1, 50, 15, 99.5, 29.75);
  EXPECT_EQ(d.told(), "window 100 60 100 60;");
}

TEST(Navigation, OffByDefaultAndEventsTravelOn) {
  for (const bool on : {false, true}) {
    Drawing d(on ? "terrainseg name=seg navigation=true ! identity" : "terrainseg name=seg ! identity");
    const Rectangle before = d.frame();
    while (GstEvent* event = gst_harness_try_pull_upstream_event(d.harness()))
      gst_event_unref(event);
    d.drag(1, 100, 60, 200, 120);
    EXPECT_EQ(d.frame() == before, !on);
    int arrived = 0;
    while (GstEvent* event = gst_harness_try_pull_upstream_event(d.harness())) {
      arrived += GST_EVENT_TYPE(event) == GST_EVENT_NAVIGATION;
      gst_event_unref(event);
    }
    EXPECT_EQ(arrived, 3);
  }
}

} // namespace
} // namespace terrainseg::test
