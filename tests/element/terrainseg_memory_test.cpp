// SPDX-License-Identifier: LGPL-2.1-or-later
// Frames in DMABuf memory: read in place, between the two calls that keep the processor's cache and the
// device apart. A memfd stands for the buffer; this program's ioctl() is the one that GStreamer calls.
#include <gst/allocators/gstdmabuf.h>
#include <gst/terrainseg/terrainsegmeta.h>
#include <linux/dma-buf.h>
#include <sys/mman.h>
#include <unistd.h>

#include <cstdarg>

#include "harness.hpp"

namespace {
/// What was asked of the kernel since the test began.
int reads_begun = 0, reads_ended = 0, writes_begun = 0, writes_ended = 0;
} // namespace

extern "C" __attribute__((visibility("default"))) int ioctl(int, unsigned long request, ...) noexcept {
  va_list arguments;
  va_start(arguments, request);
  const void* argument = va_arg(arguments, void*);
  va_end(arguments);
  if (request != DMA_BUF_IOCTL_SYNC)
    return -1;
  const auto flags = static_cast<const dma_buf_sync*>(argument)->flags;
  const bool end = flags & DMA_BUF_SYNC_END;
  if (flags & DMA_BUF_SYNC_READ)
    ++(end ? reads_ended : reads_begun);
  if (flags & DMA_BUF_SYNC_WRITE)
    ++(end ? writes_ended : writes_begun);
  return 0;
}

namespace terrainseg::test {
namespace {

std::string dmabuf_caps(const char* format) {
  const std::string caps = caps_text(format, 160, 120);
  return "video/x-raw(memory:DMABuf)" + caps.substr(caps.find(','));
}

class DmaBuf : public testing::Test {
 protected:
  DmaBuf() : allocator_(gst_dmabuf_allocator_new()) {}
  ~DmaBuf() override { gst_object_unref(allocator_); }

  /// The frame of the road in a file descriptor of its own.
  GstBuffer* frame(const GstVideoInfo& info, int index) {
    const Owned<GstBuffer> road(new_frame(info, index));
    const auto bytes = bytes_of(road.get());
    const int fd = memfd_create("frame", 0);
    EXPECT_EQ(write(fd, bytes.data(), bytes.size()), static_cast<ssize_t>(bytes.size()));
    GstBuffer* buffer = gst_buffer_new();
    gst_buffer_append_memory(buffer, gst_dmabuf_allocator_alloc(allocator_, fd, bytes.size()));
    GST_BUFFER_PTS(buffer) = GST_BUFFER_PTS(road.get());
    reads_begun = reads_ended = writes_begun = writes_ended = 0;
    return buffer;
  }

 private:
  GstAllocator* allocator_;
};

TEST_F(DmaBuf, IsReadInPlaceAndInSync) {
  for (const char* format : {"I420", "NV12", "YUY2", "BGRx"}) {
    Rig rig("terrainseg", dmabuf_caps(format)), plain("terrainseg", caps_text(format, 160, 120));
    for (int i = 0; i < 3; ++i) {
      GstBuffer* in = frame(rig.info(), i);
      GstMemory* memory = gst_buffer_peek_memory(in, 0);
      ASSERT_EQ(rig.push(in), GST_FLOW_OK) << format;
      EXPECT_EQ(reads_begun, 1);
      EXPECT_EQ(reads_ended, 1);
      EXPECT_EQ(writes_begun, 0) << "nothing is drawn";
      const auto out = rig.pull(), expected = plain.step();
      EXPECT_EQ(gst_buffer_peek_memory(out.get(), 0), memory);
      const EstimateReader a(out.get()), b(expected.get());
      ASSERT_TRUE(a && b) << format;
      EXPECT_EQ(bytes_of(a.estimate().mask), bytes_of(b.estimate().mask)) << format;
    }
    EXPECT_TRUE(rig.errors().empty());
  }
}

TEST_F(DmaBuf, IsDrawnOnInSync) {
  for (const char* element : {"terrainseg overlay=true", "terrainseg ! terrainoverlay"}) {
    const Owned<GstHarness> h(gst_harness_new_parse(element));
    gst_harness_set_src_caps(h.get(), gst_caps_from_string(dmabuf_caps("NV12").c_str()));
    const GstVideoInfo info = info_of(caps_text("NV12", 160, 120));
    const Owned<GstBuffer> out(gst_harness_push_and_pull(h.get(), frame(info, 0)));
    ASSERT_TRUE(out);
    EXPECT_GE(writes_begun, 1) << element;
    EXPECT_EQ(writes_ended, writes_begun) << element;
    EXPECT_NE(bytes_of(out.get()), bytes_of(Owned<GstBuffer>(new_frame(info, 0)).get())) << element;
  }
}

TEST_F(DmaBuf, SystemMemoryIsPreferredAndTheSourceMakesNoOther) {
  for (const char* name : {"terrainseg", "terrainoverlay"}) {
    const auto element = make_element(name);
    GstPad* pad = gst_element_get_static_pad(element.get(), "sink");
    const Owned<GstCaps> caps(gst_pad_get_pad_template_caps(pad));
    gst_object_unref(pad);
    ASSERT_EQ(gst_caps_get_size(caps.get()), 2u) << name;
    EXPECT_TRUE(gst_caps_features_is_equal(gst_caps_get_features(caps.get(), 0),
                                           GST_CAPS_FEATURES_MEMORY_SYSTEM_MEMORY));
    EXPECT_TRUE(gst_caps_features_contains(gst_caps_get_features(caps.get(), 1), "memory:DMABuf"));
  }
  const auto source = make_element("terrainscenesrc");
  GstPad* pad = gst_element_get_static_pad(source.get(), "src");
  const Owned<GstCaps> caps(gst_pad_get_pad_template_caps(pad));
  gst_object_unref(pad);
  EXPECT_EQ(gst_caps_get_size(caps.get()), 1u);
}

} // namespace
} // namespace terrainseg::test
