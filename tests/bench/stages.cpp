// SPDX-License-Identifier: LGPL-2.1-or-later
// Each stage alone, and the whole frame in both presets. Compare ratios within one run; `copy` is the
// yardstick.
#include <benchmark/benchmark.h>

#include <cstring>
#include <memory>
#include <vector>

#include "base/lattice.hpp"
#include "base/workers.hpp"
#include "coarse/pyramid.hpp"
#include "coarse/window.hpp"
#include "learning/terrain_model.hpp"
#include "paper/pipeline.hpp"
#include "paper/scoring.hpp"
#include "support/frames.hpp"
#include "terrainseg/segmenter.hpp"

namespace terrainseg {
namespace {

struct Size {
  int width, height;
};
constexpr Size sizes[] = {{1280, 720}, {1920, 1080}};

/// Two frames in turn, so that no stage sees the same bytes twice running.
const test::OwnedFrame& frame_of(PixelFormat format, Size size, int index) {
  static std::vector<std::pair<std::array<int, 4>, std::unique_ptr<test::OwnedFrame>>> cache;
  const std::array<int, 4> key{static_cast<int>(format), size.width, size.height, index % 2};
  for (const auto& [k, frame] : cache)
    if (k == key)
      return *frame;
  cache.emplace_back(key,
                     std::make_unique<test::OwnedFrame>(format, size.width, size.height,
                                                        test::drive(size.width, size.height, index % 2)));
  return *cache.back().second;
}

/// What the stages before the one that is measured leave behind, in the paper's preset.
struct Prepared {
  Workers workers{1};
  Pyramid pyramid;
  Settings settings = Settings::of(Preset::paper);
  Size size;
  Rectangle window;
  std::vector<Cell> cells;
  int level = 0;
  Grid grid, training_grid;
  Gaussian moments;
  Prefiltered kept;
  ClusterScratch scratch;
  TrainingModels training;
  std::vector<TerrainModel> learned = std::vector<TerrainModel>(5);
  ScoreTable table;

  explicit Prepared(Size s) : size(s) {
    window = *place_window(settings, size.width, size.height);
    level = select_training_level(area(), 5, 48, cells);
    pyramid.build(frame_of(PixelFormat::I420, size, 0).frame(), {5, level, level}, &workers);
    grid = pyramid.grid(5);
    training_grid = pyramid.grid(level);
    moments = moments_of(training_grid, cells);
    prefilter(training_grid, cells, moments, {}, kept);
    training = clusters();
    learn(learned, training.span(), {});
    table.build(learned, 768, 3);
  }
  TrainingArea area() const { return {window, {}, {}, size.width, size.height}; }
  TrainingModels clusters() {
    const std::uint32_t floor = variance_floor(3);
    return cluster(training_grid, kept.cells, {3, {3, 3, 3}, {floor, floor, floor}, 1}, scratch);
  }
};

/// Makes the frames, so that no measurement does.
void prime(PixelFormat format, Size size) {
  frame_of(format, size, 0);
  frame_of(format, size, 1);
}

Size size_of(const benchmark::State& state) {
  return sizes[state.range(0)];
}

void label(benchmark::State& state) {
  const Size s = size_of(state);
  state.SetLabel(std::to_string(s.width) + "x" + std::to_string(s.height));
}

void copy(benchmark::State& state) {
  const Size s = size_of(state);
  std::vector<std::uint8_t> from(static_cast<std::size_t>(s.width) * s.height * 3 / 2, 7), to(from.size());
  for (auto _ : state) {
    std::memcpy(to.data(), from.data(), from.size());
    benchmark::ClobberMemory();
  }
  label(state);
}
BENCHMARK(copy)->DenseRange(0, 1)->Unit(benchmark::kMicrosecond);

void pyramid(benchmark::State& state) {
  Prepared p(size_of(state));
  prime(PixelFormat::I420, p.size);
  int i = 0;
  for (auto _ : state)
    p.pyramid.build(frame_of(PixelFormat::I420, p.size, ++i).frame(), {5, p.level, p.level}, &p.workers);
  label(state);
}
BENCHMARK(pyramid)->DenseRange(0, 1)->Unit(benchmark::kMicrosecond);

void window_and_prefilter(benchmark::State& state) {
  Prepared p(size_of(state));
  for (auto _ : state) {
    select_training_level(p.area(), 5, 48, p.cells);
    p.moments = moments_of(p.training_grid, p.cells);
    prefilter(p.training_grid, p.cells, p.moments, {}, p.kept);
  }
  label(state);
}
BENCHMARK(window_and_prefilter)->DenseRange(0, 1)->Unit(benchmark::kMicrosecond);

void clustering(benchmark::State& state) {
  Prepared p(size_of(state));
  for (auto _ : state)
    benchmark::DoNotOptimize(p.clusters());
  label(state);
}
BENCHMARK(clustering)->DenseRange(0, 1)->Unit(benchmark::kMicrosecond);

void horizon(benchmark::State& state) {
  Prepared p(size_of(state));
  const Rectangle rows = cells_of_window(p.window, 5, p.grid.width, p.grid.height);
  for (auto _ : state)
    benchmark::DoNotOptimize(
        find_horizon(p.grid, {p.moments.mean, p.moments.variance}, rows.y, rows.y + rows.height));
  label(state);
}
BENCHMARK(horizon)->DenseRange(0, 1)->Unit(benchmark::kMicrosecond);

void update(benchmark::State& state) {
  Prepared p(size_of(state));
  for (auto _ : state)
    learn(p.learned, p.training.span(), {256, 64 * 128 * 256, 0});
  label(state);
}
BENCHMARK(update)->DenseRange(0, 1)->Unit(benchmark::kMicrosecond);

void table(benchmark::State& state) {
  Prepared p(sizes[1]);
  const int bit_shift = static_cast<int>(state.range(0));
  for (auto _ : state)
    p.table.build(p.learned, 768, bit_shift);
  state.SetLabel("bit-shift " + std::to_string(bit_shift));
}
BENCHMARK(table)->DenseRange(0, 5)->Unit(benchmark::kMicrosecond);

void coarse_scores(benchmark::State& state) {
  Prepared p(size_of(state));
  std::vector<std::uint8_t> scores;
  for (auto _ : state)
    p.table.score(p.grid, scores);
  label(state);
}
BENCHMARK(coarse_scores)->DenseRange(0, 1)->Unit(benchmark::kMicrosecond);

void back_projection(benchmark::State& state) {
  Prepared p(size_of(state));
  const auto format = static_cast<PixelFormat>(state.range(1));
  std::vector<std::uint8_t> mask(static_cast<std::size_t>(p.size.width) * p.size.height);
  prime(format, p.size);
  int i = 0;
  for (auto _ : state)
    benchmark::DoNotOptimize(
        p.table.label(frame_of(format, p.size, ++i).frame(), 0, {mask.data(), p.size.width}, p.workers));
  label(state);
}
BENCHMARK(back_projection)
    ->ArgsProduct({{0, 1},
                   {static_cast<int>(PixelFormat::I420), static_cast<int>(PixelFormat::NV12),
                    static_cast<int>(PixelFormat::YUY2), static_cast<int>(PixelFormat::RGB),
                    static_cast<int>(PixelFormat::BGRx)}})
    ->Unit(benchmark::kMicrosecond);

void boundary(benchmark::State& state) {
  Prepared p(size_of(state));
  std::vector<std::uint8_t> mask(static_cast<std::size_t>(p.size.width) * p.size.height), scores;
  p.table.label(frame_of(PixelFormat::I420, p.size, 0).frame(), 0, {mask.data(), p.size.width}, p.workers);
  p.table.score(p.grid, scores);
  for (auto& cell : scores)
    cell = cell <= kernels::score_limit;
  std::vector<std::int16_t> top;
  std::vector<std::uint16_t> rows(static_cast<std::size_t>(p.size.width));
  const Rectangle covered = cells_of_window(p.window, 5, p.grid.width, p.grid.height);
  for (auto _ : state) {
    find_reachable(scores, p.grid.width, covered, top);
    refine_reachable(p.grid, top, {{mask.data(), p.size.width}, p.size.width, p.size.height}, 0,
                     p.size.height, rows);
    benchmark::ClobberMemory();
  }
  label(state);
}
BENCHMARK(boundary)->DenseRange(0, 1)->Unit(benchmark::kMicrosecond);

/// Arguments: size, preset, format, mask level.
void whole_frame(benchmark::State& state) {
  const Size s = size_of(state);
  const auto preset = static_cast<Preset>(state.range(1));
  const auto format = static_cast<PixelFormat>(state.range(2));
  Settings settings = Settings::of(preset);
  settings.mask_level = static_cast<int>(state.range(3));
  settings.motion = Motion::off; // it needs a drive: terrainseg-bench goal
  Segmenter segmenter(settings);
  prime(format, s);
  int i = 0;
  for (auto _ : state)
    if (!segmenter.process(frame_of(format, s, ++i).frame()).ok())
      state.SkipWithError("refused");
  state.counters["fps"] =
      benchmark::Counter(static_cast<double>(state.iterations()), benchmark::Counter::kIsRate);
  state.SetLabel(std::to_string(s.width) + "x" + std::to_string(s.height) +
                 (preset == Preset::paper ? " paper" : " default"));
}
BENCHMARK(whole_frame)
    ->ArgsProduct({{0, 1},
                   {static_cast<int>(Preset::standard), static_cast<int>(Preset::paper)},
                   {static_cast<int>(PixelFormat::I420), static_cast<int>(PixelFormat::NV12),
                    static_cast<int>(PixelFormat::RGB), static_cast<int>(PixelFormat::BGRx)},
                   {0}})
    ->Args({1, static_cast<int>(Preset::standard), static_cast<int>(PixelFormat::I420), 2})
    ->Args({1, static_cast<int>(Preset::paper), static_cast<int>(PixelFormat::I420), 2})
    ->ArgNames({"size", "preset", "format", "mask-level"})
    ->Unit(benchmark::kMicrosecond);

} // namespace
} // namespace terrainseg

BENCHMARK_MAIN();
