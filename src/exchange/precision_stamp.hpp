// SPDX-License-Identifier: LGPL-2.1-or-later
// The precision time stamp of MISB ST 0604 in H.264 and H.265: an SEI message "user data, unregistered"
// (payload type 5) with an identifier of MISB, the time status of ST 0603, and the time in groups of two
// bytes separated by 0xFF, which prevents start codes. It is part of the access unit, so demuxers cannot move
// it.
//
// Integers only, no GStreamer.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

namespace terrainseg {

enum class VideoCodec : std::uint8_t { h264, h265 };

/// How NAL units are separated in an access unit.
struct NalFraming {
  VideoCodec codec = VideoCodec::h264;
  unsigned length_bytes = 0; ///< size of the length field in front of each unit; 0 = start codes (Annex B)
};

using StampIdentifier = std::array<std::uint8_t, 16>;
/// "MISPmicrosectime".
inline constexpr StampIdentifier h264_microseconds = {0x4d, 0x49, 0x53, 0x50, 0x6d, 0x69, 0x63, 0x72,
                                                      0x6f, 0x73, 0x65, 0x63, 0x74, 0x69, 0x6d, 0x65};
inline constexpr StampIdentifier h265_microseconds = {0xa8, 0x68, 0x7d, 0xd4, 0xd7, 0x59, 0x37, 0x58,
                                                      0xa5, 0xce, 0xf0, 0x33, 0x8b, 0x65, 0x45, 0xf1};
inline constexpr StampIdentifier h265_nanoseconds = {0xcf, 0x84, 0x82, 0x78, 0xee, 0x23, 0x30, 0x6c,
                                                     0x92, 0x65, 0xe8, 0xfe, 0xf2, 0x2f, 0xb8, 0xb8};
constexpr const StampIdentifier& microseconds_identifier(VideoCodec codec) {
  return codec == VideoCodec::h264 ? h264_microseconds : h265_microseconds;
}

/// Time status: it is unknown whether the clock is locked to a reference; no discontinuity.
inline constexpr std::uint8_t stamp_status = 0x9f;

/// Payload after the identifier: status and time.
using StampContent = std::array<std::uint8_t, 12>;
StampContent stamp_content(std::uint64_t time_us);

/// Reads microseconds from the payload after an identifier. Returns nothing if the identifier is unknown or
/// the payload has another form. Bytes after the time are ignored.
std::optional<std::uint64_t> stamp_time(std::span<const std::uint8_t> identifier,
                                        std::span<const std::uint8_t> content);

/// Content of an access unit in front of its first slice.
struct StampSearch {
  std::optional<std::uint64_t> time_us; ///< the stamp; nothing if there is none, or several different ones
  bool several = false;                 ///< several different stamps: parts of two pictures
  std::optional<std::size_t>
      place; ///< position for a stamp; nothing without a slice, or if a length exceeds the unit
  std::uint8_t temporal = 1; ///< nuh_temporal_id_plus1 of the first slice (H.265)
};
/// Reads up to the first slice. Safe for untrusted input: linear time, no allocation.
StampSearch find_stamp(std::span<const std::uint8_t> unit, const NalFraming& framing);

/// Returns a NAL unit with the stamp of a picture, with the start code or length of the access unit.
std::vector<std::uint8_t> stamp_unit(const NalFraming& framing, std::uint64_t time_us,
                                     std::uint8_t temporal = 1);

/// Size of the length field according to `codec_data` of the caps (avcC or hvcC). Returns nothing if that is
/// invalid.
std::optional<unsigned> nal_length_bytes(VideoCodec codec, std::span<const std::uint8_t> codec_data);

} // namespace terrainseg
