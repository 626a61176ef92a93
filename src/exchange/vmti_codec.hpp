// SPDX-License-Identifier: LGPL-2.1-or-later
// The primitives of a KLV unit, shared by encoder and decoder: tags of its sets, BER lengths, BER-OID tags,
// numbers, checksum.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>
#include <vector>

#include "terrainseg/estimate.hpp"

namespace terrainseg::vmti {

using Bytes = std::vector<std::uint8_t>;
using View = std::span<const std::uint8_t>;

// VMTI Local Set, VTarget Pack, VMask and VObject Local Sets: tags of ST 0903.
enum : std::uint8_t {
  vmti_checksum = 1,
  vmti_time = 2,
  vmti_system = 3,
  vmti_version = 4,
  vmti_targets_total = 5,
  vmti_targets_reported = 6,
  vmti_frame_number = 7,
  vmti_width = 8,
  vmti_height = 9,
  vmti_target_series = 101,
  vmti_terrain = 127, // not a tag of ST 0903: decoders skip unknown tags

  target_centroid = 1,
  target_top_left = 2,
  target_bottom_right = 3,
  target_confidence = 5,
  target_percentage = 7,
  target_row = 19,
  target_column = 20,
  target_mask = 101,
  target_object = 102,

  mask_runs = 2,

  object_ontology = 1,
  object_class = 2,
};
inline constexpr std::uint8_t st0903_revision = 5;

// Tags of the UAS Datalink Local Set (ST 0601).
enum : std::uint8_t {
  uas_checksum = 1,
  uas_time = 2,
  uas_heading = 5,
  uas_pitch = 6,
  uas_roll = 7,
  uas_latitude = 13,
  uas_longitude = 14,
  uas_altitude = 15,
  uas_relative_azimuth = 18,
  uas_relative_elevation = 19,
  uas_relative_roll = 20,
  uas_version = 65,
  uas_vmti = 74,
  uas_full_pitch = 90,
  uas_full_roll = 91,
};
inline constexpr std::uint8_t st0601_revision = 17;

enum : std::uint8_t { id_traversable = 1, id_doubtful = 2, id_horizon = 3 };

/// Size of the checksum item, the last one of a VMTI and of a UAS Datalink Local Set, bytes.
inline constexpr std::size_t checksum_size = 2 + 2;

// The private Local Set.
enum : std::uint8_t {
  terrain_version = 1,
  terrain_frame = 2,
  terrain_frame_size = 3,
  terrain_region = 4,
  terrain_sent_mask = 5,
  terrain_horizon = 6,
  terrain_confidence = 7,
  terrain_permille = 8,
  terrain_window = 9,
  terrain_generation = 10,
  terrain_flags = 11,
  terrain_boundary = 12,
  terrain_models = 13,
  terrain_motion = 14,
  terrain_crc = 127,
};
inline constexpr std::size_t model_size = 3 * 2 + 3 * 4 + 8 + 3;

/// 16-bit sum of all bytes, those at even positions in the upper half (ST 0601).
std::uint16_t checksum16(View bytes);

// ---- writing: each appends to `out` ----------------------------------------------------------------------

/// The lowest `bytes` bytes of a number, big-endian.
void put_big(Bytes& out, std::uint64_t value, int bytes);
/// BER length: one byte below 128; otherwise 0x80 + the number of bytes, and the bytes.
void put_length(Bytes& out, std::size_t length);
void put_bytes(Bytes& out, View bytes);
/// Tag and length of an item. The value must follow.
void put_head(Bytes& out, std::uint8_t tag, std::size_t length);
void put_item(Bytes& out, std::uint8_t tag, View value);
void put_text(Bytes& out, std::uint8_t tag, std::string_view text);
/// An unsigned number in `bytes` bytes, or in the smallest number of bytes if `bytes` is 0.
void put_number(Bytes& out, std::uint8_t tag, std::uint64_t value, int bytes = 0);
void put_rectangle(Bytes& out, std::uint8_t tag, const Rectangle& r);
/// Differences of neighbouring columns, zigzag, 7 bits a byte. A step of up to 63 rows takes one byte.
void put_boundary(Bytes& out, std::span<const std::uint16_t> boundary);

// ---- reading ---------------------------------------------------------------------------------------------

/// Reads from the front. After the first error all further reads are empty and ok() is false.
class Cursor {
 public:
  explicit Cursor(View bytes) : left_(bytes) {}
  bool ok() const { return ok_; }
  bool done() const { return left_.empty(); }
  View take(std::size_t n) {
    if (n > left_.size()) {
      fail();
      return {};
    }
    const View front = left_.first(n);
    left_ = left_.subspan(n);
    return front;
  }
  std::uint8_t byte() {
    const View one = take(1);
    return one.empty() ? 0 : one[0];
  }
  std::uint64_t big(std::size_t n) {
    std::uint64_t value = 0;
    for (const std::uint8_t b : take(n))
      value = (value << 8) | b;
    return value;
  }
  /// BER length of at most four bytes. Refuses the indefinite form, which KLV does not allow.
  std::size_t length() {
    const std::uint8_t first = byte();
    if (first < 128)
      return first;
    const std::size_t n = first & 127u;
    if (n < 1 || n > 4) {
      fail();
      return 0;
    }
    return static_cast<std::size_t>(big(n));
  }
  /// BER-OID tag: 7 bits a byte. Refuses tags of more than 16 bits.
  std::uint32_t tag() {
    std::uint32_t value = 0;
    for (int i = 0; i < 3; ++i) {
      const std::uint8_t b = byte();
      value = (value << 7) | (b & 127u);
      if (b < 128)
        return value;
    }
    fail();
    return 0;
  }
  View item() { return take(length()); }

 private:
  void fail() {
    ok_ = false;
    left_ = {};
  }
  View left_;
  bool ok_ = true;
};

/// A number that takes the whole item, at most 8 bytes.
bool read_number(View item, std::uint64_t& value);
/// Four numbers, each in -65536..65536.
bool read_rectangle(View item, Rectangle& r);
/// Reads the output of put_boundary(). False if it is truncated or has rows outside 0..65535.
bool read_boundary(View item, std::vector<std::uint16_t>& boundary);
bool begins_with(View bytes, const std::array<std::uint8_t, 16>& label);

} // namespace terrainseg::vmti
