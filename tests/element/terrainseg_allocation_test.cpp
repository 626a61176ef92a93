// SPDX-License-Identifier: LGPL-2.1-or-later
// A running element allocates nothing of its own: operator new is counted, in the plugin too, which binds to
// the one that this program exports. What GStreamer takes for its metas and structures comes from elsewhere.
#include "../support/allocations.hpp"
#include "harness.hpp"

namespace terrainseg::test {
namespace {

long allocations_of_a_frame(const char* settings, const char* format) {
  Rig rig(settings, caps_text(format, 320, 240));
  for (int i = 0; i < 12; ++i)
    rig.step();
  constexpr int frames = 10;
  std::vector<GstBuffer*> buffers;
  for (int i = 0; i < frames; ++i)
    buffers.push_back(new_frame(rig.info(), 12 + i, 1 + i));
  const long before = allocations;
  for (GstBuffer* buffer : buffers) {
    EXPECT_EQ(rig.push(buffer), GST_FLOW_OK);
    rig.pull();
  }
  return allocations - before;
}

TEST(Allocation, IsCountedInThePluginToo) {
  const long before = allocations;
  make_element("terrainseg"); // makes its state with new
  EXPECT_GT(allocations, before);
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
