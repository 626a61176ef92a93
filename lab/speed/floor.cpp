// SPDX-License-Identifier: LGPL-2.1-or-later
// What bounds the pyramid and the mask. usage: floor WIDTH HEIGHT [MEGABYTES] [ROUNDS]
//   Times, in turns, over I420 frames and masks that rotate through MEGABYTES of memory: reading a frame,
//   copying it, the pyramid of the default pipeline, the same of one frame that the cache holds, and filling
//   a mask. Writes microseconds: the fastest, the fastest tenth, the median.
#include <algorithm>
#include <chrono>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <functional>
#include <hwy/cache_control.h>
#include <hwy/highway.h>
#include <string>
#include <vector>

#include "coarse/pyramid.hpp"
#include "freespace/look/view.hpp"

namespace {

using namespace terrainseg;
namespace hn = hwy::HWY_NAMESPACE;

using Vector = std::uint64_t __attribute__((vector_size(32)));

std::uint64_t read_all(const std::uint8_t* bytes, std::size_t count) {
  Vector a{}, b{};
  for (std::size_t i = 0; i + 64 <= count; i += 64) {
    Vector first, second;
    std::memcpy(&first, bytes + i, sizeof first);
    std::memcpy(&second, bytes + i + 32, sizeof second);
    a |= first;
    b |= second;
  }
  a |= b;
  return a[0] | a[1] | a[2] | a[3];
}

void stream(std::uint8_t* bytes, std::size_t count) {
  const hn::ScalableTag<std::uint8_t> d;
  const std::size_t n = hn::Lanes(d);
  const auto value = hn::Set(d, 255);
  for (std::size_t i = 0; i + n <= count; i += n)
    hn::Stream(value, d, bytes + i);
  hwy::FlushStream();
}

} // namespace

int main(int argc, char** argv) {
  if (argc < 3)
    return 2;
  const int width = std::atoi(argv[1]), height = std::atoi(argv[2]);
  const std::size_t megabytes = argc > 3 ? static_cast<std::size_t>(std::atoi(argv[3])) : 300;
  const int rounds = argc > 4 ? std::atoi(argv[4]) : 300;
  const std::size_t luma = static_cast<std::size_t>(width) * static_cast<std::size_t>(height),
                    bytes = luma * 3 / 2, room = (bytes + 63) / 64 * 64,
                    count = std::max<std::size_t>((megabytes << 20) / bytes, 8);
  std::vector<std::uint8_t> memory(bytes * count), copy(4 * room + 64);
  for (std::size_t i = 0; i < memory.size(); ++i)
    memory[i] = static_cast<std::uint8_t>(i * 2654435761U >> 11);
  std::uint8_t* const buffers = copy.data() + 64 - reinterpret_cast<std::uintptr_t>(copy.data()) % 64;
  std::size_t next = 0;
  const auto rotated = [&] { return memory.data() + bytes * (next++ % count); };
  Pyramid pyramid;
  const PyramidPlan plan = coarse_plan(PixelFormat::I420, grid_level(-1, width, height));
  const auto build = [&](const std::uint8_t* at) {
    Frame frame;
    frame.format = PixelFormat::I420;
    frame.width = width;
    frame.height = height;
    frame.planes[0] = {at, width};
    frame.planes[1] = {at + luma, width / 2};
    frame.planes[2] = {at + luma * 5 / 4, width / 2};
    pyramid.build(frame, plan);
  };
  volatile std::uint64_t sink = 0;
  struct Lane {
    std::string name;
    std::function<void()> work;
    std::vector<double> times;
    std::function<void()> before; ///< not timed
  };
  std::vector<Lane> lanes{
      {"read", [&] { sink = sink | read_all(rotated(), bytes); }, {}, {}},
      {"memcpy", [&] { std::memcpy(buffers + room * (next % 4), rotated(), bytes); }, {}, {}},
      {"pyramid", [&] { build(rotated()); }, {}, {}},
      {"pyramid, frame in the cache", [&] { build(memory.data()); }, {}, [&] { build(memory.data()); }},
      {"fill a mask past the caches", [&] { stream(buffers + room * (next++ % 4), luma); }, {}, {}},
      {"fill a mask", [&] { std::memset(buffers + room * (next++ % 4), 255, luma); }, {}, {}},
  };
  for (int round = 0; round < rounds; ++round)
    for (Lane& lane : lanes) {
      if (lane.before)
        lane.before();
      const auto start = std::chrono::steady_clock::now();
      lane.work();
      const std::chrono::duration<double, std::micro> taken = std::chrono::steady_clock::now() - start;
      lane.times.push_back(taken.count());
    }
  std::printf("%-30s %9s %9s %9s\n", "us", "fastest", "tenth", "median");
  for (Lane& lane : lanes) {
    std::sort(lane.times.begin(), lane.times.end());
    const auto at = [&](double share) {
      return lane.times[static_cast<std::size_t>(share * static_cast<double>(lane.times.size() - 1))];
    };
    std::printf("%-30s %9.1f %9.1f %9.1f\n", lane.name.c_str(), at(0), at(0.1), at(0.5));
  }
}
