// SPDX-License-Identifier: LGPL-2.1-or-later
// A running element allocates nothing of its own: operator new is counted, in the plugin too, which binds to
// the one that this program exports. What GStreamer takes for its metas and structures comes from elsewhere.
#include "../support/allocations.hpp"

#include <glib/gstdio.h>
#include <gst/terrainseg/terrainsegmeta.h>

#include "harness.hpp"

namespace terrainseg::test {
namespace {

void add_vetoes(GstBuffer* buffer, int index);

long allocations_of_a_frame(const char* settings, const char* format, bool vetoes = false) {
  Rig rig(settings, caps_text(format, 320, 240));
  for (int i = 0; i < 12; ++i) {
    GstBuffer* buffer = new_frame(rig.info(), i);
    if (vetoes)
      add_vetoes(buffer, i % 2);
    EXPECT_EQ(rig.push(buffer), GST_FLOW_OK);
    rig.pull();
  }
  constexpr int frames = 10;
  std::vector<GstBuffer*> buffers;
  for (int i = 0; i < frames; ++i)
    buffers.push_back(new_frame(rig.info(), 12 + i, 1 + i));
  if (vetoes)
    for (int i = 0; i < frames; ++i)
      add_vetoes(buffers[static_cast<std::size_t>(i)], i);
  const long before = allocations;
  for (GstBuffer* buffer : buffers) {
    EXPECT_EQ(rig.push(buffer), GST_FLOW_OK);
    rig.pull();
  }
  return allocations - before;
}

/// A person who walks: a region and a mask whose number of runs changes.
void add_vetoes(GstBuffer* buffer, int index) {
  gst_buffer_add_video_region_of_interest_meta(buffer, "person", static_cast<guint>(100 + 5 * index), 100, 30,
                                               80);
  GstBuffer* mask = new_mask_buffer(64, 48);
  gst_buffer_memset(mask, 0, 0, 64 * 48);
  for (gsize i = 0; i < static_cast<gsize>(10 * index); ++i)
    gst_buffer_memset(mask, (i * 97) % (64 * 48), 255, 1);
  GstCustomMeta* meta = gst_buffer_add_custom_meta(buffer, GST_TERRAIN_VETO_META_NAME);
  gst_structure_set(gst_custom_meta_get_structure(meta), "mask", GST_TYPE_BUFFER, mask, nullptr);
  gst_buffer_unref(mask);
}

TEST(Allocation, IsCountedInThePluginToo) {
  const long before = allocations;
  Rig("terrainseg", caps_text("I420", 320, 240)).step(); // makes its segmenter with new
  EXPECT_GT(allocations, before);
}

/// No memory for C++ in this thread while it lives.
struct Drought {
  Drought() { no_memory = true; }
  ~Drought() { no_memory = false; }
};

bool is_locked(GstElement* element) {
  const bool free = GST_OBJECT_TRYLOCK(element);
  if (free)
    GST_OBJECT_UNLOCK(element);
  return !free;
}

// An instance's init and a pad's activation have no way to fail: without memory they do not need any.
TEST(Allocation, ElementsAreMadeAndActivatedWithoutMemory) {
  for (const char* name : {"terrainseg", "terrainoverlay", "terrainextract", "terraincombine", "terrainstamp",
                           "terrainscenesrc", "terrainreference"}) {
    if (std::strcmp(name, "terrainreference") == 0 && !have(name))
      continue;                                     // built without the tools
    Owned<GstElement> element = make_element(name); // its class and templates
    element.reset();
    GstElementFactory* factory = gst_element_factory_find(name);
    ASSERT_TRUE(factory) << name;
    {
      const Drought drought;
      element.reset(GST_ELEMENT(gst_object_ref_sink(gst_element_factory_create(factory, nullptr))));
    }
    gst_object_unref(factory);
    EXPECT_TRUE(element) << name;
  }
  Owned<GstElement> combine = make_element("terraincombine");
  const Drought drought;
  for (int i = 0; i < 4; ++i) // ends inactive: an active source pad has a task
    for (GList* item = combine->pads; item; item = item->next)
      EXPECT_TRUE(gst_pad_set_active(GST_PAD(item->data), i % 2 == 0));
}

TEST(Allocation, AGetterWithoutMemoryLeavesNoLock) {
  Rig rig("terrainseg", caps_text("I420", 320, 240));
  rig.step();
  GstStructure* stats = nullptr;
  {
    const Drought drought;
    g_object_get(rig.element(), "stats", &stats, nullptr);
  }
  EXPECT_EQ(stats, nullptr);
  EXPECT_FALSE(is_locked(rig.element()));
  EXPECT_EQ(rig.errors().size(), 1u) << "an error that names the element";
}

TEST(Allocation, MetresTakeNone) {
  gchar* path = nullptr;
  const int file = g_file_open_tmp("terrainseg-XXXXXX.yaml", &path, nullptr);
  g_close(file, nullptr);
  ASSERT_TRUE(g_file_set_contents(path,
                                  "image_width: 320\nimage_height: 240\n"
                                  "camera_matrix: {data: [277, 0, 160, 0, 277, 120, 0, 0, 1]}\n",
                                  -1, nullptr));
  const std::string metres = std::string("terrainseg camera-info=") + path + " mount=height=0.5,pitch=10deg";
  EXPECT_EQ(allocations_of_a_frame(metres.c_str(), "I420"), 0);
  g_unlink(path);
  g_free(path);
}

TEST(Allocation, VetoesTakeNone) {
  EXPECT_EQ(allocations_of_a_frame("terrainseg veto-roi-types=person", "I420", true), 0);
  EXPECT_EQ(allocations_of_a_frame("terrainseg preset=paper veto-roi-types=person", "NV12", true), 0);
}

TEST(Allocation, NoneAFrameOnceRunning) {
  for (const char* format : {"I420", "NV12", "YUY2", "RGB", "BGRx"}) {
    EXPECT_EQ(allocations_of_a_frame("terrainseg", format), 0) << format;
    EXPECT_EQ(allocations_of_a_frame("terrainseg preset=paper", format), 0) << format;
    EXPECT_EQ(allocations_of_a_frame("terrainseg overlay=true post-messages=true", format), 0) << format;
    EXPECT_EQ(allocations_of_a_frame("terrainseg mask-level=2 n-threads=2", format), 0) << format;
  }
}

} // namespace
} // namespace terrainseg::test
