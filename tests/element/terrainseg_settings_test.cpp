// SPDX-License-Identifier: LGPL-2.1-or-later
// terrainseg's properties: presets, precedence, ranges, contradictions, changes while playing.
#include <glib/gstdio.h>
#include <gst/controller/gstdirectcontrolbinding.h>
#include <gst/controller/gstinterpolationcontrolsource.h>
#include <gst/terrainseg/terrainsegmeta.h>

#include <atomic>
#include <map>
#include <thread>
#include <utility>

#include "harness.hpp"

namespace terrainseg::test {
namespace {

/// The value of a property as gst-launch would write it.
std::string text(GstElement* element, const char* property) {
  GParamSpec* spec = g_object_class_find_property(G_OBJECT_GET_CLASS(element), property);
  EXPECT_NE(spec, nullptr) << property;
  GValue value = G_VALUE_INIT;
  g_value_init(&value, spec->value_type);
  g_object_get_property(G_OBJECT(element), property, &value);
  gchar* serialized = gst_value_serialize(&value);
  std::string result = serialized ? serialized : "";
  g_free(serialized);
  g_value_unset(&value);
  return result;
}

void set_text(GstElement* element, const char* property, const std::string& value) {
  gst_util_set_object_arg(G_OBJECT(element), property, value.c_str());
}

struct Column {
  const char* property;
  const char* standard;
  const char* paper;
};
// Written down from the documented table, not from the code.
const Column columns[] = {
    {"window-width", "0", "0"},
    {"window-height", "0", "0"},
    {"window-bottom", "0", "0"},
    {"window-x", "-1", "-1"},
    {"window-sigma", "1.25", "1"},
    {"pyramid-levels", "-1", "5"},
    {"bit-shift", "4", "3"},
    {"training-models", "3", "3"},
    {"learned-models", "5", "5"},
    {"match-threshold", "1", "1"},
    {"mass-cap", "0", "64"},
    {"forget-shift", "5", "0"},
    {"seed", "1", "1"},
    {"learning", "true", "true"},
    {"near-clear", "true", "true"},
    {"threshold", "2", "3"},
    {"horizon", "auto", "paper"},
    {"texture", "true", "false"},
    {"exposure", "true", "false"},
    {"row-prior", "true", "false"},
    {"local-reference", "true", "false"},
    {"geodesic", "true", "false"},
    {"second-look", "true", "false"},
    {"connected-ground", "true", "false"},
    {"light-ahead", "true", "false"},
    {"own-shadow", "false", "false"},
    {"upright", "true", "false"},
    {"long-lines", "true", "false"},
    {"free-space", "true", "false"},
    {"ground-behind", "true", "false"},
    {"odd-spots", "true", "false"},
    {"refine", "true", "false"},
    {"near-spots", "true", "false"},
    {"far-spots", "true", "false"},
    {"stone-field", "true", "false"},
    {"window-guard", "true", "false"},
    {"vivid-colors", "true", "false"},
    {"negatives", "rest", "off"},
    {"temporal", "auto", "off"},
    {"motion", "auto", "off"},
    {"vanishing-row", "-1", "-1"},
    {"horizon-hint", "-1", "-1"},
    {"caution", "0", "0"},
    {"doubtful", "-24", "-96"},
    {"mask-level", "0", "0"},
    {"blocked-below", "200", "200"},
    {"n-threads", "1", "1"},
};

TEST(Presets, SetTheDocumentedColumns) {
  auto element = make_element("terrainseg");
  for (const Column& c : columns)
    EXPECT_EQ(text(element.get(), c.property), c.standard) << c.property;
  set_text(element.get(), "preset", "paper");
  for (const Column& c : columns)
    EXPECT_EQ(text(element.get(), c.property), c.paper) << c.property;
  set_text(element.get(), "preset", "default");
  for (const Column& c : columns)
    EXPECT_EQ(text(element.get(), c.property), c.standard) << c.property;
}

TEST(Presets, AnExplicitPropertyWinsInEitherOrder) {
  for (const char* description : {"terrainseg threshold=2.5 texture=true horizon=off preset=paper",
                                  "terrainseg preset=paper threshold=2.5 texture=true horizon=off"}) {
    auto element = make_element(description);
    EXPECT_EQ(text(element.get(), "threshold"), "2.5");
    EXPECT_EQ(text(element.get(), "texture"), "true");
    EXPECT_EQ(text(element.get(), "horizon"), "off");
    EXPECT_EQ(text(element.get(), "mass-cap"), "64"); // the preset's
    set_text(element.get(), "preset", "default");
    EXPECT_EQ(text(element.get(), "threshold"), "2.5");
    EXPECT_EQ(text(element.get(), "mass-cap"), "0");
  }
  // Explicitly set to what another preset happens to say.
  auto element = make_element("terrainseg window-sigma=1.25 preset=paper");
  EXPECT_EQ(text(element.get(), "window-sigma"), "1.25");
}

TEST(Presets, ANearEventCountsAsExplicit) {
  Rig rig("terrainseg", caps_text("I420", 64, 64));
  gst_harness_push_event(
      rig.harness(),
      gst_event_new_custom(GST_EVENT_CUSTOM_DOWNSTREAM, gst_structure_new(GST_TERRAIN_SEG_NEAR_EVENT, "clear",
                                                                          G_TYPE_BOOLEAN, FALSE, nullptr)));
  set_text(rig.element(), "preset", "paper");
  EXPECT_EQ(text(rig.element(), "near-clear"), "false");
}

TEST(Properties, ReadBackWhatWasSet) {
  auto element = make_element("terrainseg");
  const std::map<const char*, const char*> values = {
      {"window-width", "320"},
      {"window-sigma", "0.3125"},
      {"match-threshold", "0.75"},
      {"threshold", "2.625"},
      {"seed", "4294967295"},
      {"negatives", "split"},
      {"temporal", "on"},
      {"reset-on", "discont"},
      {"overlay-alpha", "0.375"},
      {"overlay-style", "models"},
      {"overlay-color", "4278190335"},
      {"model-location", "/some/where"},
      {"caution", "-7"},
      {"ignore-regions",
       "< (array)< (int)0, (int)600, (int)1280, (int)120 >, (array)< (int)5, (int)6, (int)7, (int)8 > >"}};
  for (const auto& [property, value] : values) {
    set_text(element.get(), property, value);
    EXPECT_EQ(text(element.get(), property), value) << property;
  }
  // Fixed point inside does not show: 0.3 is no multiple of 1/256.
  for (const char* property : {"window-sigma", "match-threshold", "threshold"}) {
    double value = 0;
    g_object_set(element.get(), property, 0.3, nullptr);
    g_object_get(element.get(), property, &value, nullptr);
    EXPECT_EQ(value, 0.3) << property;
  }
}

TEST(Properties, RangesAreThoseOfTheCore) {
  auto element = make_element("terrainseg");
  guint count = 0;
  GParamSpec** specs = g_object_class_list_properties(G_OBJECT_GET_CLASS(element.get()), &count);
  for (guint i = 0; i < count; ++i) {
    GParamSpec* spec = specs[i];
    const std::string name = spec->name;
    const std::string blurb = g_param_spec_get_blurb(spec);
    EXPECT_FALSE(blurb.empty()) << name;
    // Both ends of every range pass the core's own check.
    if (G_IS_PARAM_SPEC_INT(spec) && name != "training-models" && name != "learned-models")
      for (int value : {G_PARAM_SPEC_INT(spec)->minimum, G_PARAM_SPEC_INT(spec)->maximum}) {
        auto other = make_element("terrainseg");
        g_object_set(other.get(), name.c_str(), value, nullptr);
        EXPECT_NE(gst_element_set_state(other.get(), GST_STATE_PAUSED), GST_STATE_CHANGE_FAILURE)
            << name << value;
        gst_element_set_state(other.get(), GST_STATE_NULL);
      }
    if (G_IS_PARAM_SPEC_DOUBLE(spec))
      for (double value : {G_PARAM_SPEC_DOUBLE(spec)->minimum, G_PARAM_SPEC_DOUBLE(spec)->maximum}) {
        auto other = make_element("terrainseg");
        g_object_set(other.get(), name.c_str(), value, nullptr);
        EXPECT_NE(gst_element_set_state(other.get(), GST_STATE_PAUSED), GST_STATE_CHANGE_FAILURE)
            << name << value;
        gst_element_set_state(other.get(), GST_STATE_NULL);
      }
  }
  g_free(specs);
}

/// The error of going to PAUSED with these settings; empty when it went well.
Report start_error(const std::string& settings) {
  auto element = make_element("terrainseg " + settings);
  Owned<GstBus> bus(gst_bus_new());
  gst_element_set_bus(element.get(), bus.get());
  const auto change = gst_element_set_state(element.get(), GST_STATE_PAUSED);
  const auto errors = reports(bus.get(), GST_MESSAGE_ERROR);
  EXPECT_EQ(change == GST_STATE_CHANGE_FAILURE, errors.size() == 1) << settings;
  gst_element_set_state(element.get(), GST_STATE_NULL);
  gst_element_set_bus(element.get(), nullptr);
  return errors.empty() ? Report{} : errors[0];
}

TEST(Settings, ContradictionsAreRefusedAtStartByName) {
  for (const char* settings : {"training-models=5", "training-models=3 learned-models=3",
                               "training-models=8 learned-models=8", "preset=paper learned-models=3"}) {
    const Report error = start_error(settings);
    EXPECT_TRUE(error.contains("learned-models")) << settings << ": " << error.user;
    EXPECT_TRUE(error.contains("training-models")) << settings << ": " << error.user;
  }
  EXPECT_TRUE(start_error("").user.empty());
  EXPECT_TRUE(start_error("preset=paper").user.empty());
}

TEST(Settings, IgnoreRegionsThatAreNoRectanglesAreRefused) {
  for (const char* regions : {"<<0,0,10>>", "<<0,0,0,10>>", "<<-1,0,5,5>>", "<1,2,3>", "<<0,0,100000,5>>",
                              "<<a,b,c,d>>", "<<0,0,5,5>,3>"}) {
    const Report error = start_error(std::string("ignore-regions=\"") + regions + "\"");
    EXPECT_TRUE(error.contains("ignore-regions")) << regions;
  }
  for (const char* regions : {"<>", "<<0,0,5,5>>", "<0,0,5,5>", "<0,0,5,5,10,10,5,5>"})
    EXPECT_TRUE(start_error(std::string("ignore-regions=\"") + regions + "\"").user.empty()) << regions;
}

TEST(Settings, AContradictionWhilePlayingIsReportedAndTheOldValuesStay) {
  Rig rig("terrainseg", caps_text("I420", 160, 120));
  const guint generation = rig.generation_after(3);
  g_object_set(rig.element(), "training-models", 6, nullptr);
  const guint after = rig.generation_after(2);
  EXPECT_GT(after, generation);
  const auto warnings = rig.warnings();
  ASSERT_EQ(warnings.size(), 1u);
  EXPECT_TRUE(warnings[0].contains("learned-models"));
  EXPECT_TRUE(rig.errors().empty());
  g_object_set(rig.element(), "learned-models", 8, nullptr); // now they agree
  EXPECT_GT(rig.generation_after(2), after);
  EXPECT_TRUE(rig.warnings().empty());
}

TEST(Settings, IgnoredRegionsAreUnknownInTheMask) {
  Rig rig("terrainseg ignore-regions=\"<<32,64,64,32>>\"", caps_text("I420", 320, 240));
  Owned<GstBuffer> out;
  for (int i = 0; i < 4; ++i)
    out = rig.step();
  const EstimateReader reader(out.get());
  const Estimate& e = reader.estimate();
  for (int y = 64; y < 96; ++y)
    for (int x = 32; x < 96; ++x)
      ASSERT_EQ(e.mask.plane.row(y)[x], 128) << x << "," << y;
  EXPECT_EQ(e.mask.plane.row(20)[300], 0);
  set_text(rig.element(), "ignore-regions", "<>");
  out = rig.step();
  EXPECT_EQ(EstimateReader(out.get()).estimate().mask.plane.row(70)[40], 0);
}

TEST(Settings, AWindowThatIsIgnoredAltogetherStarves) {
  Rig rig("terrainseg ignore-regions=\"<<0,150,320,90>>\"", caps_text("I420", 320, 240));
  const auto out = rig.step();
  EXPECT_TRUE(EstimateReader(out.get()).estimate().flags & flag_starved);
  EXPECT_EQ(rig.counter("skipped-starved"), 1u);
}

TEST(Settings, ControlledPropertiesFollowTheirCurve) {
  Rig rig("terrainseg", caps_text("I420", 64, 64));
  GstControlSource* curve = gst_interpolation_control_source_new();
  g_object_set(curve, "mode", GST_INTERPOLATION_MODE_LINEAR, nullptr);
  auto* points = GST_TIMED_VALUE_CONTROL_SOURCE(curve);
  gst_timed_value_control_source_set(points, 0, 0.0);
  gst_timed_value_control_source_set(points, GST_SECOND / 3, 1.0);
  ASSERT_TRUE(gst_object_add_control_binding(
      GST_OBJECT(rig.element()),
      gst_direct_control_binding_new_absolute(GST_OBJECT(rig.element()), "overlay-alpha", curve)));
  gst_object_unref(curve);
  for (int i = 0; i < 10; ++i) {
    rig.step();
    double alpha = -1;
    g_object_get(rig.element(), "overlay-alpha", &alpha, nullptr);
    EXPECT_NEAR(alpha, i / 10.0, 0.001);
  }
}

TEST(Settings, EveryControllablePropertyTakesABinding) {
  auto element = make_element("terrainseg");
  guint count = 0, controllable = 0;
  GParamSpec** specs = g_object_class_list_properties(G_OBJECT_GET_CLASS(element.get()), &count);
  for (guint i = 0; i < count; ++i) {
    if (!(specs[i]->flags & GST_PARAM_CONTROLLABLE))
      continue;
    ++controllable;
    EXPECT_TRUE(specs[i]->flags & GST_PARAM_MUTABLE_PLAYING) << specs[i]->name;
    GstControlSource* curve = gst_interpolation_control_source_new();
    EXPECT_TRUE(gst_object_add_control_binding(
        GST_OBJECT(element.get()),
        gst_direct_control_binding_new(GST_OBJECT(element.get()), specs[i]->name, curve)))
        << specs[i]->name;
    gst_object_unref(curve);
  }
  g_free(specs);
  EXPECT_GT(controllable, 20u);
  for (const char* name : {"overlay", "overlay-style", "overlay-alpha", "overlay-color"})
    EXPECT_TRUE(g_object_class_find_property(G_OBJECT_GET_CLASS(element.get()), name)->flags &
                GST_PARAM_CONTROLLABLE);
}

TEST(Settings, ChangesRaceWithTheStreamingThread) {
  Rig rig("terrainseg", caps_text("I420", 160, 120));
  std::atomic<bool> done = false;
  std::atomic<int> rounds = 0;
  const auto change = [&](unsigned start) {
    for (unsigned i = start; !done; ++i) {
      g_object_set(rig.element(), "threshold", (i % 16) + 0.5, "caution", static_cast<int>(i % 201) - 100,
                   "mask-level", static_cast<int>(i % 6), "overlay", i % 2 == 0, "overlay-alpha",
                   (i % 11) / 10.0, nullptr);
      set_text(rig.element(), "preset", i % 3 ? "default" : "paper");
      set_text(rig.element(), "ignore-regions", i % 2 ? "<<0,0,16,16>>" : "<>");
      set_text(rig.element(), "horizon", i % 2 ? "off" : "auto");
      GstStructure* stats = nullptr;
      g_object_get(rig.element(), "stats", &stats, nullptr);
      gst_structure_free(stats);
      if (i % 7 == 0)
        g_signal_emit_by_name(rig.element(), "reset");
      ++rounds;
    }
  };
  std::thread a(change, 0), b(change, 1000);
  int frames = 0;
  for (; frames < 150 || (rounds < 50 && frames < 5000); ++frames) {
    const auto out = rig.step();
    const EstimateReader reader(out.get());
    EXPECT_TRUE(reader) << reader.error();
  }
  done = true;
  a.join();
  b.join();
  EXPECT_GE(rounds, 50);
  for (const Report& warning : rig.warnings()) // first: to look for errors throws other messages away
    EXPECT_TRUE(warning.contains("without effect")) << warning.user;
}

// ---- stages ----------------------------------------------------------------------------------------------

/// Counts notifications by property.
class Notified {
 public:
  explicit Notified(GstElement* element) : element_(element) {
    id_ = g_signal_connect(element, "notify", G_CALLBACK(+[](GObject*, GParamSpec* spec, gpointer self) {
                             ++static_cast<Notified*>(self)->counts_[spec->name];
                           }),
                           this);
  }
  ~Notified() { g_signal_handler_disconnect(element_, id_); }
  Notified(const Notified&) = delete;
  Notified& operator=(const Notified&) = delete;
  /// Since the last call.
  std::map<std::string, int> take() { return std::exchange(counts_, {}); }

 private:
  GstElement* element_;
  gulong id_;
  std::map<std::string, int> counts_;
};

using Counts = std::map<std::string, int>;

TEST(Stages, MirrorTheBooleansBothWays) {
  auto element = make_element("terrainseg");
  const std::vector<std::string> names = {"texture",   "exposure",    "row-prior",        "local-reference",
                                          "geodesic",  "second-look", "connected-ground", "ground-behind",
                                          "odd-spots", "refine",      "light-ahead",      "upright",
                                          "long-lines"};
  for (const std::string& name : names) {
    EXPECT_NE(text(element.get(), "stages").find(name), std::string::npos) << name;
    g_object_set(element.get(), name.c_str(), FALSE, nullptr);
    EXPECT_EQ(text(element.get(), "stages").find(name), std::string::npos) << name;
  }
  set_text(element.get(), "stages", "refine+texture");
  for (const std::string& name : names)
    EXPECT_EQ(text(element.get(), name.c_str()), name == "refine" || name == "texture" ? "true" : "false")
        << name;
  set_text(element.get(), "stages", "0");
  EXPECT_EQ(text(element.get(), "refine"), "false");
}

TEST(Stages, NotifyBothWays) {
  auto element = make_element("terrainseg");
  guint all = 0;
  g_object_get(element.get(), "stages", &all, nullptr);
  GParamSpec* spec = g_object_class_find_property(G_OBJECT_GET_CLASS(element.get()), "stages");
  const guint refine = g_flags_get_value_by_nick(G_PARAM_SPEC_FLAGS(spec)->flags_class, "refine")->value;
  Notified notified(element.get());
  g_object_set(element.get(), "texture", FALSE, nullptr);
  EXPECT_EQ(notified.take(), (Counts{{"texture", 1}, {"stages", 1}}));
  g_object_set(element.get(), "texture", FALSE, nullptr); // the same again
  EXPECT_EQ(notified.take(), (Counts{{"texture", 1}}));
  g_object_set(element.get(), "stages", all & ~refine, nullptr);
  EXPECT_EQ(notified.take(), (Counts{{"texture", 1}, {"refine", 1}, {"stages", 1}}));
}

TEST(Stages, AreExplicitOnceSet) {
  auto element = make_element("terrainseg stages=texture preset=paper");
  EXPECT_EQ(text(element.get(), "texture"), "true");
  set_text(element.get(), "preset", "default");
  EXPECT_EQ(text(element.get(), "refine"), "false");
}

TEST(Stages, ThatAreOffChangeTheMask) {
  Rig with("terrainseg", caps_text("I420", 320, 240)),
      without("terrainseg stages=0", caps_text("I420", 320, 240)),
      by_booleans(
          "terrainseg texture=false exposure=false row-prior=false local-reference=false "
          "geodesic=false second-look=false connected-ground=false ground-behind=false odd-spots=false "
          "refine=false light-ahead=false upright=false",
          caps_text("I420", 320, 240));
  const auto mask_of = [](Rig& rig) {
    rig.step();
    const auto out = rig.step();
    return bytes_of(EstimateReader(out.get()).estimate().mask);
  };
  const auto bare = mask_of(without);
  EXPECT_NE(mask_of(with), bare);
  EXPECT_EQ(mask_of(by_booleans), bare);
}

// The booleans say the same as stages, and free-space as preset: deprecated, and they work (above).
TEST(Stages, TheirBooleansAreDeprecated) {
  auto element = make_element("terrainseg");
  guint count = 0, stages = 0;
  const std::unique_ptr<GParamSpec*, decltype(&g_free)> specs(
      g_object_class_list_properties(G_OBJECT_GET_CLASS(element.get()), &count), g_free);
  const std::string all = "+" + text(element.get(), "stages") + "+";
  for (guint i = 0; i < count; ++i) {
    const GParamSpec* spec = specs.get()[i];
    const std::string name = spec->name;
    const bool is_stage = all.find("+" + name + "+") != std::string::npos;
    stages += is_stage;
    const bool deprecated = spec->flags & G_PARAM_DEPRECATED;
    EXPECT_EQ(deprecated, is_stage || name == "free-space" || name == "own-shadow") << name;
    EXPECT_EQ(deprecated, std::string(g_param_spec_get_blurb(specs.get()[i])).rfind("Deprecated, ", 0) == 0)
        << name;
  }
  EXPECT_GE(stages, 8u);
}

// ---- presets and their way back --------------------------------------------------------------------------

TEST(Presets, NotifyEveryPropertyThatChanged) {
  auto element = make_element("terrainseg texture=true");
  Notified notified(element.get());
  set_text(element.get(), "preset", "paper");
  Counts expected{{"preset", 1}, {"stages", 1}};
  for (const Column& c : columns)
    if (std::string(c.standard) != c.paper && std::string(c.property) != "texture")
      expected[c.property] = 1;
  EXPECT_EQ(notified.take(), expected);
  EXPECT_GT(expected.size(), 15u);
  set_text(element.get(), "preset", "paper");
  EXPECT_EQ(notified.take(), (Counts{{"preset", 1}}));
}

gboolean unset(GstElement* element, const char* name) {
  gboolean known = FALSE;
  g_signal_emit_by_name(element, "unset-property", name, &known);
  return known;
}

TEST(UnsetProperty, GivesAPropertyBackToThePreset) {
  auto element =
      make_element("terrainseg threshold=2 preset=paper"); // the default's value: pinned all the same
  EXPECT_EQ(text(element.get(), "threshold"), "2");
  Notified notified(element.get());
  EXPECT_TRUE(unset(element.get(), "threshold"));
  EXPECT_EQ(notified.take(), (Counts{{"threshold", 1}}));
  EXPECT_EQ(text(element.get(), "threshold"), "3");
  set_text(element.get(), "preset", "default");
  EXPECT_EQ(text(element.get(), "threshold"), "2");
  EXPECT_FALSE(unset(element.get(), "no-such-property"));
}

TEST(UnsetProperty, WithoutANameGivesBackAll) {
  auto element =
      make_element("terrainseg preset=paper threshold=2.125 stages=texture overlay=true overlay-alpha=0.5 "
                   "window-rect=0,0.5,1,0.5 ignore-regions=\"<<0,0,8,8>>\" reset-on=never "
                   "model-location=/x seed=9 horizon=off");
  Notified notified(element.get());
  EXPECT_TRUE(unset(element.get(), nullptr));
  const auto told = notified.take();
  for (const char* name : {"preset", "threshold", "stages", "refine", "overlay", "overlay-alpha",
                           "window-rect", "ignore-regions", "reset-on", "model-location", "seed", "horizon"})
    EXPECT_EQ(told.count(name), 1u) << name;
  auto fresh = make_element("terrainseg");
  guint count = 0;
  GParamSpec** specs = g_object_class_list_properties(G_OBJECT_GET_CLASS(fresh.get()), &count);
  for (guint i = 0; i < count; ++i)
    if (specs[i]->owner_type == G_OBJECT_TYPE(fresh.get()) && std::string(specs[i]->name) != "stats") {
      EXPECT_EQ(text(element.get(), specs[i]->name), text(fresh.get(), specs[i]->name)) << specs[i]->name;
    }
  g_free(specs);
}

// ---- settings without effect -----------------------------------------------------------------------------

/// The warnings of one run of two frames.
std::vector<Report> warnings_of(const std::string& settings) {
  Rig rig("terrainseg " + settings, caps_text("I420", 160, 120));
  rig.step();
  rig.step();
  return rig.warnings();
}

TEST(Unused, IsToldOnceByName) {
  for (const char* settings :
       {"threshold=2", "bit-shift=2", "preset=paper texture=true", "preset=paper refine=true",
        "preset=paper caution=4", "preset=paper geodesic=true", "preset=paper doubtful=0",
        "preset=paper negatives=rest", "preset=paper temporal=on", "free-space=false texture=true",
        "preset=paper stages=refine"}) {
    const auto warnings = warnings_of(settings);
    ASSERT_EQ(warnings.size(), 1u) << settings;
    const std::string all = settings;
    const std::size_t start =
        all.find("stages") != std::string::npos ? all.rfind('=') + 1 : all.rfind(' ') + 1;
    const std::string name = all.substr(start, all.find('=', start) - start);
    EXPECT_TRUE(warnings[0].contains(name.c_str())) << settings << ": " << warnings[0].user;
    EXPECT_TRUE(warnings[0].contains("without effect")) << warnings[0].user;
  }
}

TEST(Unused, IsNotWhatDoesSomethingOrWasSwitchedOff) {
  for (const char* settings :
       {"", "preset=paper", "texture=false", "caution=3", "preset=paper threshold=2",
        "preset=paper bit-shift=2", "preset=paper texture=false", "preset=paper stages=0",
        "preset=paper doubtful=-96", "free-space=false threshold=3", "window-width=50"})
    EXPECT_TRUE(warnings_of(settings).empty()) << settings;
}

TEST(Unused, IsToldWhilePlayingOnceARun) {
  Rig rig("terrainseg", caps_text("I420", 160, 120));
  for (int i = 0; i < 3; ++i) {
    g_object_set(rig.element(), "threshold", 1.0 + i, nullptr);
    rig.step();
  }
  EXPECT_EQ(rig.warnings().size(), 1u);
  set_text(rig.element(), "preset", "paper"); // now it does something; texture does not
  g_object_set(rig.element(), "texture", TRUE, nullptr);
  rig.step();
  const auto warnings = rig.warnings();
  ASSERT_EQ(warnings.size(), 1u);
  EXPECT_TRUE(warnings[0].contains("texture"));
  EXPECT_FALSE(warnings[0].contains("threshold"));
}

TEST(Unused, IsInTheBlurb) {
  auto element = make_element("terrainseg");
  for (const auto& [name, words] : {std::pair{"threshold", "with preset=paper only"},
                                    {"texture", "not used with preset=paper"},
                                    {"stages", "not used with preset=paper"}}) {
    GParamSpec* spec = g_object_class_find_property(G_OBJECT_GET_CLASS(element.get()), name);
    EXPECT_NE(std::string(g_param_spec_get_blurb(spec)).find(words), std::string::npos) << name;
  }
}

// The stage own-shadow was removed: pipelines that name it still play, as without it, and are told.
TEST(Removed, IsAcceptedIgnoredAndToldOnce) {
  const auto mask_of = [](const std::string& settings) {
    Rig rig("terrainseg " + settings, caps_text("I420", 160, 120));
    rig.step();
    const auto out = rig.step();
    return bytes_of(EstimateReader(out.get()).estimate().mask);
  };
  for (const char* settings : {"own-shadow=true", "own-shadow=false", "stages=refine+own-shadow",
                               "preset=paper own-shadow=false", "own-shadow=true preset=paper"}) {
    const auto warnings = warnings_of(settings);
    ASSERT_EQ(warnings.size(), 1u) << settings;
    EXPECT_TRUE(warnings[0].contains("without effect: own-shadow.")) << warnings[0].user;
  }
  EXPECT_EQ(mask_of("own-shadow=true"), mask_of("own-shadow=false"));
  EXPECT_EQ(mask_of("stages=refine+own-shadow"), mask_of("stages=refine"));
}

TEST(Removed, IsNotToldWhereItIsNotNamed) {
  for (const char* settings : {"stages=refine", "own-shadow=true stages=refine", "stages=0"})
    EXPECT_TRUE(warnings_of(settings).empty()) << settings;
  auto element = make_element("terrainseg own-shadow=true stages=refine");
  EXPECT_EQ(text(element.get(), "own-shadow"), "false");
  EXPECT_EQ(text(element.get(), "stages"), "refine");
}

// ---- a settings file -------------------------------------------------------------------------------------

class SettingsFileTest : public testing::Test {
 protected:
  SettingsFileTest() {
    gchar* name = nullptr;
    const int file = g_file_open_tmp("terrainseg-XXXXXX.ini", &name, nullptr);
    EXPECT_GE(file, 0);
    g_close(file, nullptr);
    path_ = name;
    g_free(name);
  }
  ~SettingsFileTest() override { g_unlink(path_.c_str()); }
  void write(const std::string& contents) {
    ASSERT_TRUE(
        g_file_set_contents(path_.c_str(), contents.data(), static_cast<gssize>(contents.size()), nullptr));
  }
  std::string path_;
};

TEST_F(SettingsFileTest, GivesWhatWasNotSetExplicitly) {
  write("# a comment\n[terrainseg]\npreset=paper\nthreshold=2.125\nwindow-rect=0,0.5,1,0.5\nhorizon=off\n"
        "overlay-alpha=0.25\nseed=7\nreset-on=never\nignore-regions=<<0,0,16,16>>\n\n[other]\nkey=1\n");
  auto element = make_element("terrainseg seed=3 settings-location=" + path_);
  Notified notified(element.get());
  EXPECT_EQ(text(element.get(), "threshold"), "2"); // read at start
  ASSERT_NE(gst_element_set_state(element.get(), GST_STATE_PAUSED), GST_STATE_CHANGE_FAILURE);
  const auto told = notified.take();
  for (const auto& [name, value] : {std::pair{"preset", "paper"},
                                    {"threshold", "2.125"},
                                    {"horizon", "off"},
                                    {"overlay-alpha", "0.25"},
                                    {"reset-on", "never"},
                                    {"mass-cap", "64"},
                                    {"seed", "3"}}) { // explicit
    EXPECT_EQ(text(element.get(), name), value) << name;
    EXPECT_EQ(told.count(name), std::string(name) == "seed" ? 0u : 1u) << name;
  }
  gchar* rect = nullptr;
  g_object_get(element.get(), "window-rect", &rect, nullptr);
  EXPECT_STREQ(rect, "0,0.5,1,0.5");
  g_free(rect);
  // Another preset does not take what the file says.
  set_text(element.get(), "preset", "default");
  EXPECT_EQ(text(element.get(), "threshold"), "2.125");
  EXPECT_EQ(text(element.get(), "mass-cap"), "0");
  gst_element_set_state(element.get(), GST_STATE_NULL);
}

TEST_F(SettingsFileTest, IsReadAnewAtEveryStart) {
  write("[terrainseg]\ncaution=5\nmask-level=2\n");
  auto element = make_element("terrainseg settings-location=" + path_);
  gst_element_set_state(element.get(), GST_STATE_PAUSED);
  gst_element_set_state(element.get(), GST_STATE_NULL);
  EXPECT_EQ(text(element.get(), "caution"), "5");
  write("[terrainseg]\nmask-level=1\n");
  gst_element_set_state(element.get(), GST_STATE_PAUSED);
  gst_element_set_state(element.get(), GST_STATE_NULL);
  EXPECT_EQ(text(element.get(), "caution"), "0");
  EXPECT_EQ(text(element.get(), "mask-level"), "1");
}

TEST_F(SettingsFileTest, ErrorsNameFileKeyAndReason) {
  const std::pair<const char*, std::vector<const char*>> cases[] = {
      {"[terrainseg]\nthreshold=17\n", {"threshold", "17", "0..16"}},
      {"[terrainseg]\ncaution=much\n", {"caution", "much", "whole number"}},
      {"[terrainseg]\nhorizon=low\n", {"horizon", "low", "off, paper, auto"}},
      {"[terrainseg]\ncolour=red\n", {"colour", "no such property"}},
      {"[terrainseg]\nstats=1\n", {"stats", "no such property"}},
      {"[terrainseg]\nsettings-location=x\n", {"settings-location", "no such property"}},
      {"[terrainseg]\nwindow-rect=0,0,2,2\n", {"window-rect", "0,0,2,2", "0..1"}},
      {"[terrainseg]\nignore-regions=<<1,2>>\n", {"ignore-regions", "must be"}},
      {"[terrainseg]\noverlay-alpha=2\n", {"overlay-alpha", "2", "out of range"}},
      {"[terrainseg]\npreset=best\n", {"preset", "best"}},
      {"[terrainseg]\nnonsense\n", {"nonsense"}},
      {"[else]\ncaution=1\n", {"[terrainseg]"}},
      {"caution=1\n", {"group"}},
  };
  for (const auto& [contents, words] : cases) {
    write(contents);
    const Report error = start_error("settings-location=" + path_);
    EXPECT_TRUE(error.contains(path_.c_str())) << contents << error.user;
    for (const char* word : words)
      EXPECT_TRUE(error.contains(word)) << contents << error.user;
  }
  const Report missing = start_error("settings-location=/no/such/file.ini");
  EXPECT_TRUE(missing.contains("/no/such/file.ini")) << missing.user;
}

TEST_F(SettingsFileTest, ThatIsWrongChangesNothing) {
  write("[terrainseg]\ncaution=5\nthreshold=17\n");
  auto element = make_element("terrainseg settings-location=" + path_);
  EXPECT_EQ(gst_element_set_state(element.get(), GST_STATE_PAUSED), GST_STATE_CHANGE_FAILURE);
  EXPECT_EQ(text(element.get(), "caution"), "0");
  gst_element_set_state(element.get(), GST_STATE_NULL);
}

// ---- the vanishing line ---------------------------------------------------------------------------------

double vanishing_row_of(Rig& rig) {
  const auto out = rig.step();
  return gst_terrain_seg_meta_get_vanishing_row(gst_buffer_get_terrain_seg_structure(out.get()));
}

TEST(VanishingRow, IsToldAndChangesWhilePlaying) {
  Rig rig("terrainseg vanishing-row=50", caps_text("I420", 320, 240));
  EXPECT_EQ(vanishing_row_of(rig), 50);
  g_object_set(rig.element(), "vanishing-row", 70, nullptr);
  EXPECT_EQ(vanishing_row_of(rig), 70);
  g_object_set(rig.element(), "vanishing-row", -20, nullptr);
  EXPECT_EQ(vanishing_row_of(rig), -1) << "above the picture";
  EXPECT_TRUE(rig.warnings().empty());
}

TEST(VanishingRow, BelowTheFrameIsWarnedOfOnceAndNotUsed) {
  Rig rig("terrainseg vanishing-row=240", caps_text("I420", 320, 240)),
      without("terrainseg", caps_text("I420", 320, 240));
  for (int i = 0; i < 3; ++i) {
    const auto out = rig.step(), plain = without.step();
    EXPECT_EQ(bytes_of(EstimateReader(out.get()).estimate().mask),
              bytes_of(EstimateReader(plain.get()).estimate().mask));
  }
  const auto warnings = rig.warnings();
  ASSERT_EQ(warnings.size(), 1u);
  EXPECT_TRUE(warnings[0].contains("vanishing-row = 240")) << warnings[0].user;
  EXPECT_TRUE(warnings[0].contains("240 rows"));
  g_object_set(rig.element(), "vanishing-row", 500, nullptr);
  rig.step();
  EXPECT_EQ(rig.warnings().size(), 1u) << "another row";
}

// ---- rounding, types -------------------------------------------------------------------------------------

TEST(Properties, EveryEnumerationIsMarkedAsPluginApi) {
  for (const char* factory : {"terrainseg", "terrainoverlay", "terrainscenesrc"}) {
    auto element = make_element(factory);
    guint count = 0, found = 0;
    GParamSpec** specs = g_object_class_list_properties(G_OBJECT_GET_CLASS(element.get()), &count);
    for (guint i = 0; i < count; ++i)
      if (G_IS_PARAM_SPEC_ENUM(specs[i]) || G_IS_PARAM_SPEC_FLAGS(specs[i])) {
        ++found;
        GstPluginAPIFlags flags;
        EXPECT_TRUE(gst_type_is_plugin_api(specs[i]->value_type, &flags)) << specs[i]->name;
      }
    g_free(specs);
    EXPECT_GT(found, 0u) << factory;
  }
}

} // namespace
} // namespace terrainseg::test
