// SPDX-License-Identifier: LGPL-2.1-or-later
// Each allocation of a short pipeline fails once: the n-th operator new, n from 1 to the last, in whatever
// thread and element it is. The pipeline ends or posts an error that names an element; no lock stays held,
// and the same pipeline runs again when there is memory. A crash ends the program, a hang the wait.
#include "../support/allocations.hpp"

#include <glib/gstdio.h>

#include <filesystem>
#include <thread>

#include "harness.hpp"

namespace terrainseg::test {
namespace {

constexpr int frames = 4;

/// How a run ended. Nothing of it is allocated by operator new while a failure is due.
struct End {
  bool hangs = false;
  Owned<GstMessage> error; ///< null = the stream came to its end
};

End run_to_the_end(GstElement* pipeline) {
  End end;
  Owned<GstBus> bus(gst_element_get_bus(pipeline));
  // A state change that fails has posted why.
  gst_element_set_state(pipeline, GST_STATE_PLAYING);
  Owned<GstMessage> message(gst_bus_timed_pop_filtered(
      bus.get(), 20 * GST_SECOND, static_cast<GstMessageType>(GST_MESSAGE_EOS | GST_MESSAGE_ERROR)));
  end.hangs = !message;
  if (message && GST_MESSAGE_TYPE(message.get()) == GST_MESSAGE_ERROR)
    end.error = std::move(message);
  gst_element_set_state(pipeline, GST_STATE_NULL);
  gst_bus_set_flushing(bus.get(), TRUE);
  gst_bus_set_flushing(bus.get(), FALSE);
  return end;
}

/// The locks of an element and its pads, seen from a thread that holds none.
bool holds_a_lock(GstElement* element) {
  bool held = false;
  const auto lock = [&held](GstObject* object) {
    if (!g_mutex_trylock(GST_OBJECT_GET_LOCK(object)))
      held = true;
    else
      g_mutex_unlock(GST_OBJECT_GET_LOCK(object));
  };
  lock(GST_OBJECT(element));
  for (GList* item = element->pads; item; item = item->next) {
    lock(GST_OBJECT(item->data));
    if (!g_rec_mutex_trylock(GST_PAD_GET_STREAM_LOCK(item->data)))
      held = true;
    else
      g_rec_mutex_unlock(GST_PAD_GET_STREAM_LOCK(item->data));
  }
  return held;
}

/// Names of the elements that keep a lock, or whose statistics cannot be asked for.
std::string stuck_elements(GstElement* pipeline) {
  std::string stuck;
  for (GList* item = GST_BIN_CHILDREN(pipeline); item; item = item->next) {
    auto* element = static_cast<GstElement*>(item->data);
    bool held = false;
    std::thread([&] { held = holds_a_lock(element); }).join();
    if (held)
      stuck += std::string(" ") + GST_ELEMENT_NAME(element);
  }
  return stuck;
}

std::string text_of(GstMessage* message) {
  GError* error = nullptr;
  gst_message_parse_error(message, &error, nullptr);
  const std::string text = std::string(GST_MESSAGE_SRC_NAME(message)) + ": " + error->message;
  g_clear_error(&error);
  return text;
}

/// Fails every allocation of `description` once; how many that were.
long fail_each(const std::string& description) {
  { // once with memory: types, debug categories, plugins
    Owned<GstElement> pipeline = make_element(description);
    EXPECT_FALSE(run_to_the_end(pipeline.get()).error) << description;
  }
  long failed = 0, errors = 0;
  for (long n = 1;; ++n) {
    failing_allocation = allocations + n;
    GError* refused = nullptr;
    Owned<GstElement> pipeline(
        GST_ELEMENT(gst_object_ref_sink(gst_parse_launch(description.c_str(), &refused))));
    EXPECT_EQ(refused, nullptr) << (refused ? refused->message : "");
    g_clear_error(&refused);
    const End end = run_to_the_end(pipeline.get());
    const bool has_failed = allocations >= failing_allocation;
    failing_allocation = 0;
    const std::string stuck = stuck_elements(pipeline.get());
    EXPECT_EQ(stuck, "") << "locks are held after allocation " << n << " failed";
    EXPECT_FALSE(end.hangs) << "without allocation " << n << " of " << description;
    if (!has_failed) {
      EXPECT_FALSE(end.error) << text_of(end.error.get());
      break; // the pipeline takes fewer than n
    }
    ++failed;
    if (end.error) {
      ++errors;
      const std::string text = text_of(end.error.get());
      EXPECT_TRUE(text.find("terrain") != std::string::npos) << text << " (allocation " << n << ')';
    }
    const End again = run_to_the_end(pipeline.get());
    EXPECT_FALSE(again.hangs || again.error) << "does not run again after allocation " << n << ": "
                                             << (again.error ? text_of(again.error.get()) : "it hangs");
    if (testing::Test::HasFailure())
      break;
  }
  std::printf("%ld allocations failed, %ld of them ended the pipeline with an error\n", failed, errors);
  EXPECT_GT(errors, 0) << "a failure that nobody notices proves nothing";
  return failed;
}

std::string scene(const char* size = "width=64,height=48") {
  return "terrainscenesrc num-buffers=" + std::to_string(frames) + " ! video/x-raw,format=I420," + size +
         " ! ";
}

TEST(AllocationFailure, OfAFilterAndItsWaysOut) {
  EXPECT_GE(fail_each(scene() +
                      "terrainseg overlay=true post-messages=true ! terrainoverlay ! terrainextract "
                      "json-mask=true ! application/x-ndjson ! fakesink"),
            100);
}

TEST(AllocationFailure, OfThePapersPreset) {
  EXPECT_GE(
      fail_each(scene() + "terrainseg preset=paper ! terrainextract ! video/x-raw,format=GRAY8 ! fakesink"),
      40);
}

TEST(AllocationFailure, OfALink) {
  EXPECT_GE(fail_each(scene() +
                      "terrainseg mask-level=2 n-threads=2 ! tee name=t t. ! queue ! c.sink t. ! queue ! "
                      "terrainextract ! meta/x-klv,parsed=true ! queue ! c.meta terraincombine name=c ! "
                      "terrainextract ! application/x-ndjson ! fakesink"),
            100);
}

TEST(AllocationFailure, OfMetresAndFiles) {
  const auto folder =
      std::filesystem::temp_directory_path() / ("terrainseg-" + std::to_string(g_random_int()));
  std::filesystem::create_directory(folder);
  const std::string camera = folder / "camera.yaml", model = folder / "learned.terrain";
  ASSERT_TRUE(g_file_set_contents(camera.c_str(),
                                  "image_width: 64\nimage_height: 48\n"
                                  "camera_matrix: {data: [55, 0, 32, 0, 55, 24, 0, 0, 1]}\n",
                                  -1, nullptr));
  {
    Rig rig("terrainseg", caps_text("I420", 64, 48));
    for (int i = 0; i < 12; ++i)
      rig.step();
    gboolean saved = FALSE;
    g_signal_emit_by_name(rig.element(), "save-model", model.c_str(), &saved);
    ASSERT_TRUE(saved);
  }
  EXPECT_GE(fail_each(scene() + "terrainseg camera-info=" + camera +
                      " mount=height=0.5,pitch=10deg model-location=" + model +
                      " ! terrainextract ! application/x-mavlink ! fakesink"),
            100);
  std::filesystem::remove_all(folder);
}

TEST(AllocationFailure, OfTheReference) {
  if (!have("terrainreference"))
    GTEST_SKIP() << "built without the tools";
  EXPECT_GE(fail_each(scene() + "terrainreference ! fakesink"), 20);
}

} // namespace
} // namespace terrainseg::test
