// SPDX-License-Identifier: LGPL-2.1-or-later
// Access units of any bytes, in both codecs and every framing: what is found lies within them, and a stamp
// that is put where it belongs is found again.
#include <vector>

#include "exchange/precision_stamp.hpp"
#include "input.hpp"

namespace {

using namespace terrainseg;
using fuzz::Input;
using fuzz::require;

using Bytes = std::vector<std::uint8_t>;

/// NAL units of any types and contents, some of them cut short or with a foreign length.
Bytes unit_from(Input& in, const NalFraming& framing) {
  Bytes unit;
  for (int count = in.byte() % 8; count > 0; --count) {
    Bytes nal;
    if (in.chance(3)) {
      nal = stamp_unit(framing, in.number(8), in.byte());
      nal.erase(nal.begin(), nal.begin() + (framing.length_bytes ? framing.length_bytes : 4));
      for (int changes = in.byte() % 4; changes > 0; --changes)
        nal[in.byte() % nal.size()] = in.byte();
    } else {
      const auto content = in.take(in.byte() % 64);
      nal.assign(content.begin(), content.end());
    }
    if (framing.length_bytes == 0) {
      const Bytes code = in.chance(4) ? Bytes{0, 0, 1} : Bytes{0, 0, 0, 1};
      unit.insert(unit.end(), code.begin(), code.end());
    } else {
      const std::size_t length = in.chance(16) ? in.number(4) : nal.size();
      for (unsigned left = framing.length_bytes; left > 0; --left)
        unit.push_back(static_cast<std::uint8_t>(length >> 8 * (left - 1)));
    }
    unit.insert(unit.end(), nal.begin(), nal.end());
  }
  return unit;
}

void check(const Bytes& unit, const NalFraming& framing, std::uint64_t time) {
  const StampSearch found = find_stamp(unit, framing);
  require(!(found.several && found.time_us));
  require(found.temporal >= 1 && found.temporal <= 7);
  if (!found.place)
    return;
  require(*found.place < unit.size());
  const Bytes stamp = stamp_unit(framing, time, found.temporal);
  Bytes stamped(unit);
  stamped.insert(stamped.begin() + static_cast<std::ptrdiff_t>(*found.place), stamp.begin(), stamp.end());
  const StampSearch again = find_stamp(stamped, framing);
  require(again.place == *found.place + stamp.size());
  require(again.temporal == found.temporal);
  const bool same = !found.time_us || *found.time_us == time;
  require(again.several == (found.several || !same));
  require(again.several || again.time_us == time);
}

} // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  Input in(data, size);
  constexpr unsigned lengths[] = {0, 0, 4, 2, 1};
  const NalFraming framing = {in.byte() & 1 ? VideoCodec::h265 : VideoCodec::h264, lengths[in.byte() % 5]};
  const std::uint64_t time = in.number(8);
  if (in.byte() & 1) {
    const auto rest = in.take(size);
    check({rest.begin(), rest.end()}, framing, time);
    nal_length_bytes(framing.codec, rest);
  } else {
    check(unit_from(in, framing), framing, time);
  }
  return 0;
}
