// SPDX-License-Identifier: LGPL-2.1-or-later
// One segmenter, small pictures, as many frames as nobody waits for: what is counted, weighed and averaged
// over years of driving. Fails when a mask holds another value than the three, a frame is not counted, memory
// is taken after the first laps, the filter is less right in the end than it was, or what is left after
// reset() is not what a new filter does.
//
// endurance FRAMES [default | paper [WIDTHxHEIGHT]]    a line every some seconds; exit status 1 when it fails
//
// 1,000,000,000 frames at 30 a second are 386 days of driving.
#include <malloc.h>

#include <charconv>
#include <chrono>
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <string_view>
#include <vector>

#include "scene/scene.hpp"
#include "terrainseg/segmenter.hpp"

namespace {

using namespace terrainseg;

constexpr std::int64_t frame_time = 33'333'333;
constexpr int shots = 64; ///< pictures of a place
constexpr int passes = 4; ///< forth, back, forth, back

/// What a lap of all places showed.
struct Lap {
  std::uint64_t hash = 14695981039346656037u; ///< FNV-1a over masks and horizons
  std::uint64_t right = 0, labelled = 0;
  bool sound = true;

  double percent() const { return 100 * static_cast<double>(right) / static_cast<double>(labelled); }
};

class Road {
 public:
  Road(int width, int height) {
    using scene::Kind, scene::Light, scene::Motion;
    for (const scene::Settings& place :
         {scene::Settings{Kind::road, Light::day, Motion::straight, 1},
          scene::Settings{Kind::trail, Light::dusk, Motion::bumpy, 2},
          scene::Settings{Kind::corridor, Light::day, Motion::turn, 3},
          scene::Settings{Kind::plain, Light::drift, Motion::straight, 4},
          scene::Settings{Kind::road, Light::sun, Motion::still, 5},
          scene::Settings{Kind::plain, Light::day, Motion::straight, 6, 40, true}}) {
      scene::Renderer renderer(place, width, height);
      for (int i = 0; i < shots; ++i) {
        pictures_.emplace_back(PixelFormat::I420, width, height);
        renderer.render(static_cast<std::uint64_t>(i), pictures_.back());
      }
    }
  }

  static constexpr std::uint64_t lap_frames(std::size_t places) { return places * shots * passes; }
  std::uint64_t lap_frames() const { return lap_frames(pictures_.size() / shots); }

  /// Drives through all places once; looks at every mask, or at none.
  Lap drive(Segmenter& segmenter, std::int64_t& time, bool look) const {
    Lap lap;
    for (std::size_t place = 0; place < pictures_.size(); place += shots)
      for (int i = 0; i < shots * passes; ++i) {
        const int at = i % (2 * shots);
        const scene::Picture& picture =
            pictures_[place + static_cast<std::size_t>(at < shots ? at : 2 * shots - 1 - at)];
        Frame frame = picture.frame();
        frame.pts = time;
        time += frame_time;
        if (!segmenter.process(frame).ok())
          lap.sound = false;
        if (look)
          see(segmenter.estimate(), picture, lap);
      }
    return lap;
  }

 private:
  static void add(Lap& lap, std::uint64_t value) { lap.hash = (lap.hash ^ value) * 1099511628211u; }

  static void see(const Estimate& e, const scene::Picture& picture, Lap& lap) {
    add(lap, static_cast<std::uint64_t>(e.horizon_row + 1));
    if (flaw_of(e))
      lap.sound = false;
    const GrayView labels = picture.labels();
    const int level = labels.width > e.mask.width ? (labels.width + e.mask.width - 1) / e.mask.width : 1;
    for (int y = 0; y < e.mask.height; ++y)
      for (int x = 0; x < e.mask.width; ++x) {
        const std::uint8_t value = e.mask.plane.row(y)[x];
        add(lap, value);
        if (value != mask_not_traversable && value != mask_doubtful && value != mask_traversable)
          lap.sound = false;
        if (x * level >= labels.width || y * level >= labels.height)
          continue;
        const std::uint8_t truth = labels.plane.row(y * level)[x * level];
        if (truth == scene::not_labelled)
          continue;
        const bool ground = truth == scene::driven_terrain || truth == scene::other_traversable;
        ++lap.labelled;
        lap.right += ground == (value == mask_traversable);
      }
  }

  std::vector<scene::Picture> pictures_;
};

std::size_t memory_in_use() {
  const struct mallinfo2 heap = mallinfo2();
  return heap.uordblks + heap.hblkhd;
}

int fail(const char* what) {
  std::printf("FAIL %s\n", what);
  return 1;
}

int run(std::uint64_t wanted, Preset preset, int width, int height) {
  using Clock = std::chrono::steady_clock;
  Settings settings = Settings::of(preset);
  settings.n_threads = 1;
  const Road road(width, height);
  std::int64_t time = 0;
  const Lap fresh = [&] {
    Segmenter first(settings);
    std::int64_t begin = 0;
    return road.drive(first, begin, true);
  }();

  Segmenter segmenter(settings);
  const Lap begin = road.drive(segmenter, time, true);
  if (begin.hash != fresh.hash)
    return fail("two new filters do not say the same");
  // The first laps know nothing; the second and third are what the last ones are compared with.
  double early = 100;
  for (int i = 0; i < 2; ++i)
    early = std::min(early, road.drive(segmenter, time, true).percent());
  std::uint64_t frames = 3 * road.lap_frames();
  std::printf("%s %dx%d: laps of %llu frames, first lap %.2f %% right, then %.2f\n",
              preset == Preset::paper ? "paper" : "default", width, height,
              static_cast<unsigned long long>(road.lap_frames()), begin.percent(), early);
  const std::size_t memory = memory_in_use(); // the output's buffer is there
  const auto start = Clock::now();
  auto told = start;
  double late = early;
  while (frames < wanted) {
    const bool look = Clock::now() - told > std::chrono::seconds(20);
    const Lap lap = road.drive(segmenter, time, look);
    frames += road.lap_frames();
    if (!lap.sound)
      return fail("a frame was refused, or an estimate holds what none can");
    if (segmenter.counters().frames != frames)
      return fail("frames are not all counted");
    if (memory_in_use() != memory)
      return fail("memory in use has changed");
    if (!look)
      continue;
    late = lap.percent();
    told = Clock::now();
    const double seconds = std::chrono::duration<double>(told - start).count();
    std::printf("%llu frames, %.2f us each, %.2f %% right\n", static_cast<unsigned long long>(frames),
                1e6 * seconds / static_cast<double>(frames), late);
    std::fflush(stdout);
  }
  late = road.drive(segmenter, time, true).percent();
  if (late < early - 1)
    return fail("in the end it is less right than in the beginning");
  segmenter.reset();
  std::int64_t again = 0;
  if (road.drive(segmenter, again, true).hash != fresh.hash)
    return fail("after reset() it is not a new filter");
  std::printf("ok %llu frames, %.2f %% right in the last lap, memory in use %zu bytes as after the third\n",
              static_cast<unsigned long long>(frames), late, memory);
  return 0;
}

} // namespace

int main(int argc, char** argv) {
  unsigned long long frames = 0;
  int width = 32, height = 24;
  char end = 0;
  bool good = argc >= 2 && argc <= 4;
  if (good) {
    const std::string_view count = argv[1];
    const auto [rest, error] = std::from_chars(count.begin(), count.end(), frames);
    good = error == std::errc() && rest == count.end();
  }
  const std::string_view preset = argc > 2 ? argv[2] : "default";
  good = good && (preset == "default" || preset == "paper") &&
         (argc < 4 || (std::sscanf(argv[3], "%dx%d%c", &width, &height, &end) == 2 && width >= 8 &&
                       height >= 8 && width <= 1920 && height <= 1080));
  if (!good) {
    std::fputs("usage: endurance FRAMES [default | paper [WIDTHxHEIGHT]]\n", stderr);
    return 2;
  }
  return run(frames, preset == "paper" ? Preset::paper : Preset::standard, width, height);
}
