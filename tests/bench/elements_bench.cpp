// SPDX-License-Identifier: LGPL-2.1-or-later
// What the element costs beyond the library, and what the filter costs beside GStreamer's OpenCV
// segmentation. usage: terrainseg-bench-elements [--json FILE] [--quick]     (GST_PLUGIN_PATH names the
// folder of the plugin)
#include <gst/gst.h>
#include <gst/video/video.h>

#include <algorithm>
#include <cstring>
#include <functional>
#include <memory>
#include <utility>
#include <vector>

#include "frame_set.hpp"
#include "lanes.hpp"
#include "report.hpp"
#include "terrainseg/segmenter.hpp"

namespace {

using namespace terrainseg;
using namespace terrainseg::bench;

GstFlowReturn swallow(GstPad*, GstObject*, GstBuffer* buffer) {
  gst_buffer_unref(buffer);
  return GST_FLOW_OK;
}

// An element between two bare pads: what a push takes is what the element takes.
class Line {
 public:
  Line(const char* factory, GstVideoFormat format, int width, int height)
      : element_(gst_element_factory_make(factory, nullptr)) {
    if (!element_)
      return;
    gst_object_ref_sink(element_);
    src_ = gst_pad_new("src", GST_PAD_SRC);
    sink_ = gst_pad_new("sink", GST_PAD_SINK);
    gst_pad_set_chain_function(sink_, swallow);
    GstPad* in = gst_element_get_static_pad(element_, "sink");
    GstPad* out = gst_element_get_static_pad(element_, "src");
    gst_pad_link(src_, in);
    gst_pad_link(out, sink_);
    gst_object_unref(in);
    gst_object_unref(out);
    gst_pad_set_active(src_, TRUE);
    gst_pad_set_active(sink_, TRUE);
    gst_element_set_state(element_, GST_STATE_PLAYING);
    gst_pad_push_event(src_, gst_event_new_stream_start("bench"));
    GstVideoInfo info;
    gst_video_info_set_format(&info, format, static_cast<guint>(width), static_cast<guint>(height));
    info.fps_n = 30;
    info.fps_d = 1;
    GstCaps* caps = gst_video_info_to_caps(&info);
    gst_pad_push_event(src_, gst_event_new_caps(caps));
    gst_caps_unref(caps);
    GstSegment segment;
    gst_segment_init(&segment, GST_FORMAT_TIME);
    gst_pad_push_event(src_, gst_event_new_segment(&segment));
  }
  ~Line() {
    if (!element_)
      return;
    gst_element_set_state(element_, GST_STATE_NULL);
    gst_pad_set_active(src_, FALSE);
    gst_pad_set_active(sink_, FALSE);
    gst_object_unref(src_);
    gst_object_unref(sink_);
    gst_object_unref(element_);
  }
  Line(const Line&) = delete;
  Line& operator=(const Line&) = delete;

  bool there() const { return element_ != nullptr; }

  void push(const FrameSet& set, int i) {
    GstBuffer* buffer =
        gst_buffer_new_wrapped_full(static_cast<GstMemoryFlags>(0), const_cast<std::uint8_t*>(set.bytes(i)),
                                    set.frame_bytes(), 0, set.frame_bytes(), nullptr, nullptr);
    GST_BUFFER_PTS(buffer) = static_cast<GstClockTime>(set.frame(i).pts);
    GST_BUFFER_DURATION(buffer) = GST_SECOND / 30;
    if (gst_pad_push(src_, buffer) != GST_FLOW_OK) {
      std::fprintf(stderr, "%s refused a frame\n", GST_OBJECT_NAME(element_));
      std::exit(1);
    }
  }

 private:
  GstElement* element_ = nullptr;
  GstPad* src_ = nullptr;
  GstPad* sink_ = nullptr;
};

void need(const Line& line, const char* factory, const char* where) {
  if (line.there())
    return;
  std::fprintf(stderr, "element %s is missing: %s\n", factory, where);
  std::exit(1);
}

// Small frames in the cache, where 25 us would show. The overhead does not depend on the height, but a row a
// column of the boundary is copied. A sample is several frames: motion looks at every second one, and the
// median of single frames would fall now on the one kind, now on the other. Where an instance's tables happen
// to lie moves its time by as much as what is asked for here: of several instances the fastest counts.
void overhead(Report& report, const Budget& budget, int width, int height) {
  constexpr int frames_of_sample = 8, instances = 4;
  const FrameSet set(PixelFormat::I420, width, height, std::size_t{1} << 20);
  std::vector<std::unique_ptr<Line>> lines;
  std::vector<std::unique_ptr<Segmenter>> segmenters;
  Pool masks(static_cast<std::size_t>(width) * static_cast<std::size_t>(height));
  std::vector<std::function<void(int)>> lanes;
  const auto add = [&](const auto& one) {
    lanes.emplace_back([one](int round) {
      for (int k = 0; k < frames_of_sample; ++k)
        one(frames_of_sample * round + k);
    });
  };
  for (const char* const factory : {"terrainseg", "identity"})
    for (int i = 0; i < instances; ++i) {
      Line* const line =
          lines.emplace_back(std::make_unique<Line>(factory, GST_VIDEO_FORMAT_I420, width, height)).get();
      need(*line, factory, "set GST_PLUGIN_PATH to the plugin's folder");
      add([line, &set](int frame) { line->push(set, frame); });
    }
  for (int i = 0; i < instances; ++i) {
    Segmenter* const segmenter =
        segmenters.emplace_back(std::make_unique<Segmenter>(Settings::of(Preset::standard))).get();
    add([=, &set, &masks](int frame) {
      (void)segmenter->process(set.frame(frame), {}, {{masks.next(), width}, width, height});
    });
  }
  const auto times = run_lanes(lanes, budget);
  const auto fastest = [&](int kind) { // nanoseconds a frame
    double least = times[static_cast<std::size_t>(kind * instances)].median();
    for (int i = 1; i < instances; ++i)
      least = std::min(least, times[static_cast<std::size_t>(kind * instances + i)].median());
    return least / frames_of_sample;
  };
  const double element = fastest(0) - fastest(1), core = fastest(2);
  report.add({"element", "overhead of the element in units of 25 us", "I420", width, height,
              (element - core) / 1e6, 0, "25 us", 0.025, (element - core) / 25000, 1});
  report.add({"element", "element less identity, against the library alone", "I420", width, height,
              element / 1e6, 0, "Segmenter::process", core / 1e6, element / core, 0});
}

void against_segmentation(Report& report, const Budget& budget) {
  constexpr int width = 1920, height = 1080;
  const FrameSet yuv(PixelFormat::I420, width, height, rotation_bytes());
  const FrameSet rgba(PixelFormat::RGBA, width, height, rotation_bytes());
  Line ours("terrainseg", GST_VIDEO_FORMAT_I420, width, height),
      ours_bare("identity", GST_VIDEO_FORMAT_I420, width, height);
  Line theirs("segmentation", GST_VIDEO_FORMAT_RGBA, width, height),
      theirs_bare("identity", GST_VIDEO_FORMAT_RGBA, width, height);
  if (!theirs.there()) {
    std::puts("element segmentation is missing (package gstreamer1.0-opencv): not compared");
    return;
  }
  const auto times =
      run_lanes({[&](int i) { ours.push(yuv, i); }, [&](int i) { ours_bare.push(yuv, i); },
                 [&](int i) { theirs.push(rgba, i); }, [&](int i) { theirs_bare.push(rgba, i); }},
                budget);
  const double a = times[0].median() - times[1].median(), b = times[2].median() - times[3].median();
  report.add({"element", "terrainseg against segmentation (MOG2), each less identity", "I420", width, height,
              a / 1e6, times[0].p99() / 1e6, "segmentation less identity, RGBA", b / 1e6, a / b, 1.0 / 40});
}

} // namespace

int main(int argc, char** argv) {
  gst_init(&argc, &argv);
  std::string json;
  bool quick = false;
  for (int i = 1; i < argc; ++i) {
    const std::string word = argv[i];
    if (word == "--json" && i + 1 < argc) {
      json = argv[++i];
    } else if (word == "--quick") {
      quick = true;
    } else {
      std::fprintf(stderr, "usage: %s [--json FILE] [--quick]\n", argv[0]);
      return 2;
    }
  }
  Report report(json);
  for (const auto& [width, height] : {std::pair{320, 240}, std::pair{1920, 160}})
    overhead(report, {30, quick ? 60 : 300, std::chrono::milliseconds(quick ? 3000 : 15000)}, width, height);
  against_segmentation(report,
                       {quick ? 10 : 40, quick ? 20 : 200, std::chrono::milliseconds(quick ? 1000 : 8000)});
}
