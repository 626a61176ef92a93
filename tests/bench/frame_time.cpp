// SPDX-License-Identifier: LGPL-2.1-or-later
// Times whole frames on demand, for a program that lets two builds take turns (paired.py, which compiles it
// against either): of the project it uses only what has not changed since the first version. usage:
// frame_time WIDTH HEIGHT MASK-LEVEL THREADS MOTION MEGABYTES [ROUNDS]
//   Reads a line, processes as many I420 frames as it says, writes their times in ns; with ROUNDS it
//   processes that many frames and leaves (for callgrind). MOTION is 1 or 0; MEGABYTES of frames rotate.
#include <cstdio>
#include <cstdlib>

#include "frame_set.hpp"
#include "lanes.hpp"
#include "terrainseg/segmenter.hpp"

namespace {

using namespace terrainseg;
using namespace terrainseg::bench;

constexpr int frames_of_drive = 24; ///< motion follows what moves on

// Versions before the stage have no such setting.
template <typename Any> bool set_motion(Any& settings, bool on) {
  if constexpr (requires { settings.motion; }) {
    settings.motion = on ? decltype(settings.motion)::automatic : decltype(settings.motion)::off;
    return true;
  } else {
    return !on;
  }
}

class FrameTime {
 public:
  FrameTime(const Settings& settings, int width, int height, std::size_t bytes)
      : segmenter_(settings), frames_(PixelFormat::I420, width, height, bytes, frames_of_drive),
        width_(mask_extent(width, settings.mask_level)), height_(mask_extent(height, settings.mask_level)),
        masks_(static_cast<std::size_t>(width_) * static_cast<std::size_t>(height_)),
        count_(settings.n_threads == 1 ? Count::processor_time : Count::wall_time) {}

  std::int64_t next() {
    const Frame frame = frames_.frame(index_++);
    const std::int64_t start = now(count_);
    const Status status = segmenter_.process(frame, {}, {{masks_.next(), width_}, width_, height_});
    const std::int64_t taken = now(count_) - start;
    if (!status.ok()) {
      std::fprintf(stderr, "%s\n", status.message().c_str());
      std::exit(1);
    }
    return taken;
  }

 private:
  Segmenter segmenter_;
  FrameSet frames_;
  int width_, height_;
  Pool masks_;
  Count count_;
  int index_ = 0;
};

} // namespace

int main(int argc, char** argv) {
  if (argc < 7) {
    std::fprintf(stderr, "usage: %s WIDTH HEIGHT MASK-LEVEL THREADS MOTION MEGABYTES [ROUNDS]\n", argv[0]);
    return 2;
  }
  Settings settings = Settings::of(Preset::standard);
  settings.mask_level = std::atoi(argv[3]);
  settings.n_threads = std::atoi(argv[4]);
  if (!set_motion(settings, std::atoi(argv[5]) != 0))
    std::fprintf(stderr, "this version knows no motion: timed without\n");
  FrameTime timer(settings, std::atoi(argv[1]), std::atoi(argv[2]),
                  static_cast<std::size_t>(std::atoll(argv[6])) << 20);
  if (argc > 7) {
    for (int i = 0; i < std::atoi(argv[7]); ++i)
      timer.next();
    return 0;
  }
  std::printf("ready\n");
  std::fflush(stdout);
  for (int count = 0; std::scanf("%d", &count) == 1;) {
    for (int i = 0; i < count; ++i)
      std::printf("%lld ", static_cast<long long>(timer.next()));
    std::printf("\n");
    std::fflush(stdout);
  }
}
