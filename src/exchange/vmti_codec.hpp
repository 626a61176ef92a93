// SPDX-License-Identifier: LGPL-2.1-or-later
// What encoder and decoder of a KLV unit share: tags of its sets, BER lengths, BER-OID tags, checksum.
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "exchange/bytes.hpp"

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

/// A field of an estimate as a number of `bytes` bytes. The encoder limits it to its range, the decoder
/// refuses numbers outside.
template <class Field> struct Number {
  Field& field;
  int bytes;
  std::int64_t least = 0, most = std::int64_t{1} << 32;
};
template <class Field, class... Limits> Number(Field&, int, Limits...) -> Number<Field>;

template <class Coordinate> Number<Coordinate> coordinate(Coordinate& field) {
  return {field, 4, -65536, 65536};
}

/// Calls pass(tag, numbers...) for each item of the private set that consists of numbers, except
/// terrain_motion.
template <class AnyEstimate, class Pass> void each_item(AnyEstimate& e, const Pass& pass) {
  const auto rectangle = [&](std::uint8_t tag, auto& r) {
    pass(tag, coordinate(r.x), coordinate(r.y), coordinate(r.width), coordinate(r.height));
  };
  pass(terrain_frame, Number{e.frame, 8});
  pass(terrain_frame_size, Number{e.frame_width, 2, 0, 65535}, Number{e.frame_height, 2, 0, 65535});
  rectangle(terrain_region, e.mask_region);
  // Of the mask before the sender halved it.
  pass(terrain_sent_mask, Number{e.mask.width, 2, 0, 65535}, Number{e.mask.height, 2, 0, 65535});
  pass(terrain_horizon, Number{e.horizon_row, 4, -1, 65535}, Number{e.horizon_confidence, 1});
  pass(terrain_confidence, Number{e.confidence, 1});
  pass(terrain_permille, Number{e.traversable_permille, 2, 0, 1000});
  rectangle(terrain_window, e.window);
  pass(terrain_generation, Number{e.model_generation, 4});
  pass(terrain_flags, Number{e.flags, 4});
}
template <class AnyEstimate, class Pass> void motion_item(AnyEstimate& e, const Pass& pass) {
  pass(terrain_motion, Number{e.vanishing_row, 4, -1, INT32_MAX},
       Number{e.speed_over_height, 4, INT32_MIN, INT32_MAX});
}

/// Calls pass(number) for the numbers of a model in their order.
template <class Model, class Pass> void each_number(Model& model, const Pass& pass) {
  each_moment(model, pass);
  for (auto& component : model.rgb)
    pass(component);
}

/// 16-bit sum of all bytes, those at even positions in the upper half (ST 0601).
inline std::uint16_t checksum16(View bytes) {
  std::uint32_t high = 0, low = 0;
  std::size_t i = 0;
  for (; i + 1 < bytes.size(); i += 2) {
    high += bytes[i];
    low += bytes[i + 1];
  }
  if (i < bytes.size())
    high += bytes[i];
  return static_cast<std::uint16_t>((high << 8) + low);
}

/// The number of bytes of a number without leading zeros, at least 1.
inline int size_of_number(std::uint64_t value) {
  return (std::bit_width(value | 1) + 7) / 8;
}

/// Appends a BER length: one byte below 128; otherwise 0x80 + the number of bytes, and the bytes.
inline void put_length(Bytes& out, std::size_t length) {
  if (length < 128) {
    out.push_back(static_cast<std::uint8_t>(length));
    return;
  }
  const int n = size_of_number(length);
  out.push_back(static_cast<std::uint8_t>(0x80 | n));
  put_big(out, length, n);
}

inline bool begins_with(View bytes, const std::array<std::uint8_t, 16>& label) {
  return bytes.size() >= label.size() && std::equal(label.begin(), label.end(), bytes.begin());
}

/// Reads what the functions above write, from untrusted bytes.
class Cursor : public ByteReader {
 public:
  using ByteReader::ByteReader;
  /// BER length of at most four bytes. Refuses the indefinite form, which KLV does not allow.
  std::size_t length() {
    const auto first = static_cast<std::size_t>(big(1));
    if (first < 128)
      return first;
    if (first == 128 || first > 128 + 4)
      fail();
    return static_cast<std::size_t>(big(first & 127));
  }
  /// BER-OID tag: 7 bits a byte. Refuses tags of more than 16 bits.
  std::uint32_t tag() {
    std::uint32_t value = 0;
    for (int i = 0; i < 3; ++i) {
      const auto b = static_cast<std::uint32_t>(big(1));
      value = (value << 7) | (b & 127u);
      if (b < 128)
        return value;
    }
    fail();
    return 0;
  }
  View item() { return take(length()); }
};

} // namespace terrainseg::vmti
