// SPDX-License-Identifier: LGPL-2.1-or-later
// Datagrams from anywhere that may hold an attitude, as they are and with a right checksum; and metres of any
// sound numbers at any times, which become OBSTACLE_DISTANCE messages that keep the format's promises.
#include <bit>
#include <cmath>
#include <vector>

#include "exchange/mavlink_stream.hpp"
#include "input.hpp"
#include "mavlink_frames.hpp"

namespace {

using namespace terrainseg;
using fuzz::check_messages;
using fuzz::crc;
using fuzz::Input;
using fuzz::require;

/// A frame around anything: of either version, signed or not, after what may be another message.
void check_attitude(Input in) {
  const auto before = in.take(in.byte() % 32);
  const bool second = in.byte() & 1, is_signed = second && in.byte() & 1;
  const auto payload = in.take(in.byte());
  std::vector<std::uint8_t> datagram(before.begin(), before.end());
  const std::size_t start = datagram.size();
  const auto length = static_cast<std::uint8_t>(payload.size());
  if (second)
    datagram.insert(datagram.end(), {0xFD, length, std::uint8_t{is_signed}, 0, 1, 1, 1, 30, 0, 0});
  else
    datagram.insert(datagram.end(), {0xFE, length, 1, 1, 1, 30});
  datagram.insert(datagram.end(), payload.begin(), payload.end());
  const std::uint16_t sum = crc(std::span(datagram).subspan(start + 1), 39);
  datagram.push_back(static_cast<std::uint8_t>(sum));
  datagram.push_back(static_cast<std::uint8_t>(sum >> 8));
  datagram.resize(datagram.size() + (is_signed ? 13 : 0));
  require(find_attitude(datagram).has_value());
  if (!before.empty())
    return; // another one may stand in it
  std::uint32_t time = 0;
  for (std::size_t i = 0; i < 4 && i < payload.size(); ++i)
    time |= static_cast<std::uint32_t>(payload[i]) << (8 * i);
  require(find_attitude(datagram)->time_ms == time);
  datagram.pop_back();
  require(!find_attitude(std::span(datagram).first(datagram.size() - (is_signed ? 13 : 0))));
}

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
  find_attitude({data, size});
  if (size == 0)
    return 0;
  const Input rest(data + 1, size - 1);
  data[0] & 1 ? check_stream(rest) : check_attitude(rest);
  return 0;
}
