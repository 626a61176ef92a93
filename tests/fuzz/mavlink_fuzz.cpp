// SPDX-License-Identifier: LGPL-2.1-or-later
// Metres of any sound numbers at any times become OBSTACLE_DISTANCE messages that keep the format's promises.
#include <bit>
#include <cmath>
#include <vector>

#include "exchange/mavlink_stream.hpp"
#include "input.hpp"
#include "mavlink_frames.hpp"

namespace {

using namespace terrainseg;
using fuzz::check_messages;
using fuzz::Input;

void check_stream(Input in) {
  MavlinkStream stream;
  std::vector<float> ranges, bearings;
  std::uint64_t clock = 0;
  for (int frame = 0; frame < 64 && !in.done(); ++frame) {
    MavlinkOptions options;
    const std::uint8_t what = in.byte();
    options.layout = what & 1 ? MavlinkLayout::fine : MavlinkLayout::portable;
    options.unknown = what & 2 ? MavlinkUnknown::nothing : MavlinkUnknown::obstacle;
    clock = what & 4 ? in.number(8) : clock + in.number(4);
    if (!(what & 8)) {
      const std::size_t columns = 1 + in.number(what & 16 ? 2 : 1) % 4096;
      ranges.resize(columns);
      bearings.resize(columns);
      const float first = std::bit_cast<float>(static_cast<std::uint32_t>(in.number(4))),
                  step = static_cast<float>(in.byte()) / 256;
      for (std::size_t i = 0; i < columns; ++i) {
        bearings[i] = first - static_cast<float>(i) * step;
        ranges[i] = i % 7 == 6 && !in.done() ? std::bit_cast<float>(static_cast<std::uint32_t>(in.number(4)))
                                             : static_cast<float>(in.byte()) / 8;
      }
    }
    MetricEstimate metric;
    metric.ranges = metric.low = metric.high = ranges;
    metric.bearings = bearings;
    metric.height = 0.5;
    metric.range_min = std::bit_cast<double>(what & 32 ? in.number(8) : std::uint64_t{0});
    metric.range_max = what & 64 ? std::bit_cast<double>(in.number(8)) : 8;
    const bool known = !(what & 128) && flaw_of(metric) == nullptr;
    check_messages(
        stream.at(static_cast<std::int64_t>(clock >> 1), clock, known ? &metric : nullptr, options));
  }
}

} // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size > 0)
    check_stream(Input(data + 1, size - 1)); // the first byte once chose what was checked
  return 0;
}
