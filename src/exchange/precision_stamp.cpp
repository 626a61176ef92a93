// SPDX-License-Identifier: LGPL-2.1-or-later
#include "exchange/precision_stamp.hpp"

#include <algorithm>

#include "exchange/bytes.hpp"
#include "exchange/nal_units.hpp"

namespace terrainseg {
namespace {

using Bytes = std::span<const std::uint8_t>;

constexpr std::uint8_t h264_sei = 6, h265_prefix_sei = 39;
constexpr std::uint8_t user_data_unregistered = 5;
constexpr std::uint8_t message_size = sizeof(StampIdentifier) + sizeof(StampContent);
constexpr std::uint8_t separator = 0xff;
constexpr std::uint8_t trailing_bits = 0x80;

std::size_t header_bytes(VideoCodec codec) {
  return codec == VideoCodec::h264 ? 1 : 2;
}

std::uint8_t type_of(VideoCodec codec, std::uint8_t first) {
  return codec == VideoCodec::h264 ? first & 31 : first >> 1 & 63;
}

/// Whether the picture begins with this unit: a slice, or a prefix NAL unit (H.264, type 14), which precedes
/// one.
bool is_picture(VideoCodec codec, std::uint8_t type) {
  if (codec == VideoCodec::h265)
    return type < 32;
  return (type >= 1 && type <= 5) || type == 14 || type == 20 || type == 21;
}

/// The payload of a NAL unit without emulation prevention bytes (the 3 of each 0 0 3).
class Payload {
 public:
  explicit Payload(Bytes nal) : rest_(nal) {}

  std::optional<std::uint8_t> next() {
    if (zeros_ >= 2 && !rest_.empty() && rest_.front() == 3) {
      rest_ = rest_.subspan(1);
      zeros_ = 0;
    }
    if (rest_.empty())
      return std::nullopt;
    const std::uint8_t byte = rest_.front();
    rest_ = rest_.subspan(1);
    zeros_ = byte == 0 ? zeros_ + 1 : 0;
    return byte;
  }

  /// A payload type or size: bytes of 255, and a last one below 255. Stops above `most`.
  std::optional<std::uint32_t> number(std::uint32_t most) {
    std::uint32_t sum = 0;
    for (;;) {
      const auto byte = next();
      if (!byte || *byte > most - sum)
        return std::nullopt;
      sum += *byte;
      if (*byte != 255)
        return sum;
    }
  }

  bool skip(std::uint32_t count) {
    while (count > 0 && next())
      --count;
    return count == 0;
  }

 private:
  Bytes rest_;
  unsigned zeros_ = 0;
};

/// Reads the messages of an SEI unit without its header.
void read_messages(Bytes nal, StampSearch& found) {
  constexpr std::uint32_t most = 1 << 24;
  Payload payload(nal);
  for (;;) {
    const auto type = payload.number(most);
    const auto size = type ? payload.number(most) : std::nullopt;
    if (!size)
      return;
    std::uint32_t left = *size;
    if (*type == user_data_unregistered && left >= message_size) {
      std::array<std::uint8_t, message_size> message{};
      for (std::uint8_t& byte : message) {
        const auto next = payload.next();
        if (!next)
          return;
        byte = *next;
      }
      left -= message_size;
      const Bytes whole(message);
      const auto time =
          stamp_time(whole.first(sizeof(StampIdentifier)), whole.subspan(sizeof(StampIdentifier)));
      found.several = found.several || (time && found.time_us && time != found.time_us);
      if (time)
        found.time_us = found.several ? std::nullopt : time;
    }
    if (!payload.skip(left))
      return;
  }
}

/// Evaluates a NAL unit without its start code or length. Returns true if it belongs to the picture.
bool see(Bytes nal, VideoCodec codec, StampSearch& found) {
  if (nal.size() < header_bytes(codec))
    return false;
  const std::uint8_t type = type_of(codec, nal[0]);
  if (is_picture(codec, type)) {
    if (codec == VideoCodec::h265)
      found.temporal = std::max<std::uint8_t>(nal[1] & 7, 1);
    return true;
  }
  if (type == (codec == VideoCodec::h264 ? h264_sei : h265_prefix_sei))
    read_messages(nal.subspan(header_bytes(codec)), found);
  return false;
}

void search_start_codes(Bytes unit, VideoCodec codec, StampSearch& found) {
  for (NalWalker nals(unit); nals.next();) {
    // The end of the picture is not searched: it may have many bytes.
    const bool picture = is_picture(codec, type_of(codec, nals.rest().front()));
    if (see(picture ? nals.rest() : nals.unit(), codec, found))
      found.place = nals.place();
    if (picture)
      return;
  }
}

void search_lengths(Bytes unit, const NalFraming& framing, StampSearch& found) {
  ByteReader in(unit);
  while (in.left() >= framing.length_bytes) {
    const std::size_t place = unit.size() - in.left(), size = in.big(framing.length_bytes);
    if (size > in.left())
      return;
    if (see(in.take(size), framing.codec, found)) {
      found.place = place;
      return;
    }
  }
}

} // namespace

StampContent stamp_content(std::uint64_t time_us) {
  StampContent content = {stamp_status};
  std::size_t at = 1;
  for (int shift = 48; shift >= 0; shift -= 16) {
    content[at++] = static_cast<std::uint8_t>(time_us >> (shift + 8));
    content[at++] = static_cast<std::uint8_t>(time_us >> shift);
    if (shift > 0)
      content[at++] = separator;
  }
  return content;
}

std::optional<std::uint64_t> stamp_time(Bytes identifier, Bytes content) {
  const auto is = [&](const StampIdentifier& known) { return std::ranges::equal(identifier, known); };
  const bool nanoseconds = is(h265_nanoseconds);
  if ((!nanoseconds && !is(h264_microseconds) && !is(h265_microseconds)) ||
      content.size() < sizeof(StampContent))
    return std::nullopt;
  std::uint64_t time = 0;
  for (std::size_t i = 1; i < sizeof(StampContent); ++i)
    if (i % 3 != 0)
      time = time << 8 | content[i];
    else if (content[i] != separator)
      return std::nullopt;
  return nanoseconds ? time / 1000 : time;
}

StampSearch find_stamp(Bytes unit, const NalFraming& framing) {
  StampSearch found;
  if (framing.length_bytes == 0)
    search_start_codes(unit, framing.codec, found);
  else
    search_lengths(unit, framing, found);
  return found;
}

std::vector<std::uint8_t> stamp_unit(const NalFraming& framing, std::uint64_t time_us,
                                     std::uint8_t temporal) {
  const bool h264 = framing.codec == VideoCodec::h264;
  std::vector<std::uint8_t> unit;
  // No emulation prevention bytes are needed: the separators prevent 0 0 0 to 0 0 3 in the time, and the
  // other bytes are not zero.
  const std::size_t size = header_bytes(framing.codec) + 2 + message_size + 1;
  if (framing.length_bytes == 0)
    append(unit, std::array<std::uint8_t, 4>{0, 0, 0, 1});
  put_big(unit, size, static_cast<int>(framing.length_bytes));
  if (h264)
    append(unit, std::array{h264_sei});
  else // layer 0 and the temporal layer of the picture
    append(unit, std::array{static_cast<std::uint8_t>(h265_prefix_sei << 1), temporal});
  append(unit, std::array{user_data_unregistered, message_size});
  append(unit, microseconds_identifier(framing.codec));
  append(unit, stamp_content(time_us));
  append(unit, std::array{trailing_bits});
  return unit;
}

std::optional<unsigned> nal_length_bytes(VideoCodec codec, Bytes codec_data) {
  // avcC: version, profile, compatibility, level, then the length size. hvcC has it in byte 21.
  const std::size_t at = codec == VideoCodec::h264 ? 4 : 21;
  if (codec_data.size() <= at || (codec == VideoCodec::h264 && codec_data[0] != 1))
    return std::nullopt;
  const unsigned bytes = (codec_data[at] & 3) + 1U;
  return bytes == 3 ? std::nullopt : std::optional(bytes);
}

} // namespace terrainseg
