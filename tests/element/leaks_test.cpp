// SPDX-License-Identifier: LGPL-2.1-or-later
// Starts and stops every element of the plugins and asks GStreamer's leaks tracer (GST_TRACERS=leaks) which
// objects are left.
#include <fcntl.h>
#include <unistd.h>

#include <map>
#include <memory>

#include "harness.hpp"

namespace terrainseg::test {
namespace {

using Tracer = std::unique_ptr<GstTracer, void (*)(gpointer)>;

Tracer leaks_tracer() {
  Tracer found(nullptr, gst_object_unref);
  GList* tracers = gst_tracing_get_active_tracers();
  for (GList* item = tracers; item; item = item->next)
    if (std::string("GstLeaksTracer") == G_OBJECT_TYPE_NAME(item->data))
      found.reset(static_cast<GstTracer*>(gst_object_ref(item->data)));
  g_list_free_full(tracers, gst_object_unref);
  return found;
}

/// Adds `sign` for every object, as TYPE@ADDRESS, of a list of the tracer.
void count(const GstStructure* checkpoint, const char* list_name, int sign,
           std::map<std::string, int>& counts) {
  const GValue* list = gst_structure_get_value(checkpoint, list_name);
  for (guint i = 0; i < gst_value_list_get_size(list); ++i) {
    const GstStructure* object = gst_value_get_structure(gst_value_list_get_value(list, i));
    counts[std::string(gst_structure_get_string(object, "type-name")) + '@' +
           gst_structure_get_string(object, "address")] += sign;
  }
}

/// The objects and mini objects that `body` leaves when it runs once more, after a first time that made what
/// stays for good. Not by get-live-objects: freeing what that gives frees the objects (GStreamer 1.22).
template <class Body> std::string left_by(Body body) {
  body();
  const Tracer tracer = leaks_tracer();
  g_signal_emit_by_name(tracer.get(), "activity-start-tracking");
  body();
  std::map<std::string, int> counts;
  std::string left;
  // A task's thread lets go of it a moment after it was joined.
  for (int tries = 0; tries == 0 || (!left.empty() && tries < 40); ++tries) {
    g_usleep(tries > 0 ? 50000 : 0);
    GstStructure* checkpoint = nullptr;
    g_signal_emit_by_name(tracer.get(), "activity-get-checkpoint", &checkpoint);
    count(checkpoint, "objects-created-list", 1, counts);
    count(checkpoint, "objects-removed-list", -1, counts);
    gst_structure_free(checkpoint);
    left.clear();
    for (const auto& [object, more] : counts)
      if (more > 0)
        left += object + ' ';
  }
  g_signal_emit_by_name(tracer.get(), "activity-stop-tracking");
  return left;
}

class Leaks : public testing::Test {
 protected:
  void SetUp() override { ASSERT_TRUE(leaks_tracer()) << "run with GST_TRACERS=leaks"; }
};

std::vector<std::string> element_names() {
  std::vector<std::string> names;
  for (const char* plugin : {"terrainseg", "terrainreference"}) {
    GList* features = gst_registry_get_feature_list_by_plugin(gst_registry_get(), plugin);
    for (GList* item = features; item; item = item->next)
      if (GST_IS_ELEMENT_FACTORY(item->data))
        names.emplace_back(gst_plugin_feature_get_name(item->data));
    gst_plugin_feature_list_free(features);
  }
  return names;
}

TEST_F(Leaks, AreFound) {
  GstElement* leaked = nullptr;
  GstBuffer* buffer = nullptr;
  const std::string left = left_by([&] {
    leaked = GST_ELEMENT(gst_object_ref_sink(gst_element_factory_make("terrainoverlay", nullptr)));
    buffer = gst_buffer_new();
  });
  EXPECT_NE(left.find("GstTerrainOverlay"), std::string::npos) << left;
  EXPECT_NE(left.find("GstBuffer"), std::string::npos) << left;
}

TEST_F(Leaks, NoElementLeavesOneWhenItIsStartedAndStopped) {
  const std::vector<std::string> names = element_names();
  EXPECT_GE(names.size(), 5u);
  for (const std::string& name : names) {
    const std::string left = left_by([&] {
      Owned<GstElement> element = make_element(name);
      for (const GstState state : {GST_STATE_READY, GST_STATE_NULL, GST_STATE_PAUSED, GST_STATE_READY,
                                   GST_STATE_PLAYING, GST_STATE_NULL})
        EXPECT_NE(gst_element_set_state(element.get(), state), GST_STATE_CHANGE_FAILURE) << name;
    });
    EXPECT_EQ(left, "") << name;
  }
}

TEST_F(Leaks, NoPipelineLeavesOneWhenItIsStoppedInTheMiddle) {
  const std::string scene = "terrainscenesrc name=source ! video/x-raw,format=I420,width=96,height=64 ! ";
  std::vector<std::string> descriptions = {
      scene + "terrainseg overlay=true post-messages=true ! terrainoverlay ! terrainextract ! "
              "application/x-ndjson ! fakesink name=out",
      scene + "terrainseg mask-level=2 ! tee name=t t. ! queue ! c.sink t. ! queue ! terrainextract ! "
              "meta/x-klv,parsed=true ! queue ! c.meta terraincombine name=c ! fakesink name=out",
      scene + "terrainseg ! terrainextract ! video/x-raw,format=GRAY8 ! fakesink name=out",
      scene + "terrainseg ! terrainextract ! application/x-mavlink ! fakesink name=out"};
  if (have("x264enc") && have("avdec_h264"))
    descriptions.push_back(
        scene + "terrainseg ! tee name=t t. ! queue ! x264enc tune=zerolatency ! h264parse ! "
                "terrainstamp ! h264parse ! terrainstamp mode=read ! avdec_h264 ! c.sink t. ! queue ! "
                "terrainextract ! meta/x-klv,parsed=true ! queue ! c.meta terraincombine name=c ! "
                "fakesink name=out");
  if (have("terrainreference"))
    descriptions.push_back(scene + "terrainreference ! fakesink name=out");
  const int nowhere = open("/dev/null", O_WRONLY | O_CLOEXEC);
  if (have("terrainmcapsink"))
    descriptions.push_back(scene + "terrainseg ! terrainmcapsink name=out fd=" + std::to_string(nowhere));
  if (have("terrainros2sink")) {
    g_setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "OFF", TRUE); // nothing leaves this process
    descriptions.push_back(scene +
                           "terrainseg ! terrainros2sink name=out pose-topic=odom near-clear-topic=clear");
  }
  for (const std::string& description : descriptions) {
    const std::string left = left_by([&] {
      Owned<GstElement> pipeline = make_element(description);
      for (int i = 0; i < 2; ++i) {
        gst_element_set_state(pipeline.get(), GST_STATE_PLAYING);
        EXPECT_EQ(gst_element_get_state(pipeline.get(), nullptr, nullptr, 20 * GST_SECOND),
                  GST_STATE_CHANGE_SUCCESS)
            << description; // the first buffer has come to the sink
        gst_element_set_state(pipeline.get(), GST_STATE_NULL);
      }
    });
    EXPECT_EQ(left, "") << description;
  }
  close(nowhere);
}

} // namespace
} // namespace terrainseg::test
