// SPDX-License-Identifier: LGPL-2.1-or-later
// terrainextract and terraincombine as a whole, per 1080p frame with a mask value for every pixel. The limit
// is 0.3 ms.
#include <benchmark/benchmark.h>

#include <gst/check/gstharness.h>
#include <gst/gst.h>

#include "../unit/exchange_estimates.hpp"
#include "exchange/vmti_klv.hpp"
#include "support/estimate_meta.hpp"

namespace terrainseg {
namespace {

constexpr const char* video_caps = "video/x-raw,format=I420,width=1920,height=1080,framerate=30/1";
constexpr GstClockTime frame_time = GST_SECOND / 30;

/// A frame of one byte: nobody here reads pixels.
GstBuffer* frame(std::int64_t index) {
  GstBuffer* buffer = gst_buffer_new_allocate(nullptr, 1, nullptr);
  GST_BUFFER_PTS(buffer) = static_cast<GstClockTime>(index) * frame_time;
  GST_BUFFER_DURATION(buffer) = frame_time;
  return buffer;
}

test::OwnedEstimate full_hd() {
  std::mt19937 random(1);
  return test::ground(1920, 1080, 0, random);
}

void Extract(benchmark::State& state, const char* caps) {
  const test::OwnedEstimate o = full_hd();
  GstHarness* h = gst_harness_new("terrainextract");
  gst_harness_set_sink_caps_str(h, caps);
  gst_harness_set_src_caps_str(h, video_caps);
  GstBuffer* mask = new_mask_buffer(1920, 1080);
  gst_buffer_fill(mask, 0, o.pixels.data(), o.pixels.size());
  GstBuffer* boundary = new_boundary_buffer(o.estimate.boundary);
  GstBuffer* in = frame(0);
  attach(in, o.estimate, mask, boundary);
  std::size_t size = 0;
  for (auto _ : state) {
    gst_harness_push(h, gst_buffer_ref(in));
    GstBuffer* unit = gst_harness_try_pull(h);
    size = gst_buffer_get_size(unit);
    gst_buffer_unref(unit);
  }
  state.counters["bytes"] = static_cast<double>(size);
  gst_buffer_unref(in);
  gst_buffer_unref(mask);
  gst_buffer_unref(boundary);
  gst_harness_teardown(h);
}
BENCHMARK_CAPTURE(Extract, gray, "video/x-raw,format=GRAY8")->Unit(benchmark::kMicrosecond);
BENCHMARK_CAPTURE(Extract, quarter, "video/x-raw,format=GRAY8,width=480,height=270")
    ->Unit(benchmark::kMicrosecond);
BENCHMARK_CAPTURE(Extract, lines, "application/x-ndjson")->Unit(benchmark::kMicrosecond);
BENCHMARK_CAPTURE(Extract, klv, "meta/x-klv,parsed=true")->Unit(benchmark::kMicrosecond);

void Combine(benchmark::State& state) {
  const test::OwnedEstimate o = full_hd();
  KlvEncoder encoder;
  const auto bytes = encoder.encode(o.estimate, 0);
  GstElement* element = gst_element_factory_make("terraincombine", nullptr);
  GstHarness* video = gst_harness_new_with_element(element, "sink", "src");
  GstHarness* meta = gst_harness_new_with_element(element, "meta", nullptr);
  gst_harness_set_src_caps_str(meta, "meta/x-klv,parsed=true");
  gst_harness_set_src_caps_str(video, video_caps);
  std::int64_t i = 0;
  for (auto _ : state) {
    GstBuffer* unit = gst_buffer_new_memdup(bytes.data(), bytes.size());
    GST_BUFFER_PTS(unit) = static_cast<GstClockTime>(i) * frame_time;
    gst_harness_push(meta, unit);
    gst_harness_push(video, frame(i++));
    GstBuffer* out = gst_harness_pull(video);
    gst_buffer_unref(out);
  }
  gst_element_set_state(element, GST_STATE_NULL); // its task asks both harnesses
  gst_harness_teardown(meta);
  gst_harness_teardown(video);
  gst_object_unref(element);
}
BENCHMARK(Combine)->Unit(benchmark::kMicrosecond)->MeasureProcessCPUTime();

} // namespace
} // namespace terrainseg

int main(int argc, char** argv) {
  gst_init(nullptr, nullptr);
  GstPlugin* plugin = gst_plugin_load_by_name("terrainseg");
  if (!plugin) {
    g_printerr("the plugin terrainseg is not in GST_PLUGIN_PATH\n");
    return 1;
  }
  gst_object_unref(plugin);
  benchmark::Initialize(&argc, argv);
  benchmark::RunSpecifiedBenchmarks();
  return 0;
}
