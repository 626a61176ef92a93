// SPDX-License-Identifier: LGPL-2.1-or-later
// Where the time of a frame goes. usage:
//   where render FILE WIDTH HEIGHT COUNT [KIND]
//     Writes a rendered drive, I420: a file, so that a profiler need not see it rendered. KIND is a number of
//     scene::Kind (0 = road).
//   where run FILE WIDTH HEIGHT MASK-LEVEL THREADS MOTION FRAMES [MEGABYTES]
//     Processes FRAMES frames of it, forward and back, repeated over MEGABYTES of memory; writes a digest of
//     everything that it found, the mean microseconds of each stage and of the frame in the fastest tenth of
//     the frames, and of the frame in the fastest nine tenths ("most").
#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <numeric>
#include <string>
#include <vector>

#include "scene/scene.hpp"
#include "terrainseg/segmenter.hpp"

namespace {

using namespace terrainseg;

constexpr int mask_buffers = 4; ///< as in the pool of a pipeline

std::size_t luma_bytes(int width, int height) {
  return static_cast<std::size_t>(width) * static_cast<std::size_t>(height);
}

// Sizes are even.
std::size_t frame_bytes(int width, int height) {
  return luma_bytes(width, height) * 3 / 2;
}

template <typename FrameType, typename Byte> FrameType frame_at(Byte* pixels, int width, int height) {
  FrameType frame{};
  frame.format = PixelFormat::I420;
  frame.width = width;
  frame.height = height;
  const std::size_t luma = luma_bytes(width, height);
  frame.planes[0] = {pixels, width};
  frame.planes[1] = {pixels + luma, width / 2};
  frame.planes[2] = {pixels + luma + luma / 4, width / 2};
  return frame;
}

int render(const char* name, int width, int height, int count, scene::Kind kind) {
  std::FILE* file = std::fopen(name, "wb");
  if (!file)
    return 1;
  std::vector<std::uint8_t> pixels(frame_bytes(width, height));
  scene::Renderer renderer({.kind = kind}, width, height);
  bool written = true;
  for (int i = 0; i < count; ++i) {
    renderer.render(static_cast<std::uint64_t>(i), frame_at<MutableFrame>(pixels.data(), width, height));
    written &= std::fwrite(pixels.data(), 1, pixels.size(), file) == pixels.size();
  }
  return std::fclose(file) == 0 && written ? 0 : 1;
}

// FNV-1a.
class Digest {
 public:
  void add(const void* data, std::size_t bytes) {
    for (std::size_t i = 0; i < bytes; ++i)
      hash_ = (hash_ ^ static_cast<const std::uint8_t*>(data)[i]) * 0x100000001b3;
  }
  template <typename Number> void add(Number number) { add(&number, sizeof number); }
  std::uint64_t value() const { return hash_; }

 private:
  std::uint64_t hash_ = 0xcbf29ce484222325;
};

void add_view(const GrayView& view, Digest& digest) {
  for (int y = 0; y < view.height; ++y)
    digest.add(view.plane.row(y), static_cast<std::size_t>(view.width));
}

void add(const Estimate& e, Digest& digest) {
  add_view(e.mask, digest);
  add_view(e.confidence_map, digest);
  digest.add(e.boundary.data(), e.boundary.size_bytes());
  digest.add(e.horizon_row);
  digest.add(e.vanishing_row);
  digest.add(e.speed_over_height);
  digest.add(e.confidence);
  digest.add(e.flags);
}

std::vector<std::uint8_t> contents(const char* name) {
  std::vector<std::uint8_t> bytes;
  if (std::FILE* file = std::fopen(name, "rb")) {
    std::fseek(file, 0, SEEK_END);
    bytes.resize(static_cast<std::size_t>(std::ftell(file)));
    std::rewind(file);
    bytes.resize(std::fread(bytes.data(), 1, bytes.size(), file));
    std::fclose(file);
  }
  return bytes;
}

int run(const std::vector<std::uint8_t>& drive, int width, int height, const Settings& settings, int frames,
        std::size_t megabytes) {
  const std::size_t bytes = frame_bytes(width, height);
  const int originals = static_cast<int>(drive.size() / bytes), turn = 2 * (originals - 1);
  if (originals < 2)
    return 1;
  // Repetitions lie in memory of their own, so that the caches do not hold them.
  const int copies = std::max(turn, static_cast<int>((megabytes << 20) / bytes) / turn * turn);
  std::vector<std::uint8_t> memory(bytes * static_cast<std::size_t>(copies));
  for (int i = 0; i < copies; ++i) {
    const int original = std::min(i % turn, turn - i % turn);
    std::memcpy(memory.data() + bytes * static_cast<std::size_t>(i),
                drive.data() + bytes * static_cast<std::size_t>(original), bytes);
  }
  const int mask_width = mask_extent(width, settings.mask_level),
            mask_height = mask_extent(height, settings.mask_level);
  const std::size_t mask_bytes = luma_bytes(mask_width, mask_height);
  std::vector<std::uint8_t> masks(mask_buffers * mask_bytes);
  Segmenter segmenter(settings);
  Digest digest;
  std::vector<std::array<std::int64_t, stage_count>> times;
  for (int i = 0; i < frames; ++i) {
    Frame frame =
        frame_at<Frame>(memory.data() + bytes * static_cast<std::size_t>(i % copies), width, height);
    frame.pts = std::int64_t{i} * 1000000000 / 30;
    const MaskTarget target{
        {masks.data() + mask_bytes * static_cast<std::size_t>(i % mask_buffers), mask_width},
        mask_width,
        mask_height};
    if (!segmenter.process(frame, {}, target).ok())
      return 1;
    add(segmenter.estimate(), digest);
    times.push_back(segmenter.stage_times());
  }
  const auto total = [](const std::array<std::int64_t, stage_count>& stages) {
    return std::accumulate(stages.begin(), stages.end(), std::int64_t{0});
  };
  std::sort(times.begin(), times.end(), [&](const auto& a, const auto& b) { return total(a) < total(b); });
  times.resize(std::max<std::size_t>(times.size() * 9 / 10, 1));
  double most = 0;
  for (const auto& stages : times)
    most += static_cast<double>(total(stages)) / static_cast<double>(times.size()) / 1000;
  times.resize(std::max<std::size_t>(times.size() / 9, 1));
  std::printf("digest %016llx\n", static_cast<unsigned long long>(digest.value()));
  double all = 0;
  for (int s = 0; s < stage_count; ++s) {
    double sum = 0;
    for (const auto& stages : times)
      sum += static_cast<double>(stages[static_cast<std::size_t>(s)]);
    const double mean = sum / static_cast<double>(times.size()) / 1000;
    all += mean;
    std::printf("%s %.1f\n", name_of(static_cast<Stage>(s)), mean);
  }
  std::printf("frame %.1f\nmost %.1f\n", all, most);
  return 0;
}

} // namespace

int main(int argc, char** argv) {
  const auto number = [&](int i) { return argc > i ? std::atoi(argv[i]) : 0; };
  const std::string mode = argc > 1 ? argv[1] : "";
  if (mode == "render" && (argc == 6 || argc == 7) && number(6) >= 0 && number(6) < 4)
    return render(argv[2], number(3), number(4), number(5), static_cast<scene::Kind>(number(6)));
  if (mode == "run" && (argc == 9 || argc == 10)) {
    Settings settings = Settings::of(Preset::standard);
    settings.mask_level = number(5);
    settings.n_threads = number(6);
    settings.motion = number(7) != 0 ? Motion::automatic : Motion::off;
    return run(contents(argv[2]), number(3), number(4), settings, number(8),
               static_cast<std::size_t>(number(9)));
  }
  std::fprintf(stderr, "usage: where render FILE WIDTH HEIGHT COUNT [KIND]\n"
                       "       where run FILE WIDTH HEIGHT MASK-LEVEL THREADS MOTION FRAMES [MEGABYTES]\n");
  return 2;
}
