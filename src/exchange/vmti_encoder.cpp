// SPDX-License-Identifier: LGPL-2.1-or-later
#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <string_view>

#include "exchange/vmti_codec.hpp"
#include "exchange/vmti_klv.hpp"

namespace terrainseg {
namespace {

using namespace vmti;

// The put functions append to `out`.

/// Tag and length of an item. The value must follow.
void put_head(Bytes& out, std::uint8_t tag, std::size_t length) {
  out.push_back(tag);
  put_length(out, length);
}

void put_item(Bytes& out, std::uint8_t tag, View value) {
  put_head(out, tag, value.size());
  append(out, value);
}

/// An unsigned number in `bytes` bytes, or in the smallest number of bytes if `bytes` is 0.
void put_number(Bytes& out, std::uint8_t tag, std::uint64_t value, int bytes = 0) {
  if (bytes == 0)
    bytes = size_of_number(value);
  put_head(out, tag, static_cast<std::size_t>(bytes));
  put_big(out, value, bytes);
}

/// Differences of neighbouring columns, zigzag, 7 bits a byte. A step of up to 63 rows takes one byte.
void put_boundary(Bytes& out, std::span<const std::uint16_t> boundary) {
  std::int32_t last = 0;
  for (const std::uint16_t row : boundary) {
    const std::int32_t step = row - last;
    auto zigzag = static_cast<std::uint32_t>(step >= 0 ? 2 * step : -2 * step - 1);
    for (; zigzag >= 128; zigzag >>= 7)
      out.push_back(static_cast<std::uint8_t>(zigzag | 128));
    out.push_back(static_cast<std::uint8_t>(zigzag));
    last = row;
  }
}

/// A run as in ST 0903: length of the pair, length of the pixel number, pixel number from 1, run length in
/// BER.
std::uint8_t* put_run(std::uint8_t* p, std::uint32_t start, std::uint32_t length) {
  const auto put = [&p](std::uint32_t number, int bytes) {
    for (int i = bytes - 1; i >= 0; --i)
      *p++ = static_cast<std::uint8_t>(number >> (8 * i));
  };
  std::uint8_t* const pair = p++;
  const int pixel_bytes = size_of_number(start + 1), length_bytes = size_of_number(length);
  *p++ = static_cast<std::uint8_t>(pixel_bytes);
  put(start + 1, pixel_bytes);
  if (length >= 128)
    *p++ = static_cast<std::uint8_t>(0x80 | length_bytes);
  put(length, length_bytes);
  *pair = static_cast<std::uint8_t>(p - pair - 1);
  return p;
}
constexpr std::size_t largest_run = 1 + 1 + 4 + 5;

/// A target of the mask and the runs of its pixels.
struct MaskTarget {
  std::uint8_t id;
  std::string_view name;
  Bytes& room;
  std::uint8_t* end = nullptr; ///< of the runs in `room`
  std::uint64_t pixels = 0;
  View runs() const { return {room.data(), end}; }
};

/// Collects the run lengths of the traversable and the doubtful target in one pass. Returns false if they
/// cannot fit into a unit.
bool write_runs(const GrayView& mask, std::array<MaskTarget, 2>& targets) {
  for (MaskTarget& target : targets) {
    target.room.resize(klv_unit_limit + largest_run);
    target.end = target.room.data();
  }
  std::uint32_t at = 0;
  return for_each_run(mask, [&](std::uint8_t value, std::size_t run) {
    const auto length = static_cast<std::uint32_t>(run);
    if (value != mask_not_traversable) {
      MaskTarget& target = targets[value == mask_traversable ? 0 : 1];
      target.end = put_run(target.end, at, length);
      target.pixels += length;
    }
    at += length;
    return targets[0].runs().size() + targets[1].runs().size() <= klv_unit_limit;
  });
}

/// Appends a VTarget Pack after adding its object.
void put_pack(Bytes& series, Bytes& target, std::string_view name) {
  Bytes object;
  put_item(object, object_ontology, bytes_of("urn:terrainseg:ontology:1"));
  put_item(object, object_class, bytes_of(name));
  put_item(target, target_object, object);
  put_length(series, target.size());
  append(series, target);
}

void put_mask_target(Bytes& series, const MaskTarget& of, std::uint64_t grid, std::uint8_t confidence) {
  Bytes mask;
  put_item(mask, mask_runs, of.runs());
  Bytes target;
  target.reserve(mask.size() + 128);
  target.push_back(of.id);
  put_number(target, target_confidence, (confidence * 100u + 127) / 255, 1);
  // ST 0903 allows 1..100: a target has at least 1.
  put_number(target, target_percentage,
             std::clamp<std::uint64_t>((of.pixels * 200 + grid) / (2 * grid), 1, 100), 1);
  put_item(target, target_mask, mask);
  put_pack(series, target, of.name);
}

void put_horizon_target(Bytes& series, const Estimate& e, int width, int height) {
  const Rectangle region =
      e.mask_region.empty() ? Rectangle{0, 0, e.frame_width, e.frame_height} : e.mask_region;
  const std::int64_t in_region = std::int64_t{e.horizon_row} - region.y;
  const auto row = static_cast<std::uint64_t>(
      std::clamp<std::int64_t>(in_region * height / std::max(region.height, 1), 0, height - 1));
  const std::uint64_t first = row * static_cast<std::uint64_t>(width) + 1;
  const auto half = static_cast<std::uint64_t>(width) / 2;
  Bytes target;
  target.reserve(128);
  target.push_back(id_horizon);
  put_number(target, target_centroid, first + half);
  put_number(target, target_top_left, first);
  put_number(target, target_bottom_right, first + static_cast<std::uint64_t>(width) - 1);
  put_number(target, target_confidence, (e.horizon_confidence * 100u + 127) / 255, 1);
  put_number(target, target_row, row + 1);
  put_number(target, target_column, half + 1);
  put_pack(series, target, "horizon");
}

/// Maps low..high to 0..2^bits - 1.
std::uint64_t unsigned_share(double value, double low, double high, int bits) {
  const double steps = std::ldexp(1.0, bits) - 1;
  return static_cast<std::uint64_t>(
      std::llround((std::clamp(value, low, high) - low) * steps / (high - low)));
}

/// Maps -limit..limit to -(2^(bits-1) - 1)..2^(bits-1) - 1 in two's complement; -2^(bits-1) means "out of
/// range".
std::uint64_t signed_share(double value, double limit, int bits) {
  const double steps = std::ldexp(1.0, bits - 1) - 1;
  const auto number = static_cast<std::uint64_t>(std::llround(std::clamp(value / limit, -1.0, 1.0) * steps));
  return number & ((std::uint64_t{1} << bits) - 1);
}

/// Writes an angle in the short item if it fits, otherwise in the item with the full range.
void put_angle(Bytes& set, double degrees, std::uint8_t tag, double limit, std::uint8_t full_tag) {
  constexpr double full_limit = 90;
  if (std::abs(degrees) <= limit)
    put_number(set, tag, signed_share(degrees, limit, 16), 2);
  else if (std::abs(degrees) <= full_limit)
    put_number(set, full_tag, signed_share(degrees, full_limit, 32), 4);
  else
    put_number(set, tag, 0x8000, 2);
}

} // namespace

const char* read_position(std::string_view text, UasPlatform& platform) {
  std::array<double, 4> numbers{};
  std::size_t count = 0;
  for (const char *at = text.data(), *const end = at + text.size();; ++at) {
    if (count == numbers.size())
      return "it has more than four numbers";
    while (at < end && *at == ' ')
      ++at;
    const auto [behind, error] = std::from_chars(at, end, numbers[count]);
    if (error != std::errc() || !std::isfinite(numbers[count]))
      return "it is not latitude,longitude,altitude as numbers with commas between";
    ++count;
    at = behind;
    if (at == end)
      break;
    if (*at != ',')
      return "something else than a comma follows a number";
  }
  if (count < 3)
    return "it needs three numbers: latitude,longitude,altitude";
  const auto& [latitude, longitude, altitude, heading] = numbers;
  if (std::abs(latitude) > 90)
    return "the latitude is not within -90 to 90 degrees";
  if (std::abs(longitude) > 180)
    return "the longitude is not within -180 to 180 degrees";
  if (altitude < -900 || altitude > 19000)
    return "the altitude is not within -900 to 19000 metres";
  if (count == 4 && (heading < 0 || heading > 360))
    return "the heading is not within 0 to 360 degrees";
  platform.position = {latitude, longitude, altitude};
  platform.heading = count == 4 ? std::optional(heading) : std::nullopt;
  return nullptr;
}

void put_platform(Bytes& set, const UasPlatform& platform) {
  if (platform.heading) {
    const double turn = std::fmod(*platform.heading, 360);
    put_number(set, uas_heading, unsigned_share(turn < 0 ? turn + 360 : turn, 0, 360, 16), 2);
  }
  if (platform.attitude) {
    put_angle(set, platform.attitude->pitch, uas_pitch, 20, uas_full_pitch);
    put_angle(set, platform.attitude->roll, uas_roll, 50, uas_full_roll);
  }
  if (platform.position) {
    put_number(set, uas_latitude, signed_share(platform.position->latitude, 90, 32), 4);
    put_number(set, uas_longitude, signed_share(platform.position->longitude, 180, 32), 4);
    put_number(set, uas_altitude, unsigned_share(platform.position->altitude, -900, 19000, 16), 2);
  }
  if (platform.attitude)
    for (const std::uint8_t tag : {uas_relative_azimuth, uas_relative_elevation, uas_relative_roll})
      put_number(set, tag, 0, 4);
}

std::span<const std::uint8_t> KlvEncoder::encode(const Estimate& estimate, std::uint64_t time_us,
                                                 const UasPlatform* platform) {
  if (estimate.mask.empty())
    return {};
  GrayView mask = estimate.mask;
  std::span<const std::uint16_t> boundary = estimate.boundary;
  halvings_ = 0;
  const auto too_large = [&] {
    return std::int64_t{mask.width} * mask.height > klv_mask_limit || mask.width > estimate.frame_width ||
           mask.height > estimate.frame_height;
  };
  while (too_large() || !write(estimate, mask, boundary, time_us, platform))
    if (!halve(mask, boundary))
      return {};
  return unit_;
}

bool KlvEncoder::halve(GrayView& mask, std::span<const std::uint16_t>& boundary) {
  if (mask.width == 1 && mask.height == 1 && boundary.size() <= 1)
    return false;
  const int w = (mask.width + 1) / 2, h = (mask.height + 1) / 2;
  Bytes& pixels = halved_masks_[halvings_ % 2];
  pixels.resize(static_cast<std::size_t>(w) * static_cast<std::size_t>(h));
  for (int y = 0; y < h; ++y) {
    const std::uint8_t* const a = mask.plane.row(2 * y);
    const std::uint8_t* const b = mask.plane.row(std::min(2 * y + 1, mask.height - 1));
    std::uint8_t* const out = pixels.data() + static_cast<std::size_t>(y) * static_cast<std::size_t>(w);
    const int pairs = mask.width / 2;
    for (int x = 0; x < pairs; ++x)
      out[x] = std::min(std::min(a[2 * x], a[2 * x + 1]), std::min(b[2 * x], b[2 * x + 1]));
    if (pairs < w)
      out[pairs] = std::min(a[2 * pairs], b[2 * pairs]);
  }
  mask = {{pixels.data(), w}, w, h};

  std::vector<std::uint16_t>& rows = halved_boundaries_[halvings_ % 2];
  rows.resize((boundary.size() + 1) / 2);
  for (std::size_t i = 0; i < rows.size(); ++i)
    rows[i] = std::max(boundary[2 * i], boundary[std::min(2 * i + 1, boundary.size() - 1)]);
  boundary = rows;
  ++halvings_;
  return true;
}

/// Fills unit_. Returns false if it would exceed the limit.
bool KlvEncoder::write(const Estimate& e, const GrayView& mask, std::span<const std::uint16_t> boundary,
                       std::uint64_t time_us, const UasPlatform* platform) {
  std::array<MaskTarget, 2> masks = {
      {{id_traversable, "traversable", traversable_}, {id_doubtful, "doubtful", doubtful_}}};
  if (!write_runs(mask, masks))
    return false;
  const std::uint64_t grid = static_cast<std::uint64_t>(mask.width) * static_cast<std::uint64_t>(mask.height);
  extra_.clear(); // for the targets, then for the private set
  unsigned targets = 0;
  for (const MaskTarget& target : masks)
    if (target.pixels > 0) {
      put_mask_target(extra_, target, grid, e.confidence);
      ++targets;
    }
  if (e.horizon_row >= 0) {
    put_horizon_target(extra_, e, mask.width, mask.height);
    ++targets;
  }

  set_.clear();
  put_number(set_, vmti_time, time_us, 8);
  put_item(set_, vmti_system, bytes_of("terrainseg"));
  put_number(set_, vmti_version, st0903_revision, 1);
  put_number(set_, vmti_targets_total, targets, 1);
  put_number(set_, vmti_targets_reported, targets, 1);
  put_number(set_, vmti_frame_number, e.frame & 0xffffff);
  put_number(set_, vmti_width, static_cast<unsigned>(mask.width));
  put_number(set_, vmti_height, static_cast<unsigned>(mask.height));
  if (targets > 0)
    put_item(set_, vmti_target_series, extra_);
  put_terrain_set(e, boundary);

  constexpr std::size_t sums =
      (2 + 4) + checksum_size; // CRC-32 at the end of the private set, then the checksum
  put_head(set_, vmti_terrain, extra_.size() + 2 + 4);
  append(set_, extra_);
  unit_.assign(vmti_label.begin(), vmti_label.end());
  put_length(unit_, set_.size() + sums);
  append(unit_, set_);
  put_head(unit_, terrain_crc, 4);
  put_big(unit_, crc32(unit_), 4);
  put_head(unit_, vmti_checksum, 2);
  put_big(unit_, checksum16(unit_), 2);
  if (platform)
    nest(*platform, time_us, set_.size() + sums);
  return unit_.size() <= klv_unit_limit;
}

/// Appends the VMTI set of unit_, without label, length and checksum, to a UAS Datalink Local Set.
void KlvEncoder::nest(const UasPlatform& platform, std::uint64_t time_us, std::size_t vmti_size) {
  set_.clear(); // its content has been copied into the unit
  put_number(set_, uas_time, time_us, 8);
  put_platform(set_, platform);
  put_number(set_, uas_version, st0601_revision, 1);
  put_item(set_, uas_vmti, View(unit_).last(vmti_size).first(vmti_size - checksum_size));
  unit_.assign(uas_label.begin(), uas_label.end());
  put_length(unit_, set_.size() + checksum_size);
  append(unit_, set_);
  put_head(unit_, uas_checksum, 2);
  put_big(unit_, checksum16(unit_), 2);
}

/// Writes the private Local Set without its checksum into extra_.
void KlvEncoder::put_terrain_set(const Estimate& e, std::span<const std::uint16_t> boundary) {
  Bytes& set = extra_;
  set.assign(terrain_label.begin(), terrain_label.end());
  put_number(set, terrain_version, terrain_set_version, 1);
  const auto put_one = [&](const auto& number) {
    const bool whole = number.bytes == 8; // has no limits
    const auto value = static_cast<std::int64_t>(number.field);
    put_big(set, static_cast<std::uint64_t>(whole ? value : std::clamp(value, number.least, number.most)),
            number.bytes);
  };
  const auto put_numbers = [&](std::uint8_t tag, const auto&... numbers) {
    put_head(set, tag, static_cast<std::size_t>((numbers.bytes + ...)));
    (put_one(numbers), ...);
  };
  each_item(e, put_numbers);
  Bytes& part = traversable_; // its runs have been copied into the unit
  part.clear();
  put_boundary(part, boundary);
  put_item(set, terrain_boundary, part);
  part.clear();
  for (int i = 0; i < std::clamp(e.model_count, 0, max_models); ++i) {
    each_number(e.models[static_cast<std::size_t>(i)],
                [&](auto number) { put_big(part, number, sizeof number); });
  }
  put_item(set, terrain_models, part);
  if (e.vanishing_row >= 0 || e.speed_over_height != 0)
    motion_item(e, put_numbers);
}

} // namespace terrainseg
