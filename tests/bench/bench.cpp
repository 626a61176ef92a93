// SPDX-License-Identifier: LGPL-2.1-or-later
// The whole filter and its stages against what bounds them, in one run.
// usage: terrainseg-bench [--json FILE] [--quick] [--target NAME] [SECTION...]
//   --target: forces a vector target of Highway (AVX3, AVX2, SSE4, SSSE3, SCALAR, NEON, ...)
//   sections: kernels goal formats stages paper streams     without one: all
#include <algorithm>
#include <cstring>
#include <memory>
#include <set>
#include <thread>

#include "kernels/targets.hpp"

#include <hwy/highway.h>
#include <opencv2/imgproc.hpp>

#include "coarse/pyramid.hpp"
#include "frame_set.hpp"
#include "kernels/blend.hpp"
#include "kernels/cells.hpp"
#include "kernels/mask.hpp"
#include "kernels/reduce.hpp"
#include "kernels/score_table.hpp"
#include "lab/reference/reference_engine.hpp"
#include "lanes.hpp"
#include "painter.hpp"
#include "report.hpp"
#include "scene/scene.hpp"
#include "terrainseg/segmenter.hpp"

namespace {

using namespace terrainseg;
using namespace terrainseg::bench;

struct Size {
  int width, height;
};
constexpr Size hd{1920, 1080}, uhd{3840, 2160};

constexpr const char* format_names[pixel_format_count] = {
    "I420", "YV12", "NV12", "NV21",  "Y42B",      "Y444",      "YUY2",      "UYVY",     "RGB",  "BGR",
    "RGBx", "BGRx", "xRGB", "xBGR",  "RGBA",      "BGRA",      "ARGB",      "ABGR",     "NV16", "NV61",
    "NV24", "YVYU", "VYUY", "GRAY8", "GRAY16_LE", "P010_10LE", "I420_10LE", "I422_10LE"};
const char* name_of(PixelFormat format) {
  return format_names[static_cast<int>(format)];
}

std::int64_t best_of(std::int64_t targets) {
  return targets & -targets;
}

// What the kernels run on.
const char* target_name() {
  const std::int64_t there = (hwy::SupportedTargets() | HWY_STATIC_TARGET) & HWY_TARGETS;
  return hwy::TargetName(best_of(there));
}

bool force_target(const std::string& name) {
  for (std::int64_t left = (hwy::SupportedTargets() | HWY_STATIC_TARGET) & HWY_TARGETS; left;
       left &= left - 1)
    if (name == hwy::TargetName(best_of(left))) {
      hwy::SetSupportedTargetsForTest(best_of(left));
      return true;
    }
  return false;
}

// Optimisers must believe that results are used.
volatile std::uint64_t sink;

// One filter with mask buffers from a pool, as in the element.
class Filter {
 public:
  Filter(const Settings& settings, Size size)
      : segmenter_(settings), width_(mask_extent(size.width, settings.mask_level)),
        height_(mask_extent(size.height, settings.mask_level)),
        pool_(static_cast<std::size_t>(width_) * static_cast<std::size_t>(height_)) {}

  void process(const Frame& frame) {
    const MaskTarget target{{pool_.next(), width_}, width_, height_};
    if (const Status status = segmenter_.process(frame, {}, target); !status.ok()) {
      std::fprintf(stderr, "%s\n", status.message().c_str());
      std::exit(1);
    }
    sink = sink + segmenter_.estimate().confidence;
  }
  const Segmenter& segmenter() const { return segmenter_; }

 private:
  Segmenter segmenter_;
  int width_, height_;
  Pool pool_;
};

// Without motion, which looks at every second frame and needs a drive: see whole_drive.
Settings with(Preset preset, int mask_level, int threads = 1) {
  Settings s = Settings::of(preset);
  s.motion = Motion::off;
  s.mask_level = mask_level;
  s.n_threads = threads;
  return s;
}

class Bench {
 public:
  Bench(Report& report, bool quick) : report_(report), quick_(quick), rotation_(rotation_bytes()) {}

  void kernel_rows();
  void goal();
  void formats();
  void stages();
  void paper();
  void streams();

 private:
  Budget budget(int milliseconds, Count count = Count::processor_time) const {
    return {quick_ ? 7 : 15, quick_ ? 60 : 2000,
            std::chrono::milliseconds(quick_ ? milliseconds / 6 : milliseconds), count};
  }
  FrameSet frames(PixelFormat format, Size size) const {
    return {format, size.width, size.height, rotation_};
  }
  void whole_frame(const std::string& section, const FrameSet& set, PixelFormat format, Size size,
                   int mask_level, double limit);
  void whole_drive(PixelFormat format, Size size, double limit);
  void overlay(PixelFormat format, Size size);
  void against_pyr_down();
  void against_reference();
  void tail();
  void two_threads();

  Report& report_;
  bool quick_;
  std::size_t rotation_;
};

Row row_of(const std::string& section, const std::string& name, PixelFormat format, Size size,
           const Times& work, const std::string& floor, const Times& floor_times, double limit) {
  return {section,
          name,
          name_of(format),
          size.width,
          size.height,
          work.median() / 1e6,
          work.p99() / 1e6,
          floor,
          floor_times.median() / 1e6,
          work.median() / floor_times.median(),
          limit};
}

// Work and copy take different frames of the set, so that neither warms the cache for the other.
void Bench::whole_frame(const std::string& section, const FrameSet& set, PixelFormat format, Size size,
                        int mask_level, double limit) {
  Filter filter(with(Preset::standard, mask_level), size);
  Pool copies(set.frame_bytes());
  const auto times =
      run_lanes({[&](int i) { filter.process(set.frame(2 * i)); },
                 [&](int i) { std::memcpy(copies.next(), set.bytes(2 * i + 1), set.frame_bytes()); }},
                budget(2000));
  report_.add(row_of(section, "whole frame, mask-level " + std::to_string(mask_level), format, size, times[0],
                     "memcpy of the frame", times[1], limit));
}

// The default as it is. Every sample is the mean of a few frames, for not each of them has its share of
// motion.
void Bench::whole_drive(PixelFormat format, Size size, double limit) {
  constexpr int frames_of_drive = 24, frames_of_sample = 8;
  const FrameSet set(format, size.width, size.height, rotation_, frames_of_drive);
  Filter filter(Settings::of(Preset::standard), size);
  Pool copies(set.frame_bytes());
  int next = 0;
  auto times =
      run_lanes({[&](int) {
                   for (int k = 0; k < frames_of_sample; ++k)
                     filter.process(set.frame(next++));
                 },
                 [&](int i) {
                   for (int k = 0; k < frames_of_sample; ++k)
                     std::memcpy(copies.next(), set.bytes(frames_of_sample * i + k), set.frame_bytes());
                 }},
                budget(4000));
  report_.add({"goal", "whole frame with motion, mean of 8 of a drive", name_of(format), size.width,
               size.height, times[0].median() / 1e6 / frames_of_sample,
               times[0].p99() / 1e6 / frames_of_sample, "memcpy of the frame",
               times[1].median() / 1e6 / frames_of_sample, times[0].median() / times[1].median(), limit});
}

void Bench::overlay(PixelFormat format, Size size) {
  FrameSet set = frames(format, size);
  Filter filter(with(Preset::standard, 0), size);
  Pool copies(set.frame_bytes());
  Times paint_times, copy_times;
  const Budget b = budget(2000);
  const auto begin = Clock::now();
  const auto timed = [&b](Times& times, const auto& work) {
    const std::int64_t start = now(b.count);
    work();
    times.add(now(b.count) - start);
  };
  for (int i = 0; i < b.least_rounds || (i < b.most_rounds && Clock::now() - begin < b.time); ++i) {
    const int n = 2 * i;
    filter.process(set.frame(n));
    timed(paint_times, [&] { paint(set.mutable_frame(n), filter.segmenter().estimate(), {}); });
    timed(copy_times, [&] { std::memcpy(copies.next(), set.bytes(n + 1), set.frame_bytes()); });
  }
  report_.add(row_of("goal", "overlay (tint) on top", format, size, paint_times, "memcpy of the frame",
                     copy_times, 1.5));
}

void Bench::against_pyr_down() {
  const FrameSet yuv = frames(PixelFormat::I420, hd), rgb = frames(PixelFormat::RGB, hd);
  Filter filter(with(Preset::standard, 0), hd);
  std::array<cv::Mat, 6> levels;
  const auto times =
      run_lanes({[&](int i) { filter.process(yuv.frame(i)); },
                 [&](int i) {
                   levels[0] = cv::Mat(hd.height, hd.width, CV_8UC3, const_cast<std::uint8_t*>(rgb.bytes(i)));
                   for (int k = 1; k <= 5; ++k)
                     cv::pyrDown(levels[k - 1], levels[k]);
                 }},
                budget(2000));
  report_.add(row_of("goal", "whole pipeline against cv::pyrDown x 5 on RGB", PixelFormat::I420, hd, times[0],
                     "cv::pyrDown x 5, RGB", times[1], 0.3));
}

// The unmodified algorithm on the frames that the filter gets. It learns from the filter's window, and all
// its N = 5 models score, as the paper has it: the rule of the original that leaves light models out is off.
class Unmodified {
 public:
  Unmodified() : engine_(settings()) {
    // All five slots are filled by a drive over several kinds of ground; the frames that are measured know
    // one.
    for (const scene::Kind kind :
         {scene::Kind::corridor, scene::Kind::plain, scene::Kind::trail, scene::Kind::road})
      for (const scene::Light light : {scene::Light::day, scene::Light::dusk}) {
        scene::Renderer renderer({.kind = kind, .light = light}, hd.width, hd.height);
        scene::Picture picture(PixelFormat::BGR, hd.width, hd.height);
        renderer.render(0, picture);
        const Plane plane = picture.frame().planes[0];
        engine_.process(cv::Mat(hd.height, hd.width, CV_8UC3, const_cast<std::uint8_t*>(plane.data),
                                static_cast<std::size_t>(plane.stride)));
      }
  }
  /// I420, rows without padding. It works on B G R.
  void process(const std::uint8_t* frame) {
    cv::cvtColor(cv::Mat(hd.height * 3 / 2, hd.width, CV_8UC1, const_cast<std::uint8_t*>(frame)), bgr_,
                 cv::COLOR_YUV2BGR_I420);
    engine_.process(bgr_);
    const auto& models = engine_.result().models;
    if (std::any_of(models.begin(), models.end(), [](const auto& model) { return model.null(); })) {
      std::fputs("the unmodified algorithm has not filled its models\n", stderr);
      std::exit(1);
    }
  }
  std::int64_t labelling() const {
    const auto& times = engine_.result().stage_times;
    return times[static_cast<std::size_t>(reference::ReferenceStage::scoring)] +
           times[static_cast<std::size_t>(reference::ReferenceStage::clean_up)];
  }

 private:
  static reference::ReferenceSettings settings() {
    reference::ReferenceSettings s;
    s.window.power_of_two_window = false;
    s.mass_share = 0;
    return s;
  }
  reference::ReferenceEngine engine_;
  cv::Mat bgr_;
};

void Bench::against_reference() {
  const FrameSet set = frames(PixelFormat::I420, hd);
  Filter filter(with(Preset::standard, 0), hd);
  Unmodified unmodified;
  Times ours, theirs;
  const auto times = run_lanes({[&](int i) {
                                  filter.process(set.frame(2 * i));
                                  const auto& stage = filter.segmenter().stage_times();
                                  ours.add(stage[static_cast<std::size_t>(Stage::scoring)] +
                                           stage[static_cast<std::size_t>(Stage::boundary)] +
                                           stage[static_cast<std::size_t>(Stage::mask)]);
                                },
                                [&](int i) {
                                  unmodified.process(set.bytes(2 * i + 1));
                                  theirs.add(unmodified.labelling());
                                }},
                               budget(6000));
  report_.add(row_of("goal", "against the unmodified algorithm", PixelFormat::I420, hd, times[0],
                     "the same frames, full resolution and covariances, doubles", times[1], 0.01));
  report_.add(row_of("goal", "labelling alone, against the unmodified one", PixelFormat::I420, hd, ours,
                     "scoring by 5 models, clean-up", theirs, 0));
}

// The ratio is that of two ratios: 99th percentile over median, of the filter and of memcpy.
void Bench::tail() {
  const FrameSet set = frames(PixelFormat::NV12, hd);
  Filter filter(with(Preset::standard, 0), hd);
  Pool copies(set.frame_bytes());
  const int rounds = quick_ ? 1000 : 10000;
  const auto times =
      run_lanes({[&](int i) { filter.process(set.frame(2 * i)); },
                 [&](int i) { std::memcpy(copies.next(), set.bytes(2 * i + 1), set.frame_bytes()); }},
                {rounds, rounds, std::chrono::milliseconds(0), Count::wall_time});
  Row row = row_of("goal", "p99 / median over " + std::to_string(rounds) + " frames, over memcpy's",
                   PixelFormat::NV12, hd, times[0], "the same of memcpy", times[1], 1.3);
  row.ratio = times[0].p99() / times[0].median() / (times[1].p99() / times[1].median());
  report_.add(row);
}

void Bench::two_threads() {
  const FrameSet set = frames(PixelFormat::NV12, uhd);
  Filter one(with(Preset::standard, 0, 1), uhd), two(with(Preset::standard, 0, 2), uhd);
  const auto times = run_lanes(
      {[&](int i) { two.process(set.frame(2 * i)); }, [&](int i) { one.process(set.frame(2 * i + 1)); }},
      budget(3000, Count::wall_time));
  report_.add(row_of("goal", "two threads against one", PixelFormat::NV12, uhd, times[0], "one thread",
                     times[1], 0.6));
}

// Each kernel on rows that lie in the cache, against a copy there of as many bytes as it reads and writes.
// The best tenth counts: what disturbs a loop this short only ever adds.
void Bench::kernel_rows() {
  constexpr int width = 1920, repeats = 100;
  constexpr auto size = static_cast<std::size_t>(width) * 8;
  std::vector<std::uint8_t> a(size), b(size), out(size), copy(size * 8), source(size * 8);
  std::vector<std::uint16_t> partial(size), held(size), coverage(size);
  std::uint32_t state = 1;
  for (auto* row : {&a, &b, &source})
    for (auto& v : *row)
      v = static_cast<std::uint8_t>((state = state * 1664525U + 1013904223U) >> 24);
  for (std::size_t i = 0; i < size; ++i)
    coverage[i] = static_cast<std::uint16_t>(i / 100 % 3 * 51);
  kernels::ComponentScores scores;
  scores.models = 5;
  for (auto& model : scores.entries)
    for (auto& component : model)
      for (auto& e : component)
        e = static_cast<std::uint8_t>((state = state * 1664525U + 1013904223U) >> 25);
  const auto row = [&](const char* name, std::size_t bytes_moved, const std::function<void()>& work) {
    const auto times = run_lanes({[&](int) {
                                    for (int i = 0; i < repeats; ++i)
                                      work();
                                  },
                                  [&](int) {
                                    for (int i = 0; i < repeats; ++i) {
                                      std::memcpy(copy.data(), source.data(), bytes_moved / 2);
                                      asm volatile("" : : "r"(copy.data()) : "memory");
                                    }
                                  }},
                                 {40, 400, std::chrono::milliseconds(quick_ ? 30 : 200)});
    const double ms = times[0].quantile(100) / repeats / 1e6, floor = times[1].quantile(100) / repeats / 1e6;
    report_.add({std::string("kernels, ") + target_name(), name, "", width, 1, ms,
                 times[0].p99() / repeats / 1e6, "memcpy of the bytes moved", floor, ms / floor, 0});
  };
  const kernels::Waiting waiting{partial.data(), held.data()};
  for (int step = 1; step <= 4; ++step) {
    // Two rows in, half a row out, and the two sums read and written.
    const std::size_t in = static_cast<std::size_t>(width) * static_cast<std::size_t>(step);
    const std::string name = "reduce_pair, " + std::to_string(step) + " bytes a pixel";
    row(name.c_str(), 2 * in + in / 2 * 9, [&, step] {
      kernels::reduce_pair(static_cast<kernels::Interleave>(step), a.data(), b.data(), width, 0, waiting,
                           out.data());
    });
  }
  row("reduce_pair_vertically", 2 * width + width * 9,
      [&] { kernels::reduce_pair_vertically(a.data(), b.data(), width, waiting, out.data()); });
  row("split_422", 4 * width, [&] { kernels::split_422(a.data(), width, true, 0, out.data(), b.data()); });
  std::vector<std::uint16_t> boundary(width), safe(width);
  for (int x = 0; x < width; ++x) {
    boundary[static_cast<std::size_t>(x)] = static_cast<std::uint16_t>(x % 7);
    safe[static_cast<std::size_t>(x)] = static_cast<std::uint16_t>(7 + x % 3);
  }
  row("write_mask_rows, 8 rows", 2 * 8 * width, [&] {
    kernels::write_mask_rows(boundary.data(), safe.data(), width, 0, 8, source.data(), width, out.data());
  });
  row("cover_mask", 3 * width, [&] { kernels::cover_mask(a.data(), width, 102, 51, partial.data()); });
  row("pool_coverage", 5 * width,
      [&] { kernels::pool_coverage(coverage.data(), held.data(), width, partial.data()); });
  row("blend_plane", 4 * width, [&] { kernels::blend_plane(a.data(), coverage.data(), width, 60); });
  row("blend_pairs", 6 * width, [&] { kernels::blend_pairs(a.data(), coverage.data(), width, {60, 70}); });
  row("blend_triples", 8 * width, [&] {
    kernels::blend_triples(a.data(), coverage.data(), width, {60, 70, 80});
  });
  row("blend_quads", 10 * width, [&] {
    kernels::blend_quads(a.data(), coverage.data(), width, {60, 70, 80, 0}, 3);
  });
  row("blend_422", 6 * width, [&] {
    kernels::blend_422(a.data(), coverage.data(), width, {60, 70, 80}, true);
  });
  const kernels::PixelRow pixels{{a.data(), b.data(), b.data() + 1}, 1, 2, 1};
  for (const int shift : {4, 3}) {
    scores.bit_shift = shift;
    const std::string name = "classify_row_by_parts, 5 models, bit shift " + std::to_string(shift);
    row(name.c_str(), 3 * width, [&] { kernels::classify_row_by_parts(pixels, scores, out.data(), width); });
  }
  const kernels::ComponentRow cells{a.data(), b.data(), source.data()};
  row("weigh_components", 4 * width, [&] {
    kernels::weigh_components(cells, {76309, 4321, -1234}, 1 << 15, width, out.data());
  });
  row("add_differences", 6 * width, [&] { kernels::add_differences(a.data(), width, partial.data()); });
  row("add_boxes, 4 a cell", 12 * width,
      [&] { kernels::add_boxes(coverage.data(), 4, 0, width, partial.data()); });
  row("color_steps", 8 * width, [&] {
    kernels::color_steps(cells, {b.data(), source.data(), a.data()}, 300, 1023, width, partial.data());
  });
  std::array<std::vector<std::int32_t>, 3> reference;
  for (auto& r : reference)
    r.assign(width, 1600);
  std::vector<std::uint8_t> ignored(width);
  row("follow_row", 29 * width, [&] {
    kernels::follow_row(cells, ignored.data(), {300, 28, 44, 48},
                        {reference[0].data(), reference[1].data(), reference[2].data()}, width,
                        reinterpret_cast<std::int8_t*>(out.data()));
  });
  row("smooth_row", 8 * width, [&] { kernels::smooth_row(reference[0].data(), width, reference[1].data()); });
  kernels::Strip strip;
  std::memcpy(&strip, source.data(), sizeof strip);
  const std::vector<std::uint8_t> last(kernels::strip_columns, kernels::strip_rows - 1);
  row("strongest_edges, 16 strips", 16 * sizeof strip, [&] {
    for (int i = 0; i < 16; ++i)
      kernels::strongest_edges(strip, {{{300, 0, 0}, {0, 290, 5}, {0, -5, 290}}}, kernels::strip_rows,
                               last.data(), out.data());
  });
}

void Bench::goal() {
  for (const PixelFormat format : {PixelFormat::NV12, PixelFormat::I420})
    for (const Size size : {hd, uhd}) {
      const FrameSet set = frames(format, size);
      whole_frame("goal", set, format, size, 0, 2.5);
      whole_frame("goal", set, format, size, 2, size.width == hd.width ? 1.8 : 2.5);
    }
  for (const Size size : {hd, uhd})
    whole_drive(PixelFormat::NV12, size, 2.5);
  for (const PixelFormat format : {PixelFormat::RGB, PixelFormat::RGBx, PixelFormat::YUY2})
    whole_frame("goal", frames(format, hd), format, hd, 0, 3);
  for (const PixelFormat format :
       {PixelFormat::NV12, PixelFormat::I420, PixelFormat::RGBx, PixelFormat::YUY2})
    overlay(format, hd);
  against_pyr_down();
  against_reference();
  two_threads();
  tail();
}

void Bench::formats() {
  for (const Size size :
       {Size{854, 480}, {1280, 720}, {1920, 1080}, {2560, 1440}, {3840, 2160}, {7680, 4320}})
    whole_frame("resolutions", frames(PixelFormat::NV12, size), PixelFormat::NV12, size, 0, 0);
  for (int f = 0; f < pixel_format_count; ++f) {
    const auto format = static_cast<PixelFormat>(f);
    whole_frame("formats", frames(format, hd), format, hd, 0, format == PixelFormat::P010_10LE ? 3.0 : 0);
  }
}

void Bench::stages() {
  for (const Preset preset : {Preset::standard, Preset::paper})
    for (const Size size : {hd, uhd}) {
      const FrameSet set = frames(PixelFormat::NV12, size);
      Filter filter(with(preset, 0), size);
      Pool copies(set.frame_bytes());
      std::array<Times, stage_count> stage;
      const auto times =
          run_lanes({[&](int i) {
                       filter.process(set.frame(2 * i));
                       for (int s = 0; s < stage_count; ++s)
                         stage[s].add(filter.segmenter().stage_times()[s]);
                     },
                     [&](int i) { std::memcpy(copies.next(), set.bytes(2 * i + 1), set.frame_bytes()); }},
                    budget(2000));
      const std::string section =
          preset == Preset::standard ? "stages, default preset" : "stages, paper preset";
      for (int s = 0; s < stage_count; ++s)
        report_.add(row_of(section, terrainseg::name_of(static_cast<Stage>(s)), PixelFormat::NV12, size,
                           stage[s], "memcpy of the frame", times[1], 0));
      report_.add(row_of(section, "whole frame", PixelFormat::NV12, size, times[0], "memcpy of the frame",
                         times[1], 0));
    }
}

// The paper's figures 12 and 13: time against pyramid level and against bit shift; figure 14 is both.
void Bench::paper() {
  constexpr Size size{640, 480};
  const FrameSet set = frames(PixelFormat::I420, size);
  Pool copies(set.frame_bytes());
  const auto measure = [&](Preset preset, int levels, int bit_shift, const char* figure) {
    Settings s = with(preset, 0);
    s.pyramid_levels = levels;
    s.bit_shift = bit_shift;
    Filter filter(s, size);
    const auto times =
        run_lanes({[&](int i) { filter.process(set.frame(2 * i)); },
                   [&](int i) { std::memcpy(copies.next(), set.bytes(2 * i + 1), set.frame_bytes()); }},
                  budget(500));
    report_.add(
        row_of(std::string(figure) + (preset == Preset::paper ? ", paper preset" : ", default preset"),
               "level " + std::to_string(levels) + ", bit shift " + std::to_string(bit_shift),
               PixelFormat::I420, size, times[0], "memcpy of the frame", times[1], 0));
  };
  for (const Preset preset : {Preset::paper, Preset::standard}) {
    for (int level = 0; level <= max_pyramid_levels; ++level)
      measure(preset, level, 3, "figure 12");
    for (int shift = 0; shift <= 7; ++shift)
      measure(preset, 5, shift, "figure 13");
    for (int level = 0; level <= max_pyramid_levels; level += 2)
      for (int shift = 0; shift <= 6; shift += 2)
        measure(preset, level, shift, "figure 14");
  }
}

// Filters of their own in threads of their own; the figure is the time a frame costs over all of them.
void Bench::streams() {
  const FrameSet set = frames(PixelFormat::NV12, hd);
  double alone = 0;
  for (const int count : {1, 2, 4, 8}) {
    const int frames_each = (quick_ ? 60 : 400) / count + 10;
    std::vector<std::unique_ptr<Filter>> filters;
    for (int i = 0; i < count; ++i)
      filters.push_back(std::make_unique<Filter>(with(Preset::standard, 0), hd));
    const auto run = [&](int from, int rounds) {
      std::vector<std::thread> threads;
      for (int t = 0; t < count; ++t)
        threads.emplace_back([&, t] {
          for (int i = 0; i < rounds; ++i)
            filters[static_cast<std::size_t>(t)]->process(set.frame((from + i) * count + t));
        });
      for (std::thread& t : threads)
        t.join();
    };
    run(0, 5);
    const auto start = Clock::now();
    run(5, frames_each);
    const double ms =
        std::chrono::duration<double, std::milli>(Clock::now() - start).count() / (frames_each * count);
    if (count == 1)
      alone = ms;
    report_.add({"streams at once",
                 std::to_string(count) + " streams, per frame of any (" +
                     std::to_string(static_cast<int>(1000 / ms)) + " frames/s in all)",
                 "NV12", hd.width, hd.height, ms, 0, "one stream", alone, ms / alone, 0});
  }
}

} // namespace

int main(int argc, char** argv) {
  std::string json;
  bool quick = false;
  std::set<std::string> wanted;
  const std::set<std::string> known{"kernels", "goal", "formats", "stages", "paper", "streams"};
  for (int i = 1; i < argc; ++i) {
    const std::string word = argv[i];
    if (word == "--json" && i + 1 < argc) {
      json = argv[++i];
    } else if (word == "--quick") {
      quick = true;
    } else if (word == "--target" && i + 1 < argc) {
      if (!force_target(argv[++i])) {
        std::fprintf(stderr, "target %s is not compiled or not of this machine\n", argv[i]);
        return 2;
      }
    } else if (known.count(word)) {
      wanted.insert(word);
    } else {
      std::fprintf(stderr,
                   "usage: %s [--json FILE] [--quick] [--target NAME] [kernels] [goal] [formats] [stages] "
                   "[paper] [streams]\n",
                   argv[0]);
      return 2;
    }
  }
  cv::setNumThreads(1);
  Report report(json);
  Bench bench(report, quick);
  std::printf("last-level cache %zu MB, frames rotate through %zu MB, kernels on %s\n",
              last_level_cache_bytes() >> 20, rotation_bytes() >> 20, target_name());
  const auto section = [&](const char* name, void (Bench::*run)()) {
    if (wanted.empty() || wanted.count(name))
      (bench.*run)();
  };
  section("kernels", &Bench::kernel_rows);
  section("goal", &Bench::goal);
  section("formats", &Bench::formats);
  section("stages", &Bench::stages);
  section("paper", &Bench::paper);
  section("streams", &Bench::streams);
}
