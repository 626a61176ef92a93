// SPDX-License-Identifier: LGPL-2.1-or-later
// The letters of a KLV unit: tags of its sets, BER lengths, BER-OID tags, numbers, checksum. What encoder and
// decoder share; nothing else includes it.
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
  vmti_terrain = 127, // none of ST 0903's: decoders pass over tags that they do not know

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

// UAS Datalink Local Set: tags of ST 0601.
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

/// Bytes of the checksum item, the last of a VMTI and of a UAS Datalink Local Set.
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

/// Upper half of each pair of bytes added up in 16 bits, as ST 0601 defines it.
std::uint16_t checksum16(View bytes);

// ---- writing: each appends to `out` ----------------------------------------------------------------------

/// The lowest `bytes` bytes of a number, the highest first.
void put_big(Bytes& out, std::uint64_t value, int bytes);
/// BER length: one byte under 128, else the number of bytes and the bytes.
void put_length(Bytes& out, std::size_t length);
void put_bytes(Bytes& out, View bytes);
/// Tag and length of an item whose value follows.
void put_head(Bytes& out, std::uint8_t tag, std::size_t length);
void put_item(Bytes& out, std::uint8_t tag, View value);
void put_text(Bytes& out, std::uint8_t tag, std::string_view text);
/// An unsigned number in `bytes` bytes, or in as few as hold it when `bytes` is 0.
void put_number(Bytes& out, std::uint8_t tag, std::uint64_t value, int bytes = 0);
void put_rectangle(Bytes& out, std::uint8_t tag, const Rectangle& r);
/// Differences of neighbouring columns, zigzag, seven bits a byte: steps of up to 63 rows take one byte.
void put_boundary(Bytes& out, std::span<const std::uint16_t> boundary);

// ---- reading ---------------------------------------------------------------------------------------------

/// Takes things off the front. After the first thing that is not there everything is empty and ok() is false.
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
  /// BER length of at most four bytes; the indefinite form is refused, as KLV does not know it.
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
  /// BER-OID tag: seven bits a byte. Tags above 16 bits do not exist.
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

/// A number of exactly the item's bytes, at most 8.
bool read_number(View item, std::uint64_t& value);
/// Four numbers within -65536..65536.
bool read_rectangle(View item, Rectangle& r);
/// What put_boundary() wrote; false when it is cut short or holds rows outside 0..65535.
bool read_boundary(View item, std::vector<std::uint16_t>& boundary);
bool begins_with(View bytes, const std::array<std::uint8_t, 16>& label);

} // namespace terrainseg::vmti
