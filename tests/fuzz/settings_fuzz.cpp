// SPDX-License-Identifier: LGPL-2.1-or-later
// Settings files of any bytes: terrainseg refuses them with an error and starts with the next, or it runs
// with them. A file that it takes shapes three frames.
#include <glib/gstdio.h>

#include <cstdlib>
#include <string>

#include "element_input.hpp"
#include "elements/terrainseg/settings_book.hpp"
#include "support/elements.hpp"
#include "support/estimate_meta.hpp"

namespace {

using namespace terrainseg;
using namespace terrainseg::fuzz;

constexpr int width = 64, height = 48;

/// One file for all inputs, which goes with the process.
const std::string& path() {
  static const std::string name = [] {
    gchar* made = nullptr;
    const int handle = g_file_open_tmp("terrainseg-fuzz-XXXXXX.ini", &made, nullptr);
    require(handle >= 0 && g_close(handle, nullptr));
    std::string kept = made;
    g_free(made);
    return kept;
  }();
  static const bool gone = std::atexit([] { g_unlink(path().c_str()); }) == 0;
  require(gone);
  return name;
}

/// Sky over ground.
GstBuffer* frame(int number) {
  constexpr gsize size = width * height * 3;
  GstBuffer* buffer = gst_buffer_new_allocate(nullptr, size, nullptr);
  GstMapInfo map;
  require(gst_buffer_map(buffer, &map, GST_MAP_WRITE));
  for (gsize i = 0; i < size; ++i)
    map.data[i] = static_cast<guint8>((i < size / 2 ? 170 : 80) + (i * 7 + static_cast<gsize>(number)) % 11);
  gst_buffer_unmap(buffer, &map);
  GST_BUFFER_PTS(buffer) = static_cast<GstClockTime>(number) * 33 * GST_MSECOND;
  return buffer;
}

void drive(GstElement* element) {
  GstHarness* h = gst_harness_new_with_element(element, "sink", "src");
  gst_harness_set_src_caps_str(h, "video/x-raw,format=RGB,width=64,height=48,framerate=30/1");
  for (int i = 0; i < 3; ++i) {
    gst_harness_push(h, frame(i));
    while (GstBuffer* out = gst_harness_try_pull(h)) {
      require(EstimateReader(out).error() == nullptr);
      gst_buffer_unref(out);
    }
  }
  gst_harness_teardown(h);
}

} // namespace

extern "C" int LLVMFuzzerInitialize(int*, char***) {
  start_gstreamer();
  require(GST_ELEMENT_REGISTER(terrainseg, nullptr));
  return 0;
}

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  require(g_file_set_contents(path().c_str(), reinterpret_cast<const gchar*>(data), static_cast<gssize>(size),
                              nullptr));
  const SettingsFile file = read_settings_file(path());
  require(file.error.empty() || file.entries.size() <= size);
  GstElement* element = gst_element_factory_make("terrainseg", nullptr);
  // Threads take the time of an input, and what is set by hand stands above the file.
  g_object_set(element, "settings-location", path().c_str(), "n-threads", 1, nullptr);
  gst_object_ref_sink(element);
  const bool starts = gst_element_set_state(element, GST_STATE_PAUSED) != GST_STATE_CHANGE_FAILURE;
  require(!starts || file.error.empty());
  gst_element_set_state(element, GST_STATE_NULL);
  if (starts)
    drive(element);
  gint threads = 0;
  g_object_get(element, "n-threads", &threads, nullptr);
  require(threads == 1);
  gst_object_unref(element);
  return 0;
}
