// SPDX-License-Identifier: LGPL-2.1-or-later
// The ways out at 1080p with a mask value for every pixel. The limit is 0.3 ms a frame each, for metres 0.02
// ms.
#include <benchmark/benchmark.h>

#include "../unit/exchange_estimates.hpp"
#include "exchange/json_lines.hpp"
#include "exchange/vmti_klv.hpp"
#include "metric/free_space_ranges.hpp"

namespace terrainseg {
namespace {

test::OwnedEstimate full_hd() {
  std::mt19937 random(1);
  return test::ground(1920, 1080, 0, random);
}

void JsonLine(benchmark::State& state) {
  const test::OwnedEstimate o = full_hd();
  std::string line;
  for (auto _ : state) {
    line.clear();
    append_json_line(line, o.estimate, 1, state.range(0) != 0);
    benchmark::DoNotOptimize(line.data());
  }
  state.counters["bytes"] = static_cast<double>(line.size());
}
BENCHMARK(JsonLine)->ArgName("mask")->Arg(0)->Arg(1)->Unit(benchmark::kMicrosecond);

void KlvEncode(benchmark::State& state) {
  const test::OwnedEstimate o = full_hd();
  KlvEncoder encoder;
  std::size_t size = 0;
  for (auto _ : state) {
    size = encoder.encode(o.estimate, 1).size();
    benchmark::DoNotOptimize(size);
  }
  state.counters["bytes"] = static_cast<double>(size);
}
BENCHMARK(KlvEncode)->Unit(benchmark::kMicrosecond);

void KlvEncodeHalved(benchmark::State& state) {
  std::mt19937 random(1);
  const test::OwnedEstimate o = test::noisy(1920, 1080, 1920, 1080, 100, random);
  KlvEncoder encoder;
  for (auto _ : state)
    benchmark::DoNotOptimize(encoder.encode(o.estimate, 1).size());
}
BENCHMARK(KlvEncodeHalved)->Unit(benchmark::kMicrosecond);

void KlvDecode(benchmark::State& state) {
  const test::OwnedEstimate o = full_hd();
  KlvEncoder encoder;
  const auto unit = encoder.encode(o.estimate, 1);
  KlvUnit decoded;
  std::vector<std::uint8_t> pixels(1920 * 1080);
  for (auto _ : state) {
    if (decoded.decode(unit) != KlvVerdict::ok)
      state.SkipWithError("does not decode");
    decoded.draw_mask({pixels.data(), 1920});
    benchmark::DoNotOptimize(pixels.data());
  }
}
BENCHMARK(KlvDecode)->Unit(benchmark::kMicrosecond);

// A boundary from 3 m away to the horizon, of three rises; low and high beside it. `jumps`: each column has a
// row of its own, which no ground does.
void FreeSpaceRanges(benchmark::State& state) {
  const auto columns = static_cast<int>(state.range(0));
  metric::Camera camera;
  camera.width = 1920, camera.height = 1080, camera.fx = camera.fy = 1600, camera.cx = 960, camera.cy = 540;
  camera.coefficients = {-0.1, 0.02};
  metric::Mount mount;
  mount.height = 0.65, mount.pitch = 0.1;
  metric::FreeSpaceRanges ranges;
  ranges.adapt(camera, 1920, 1080, {0, 0, 1920, 1080}, columns);
  std::vector<std::uint16_t> boundary(static_cast<std::size_t>(columns));
  for (std::size_t i = 0; i < boundary.size(); ++i)
    boundary[i] =
        static_cast<std::uint16_t>(400 + (state.range(1) ? i * 7919 : i * 960 / boundary.size()) % 320);
  for (auto _ : state)
    benchmark::DoNotOptimize(ranges.measure(boundary, false, mount, 20).ranges.data());
}
BENCHMARK(FreeSpaceRanges)
    ->ArgNames({"columns", "jumps"})
    ->ArgsProduct({{480, 960, 1920}, {0, 1}})
    ->Unit(benchmark::kMicrosecond);

} // namespace
} // namespace terrainseg

BENCHMARK_MAIN();
