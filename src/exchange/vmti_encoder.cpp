// SPDX-License-Identifier: LGPL-2.1-or-later
#include <algorithm>
#include <string_view>

#include "exchange/bytes.hpp"
#include "exchange/vmti_codec.hpp"
#include "exchange/vmti_klv.hpp"

namespace terrainseg {
namespace {

using namespace vmti;

/// A run as in ST 0903: length of the pair, length of the pixel number, pixel number from 1, run length in
/// BER.
std::uint8_t* put_run(std::uint8_t* p, std::uint32_t start, std::uint32_t length) {
  std::uint8_t* const pair = p++;
  const std::uint32_t pixel = start + 1;
  const int n = pixel < 0x100 ? 1 : pixel < 0x10000 ? 2 : pixel < 0x1000000 ? 3 : 4;
  *p++ = static_cast<std::uint8_t>(n);
  for (int i = n - 1; i >= 0; --i)
    *p++ = static_cast<std::uint8_t>(pixel >> (8 * i));
  if (length >= 128) {
    const int m = length < 0x100 ? 1 : length < 0x10000 ? 2 : length < 0x1000000 ? 3 : 4;
    *p++ = static_cast<std::uint8_t>(0x80 | m);
    for (int i = m - 1; i > 0; --i)
      *p++ = static_cast<std::uint8_t>(length >> (8 * i));
  }
  *p++ = static_cast<std::uint8_t>(length);
  *pair = static_cast<std::uint8_t>(p - pair - 1);
  return p;
}
constexpr std::size_t largest_run = 1 + 1 + 4 + 5;

struct MaskRuns {
  std::size_t traversable_bytes = 0, doubtful_bytes = 0;
  std::uint64_t traversable_pixels = 0, doubtful_pixels = 0;
  bool fits = true;
};

/// Collects the run lengths of both targets in one pass. Stops if they cannot fit into a unit.
MaskRuns write_runs(const GrayView& mask, Bytes& traversable, Bytes& doubtful) {
  traversable.resize(klv_unit_limit + largest_run);
  doubtful.resize(klv_unit_limit + largest_run);
  std::uint8_t *t = traversable.data(), *d = doubtful.data();
  const std::uint8_t *const t_begin = t, *const d_begin = d;
  MaskRuns result;
  std::uint32_t at = 0;
  bool fits = true;
  for_each_run(mask, [&](std::uint8_t value, std::size_t run) {
    const auto length = static_cast<std::uint32_t>(run);
    if (value != mask_not_traversable && fits) {
      if (value == mask_traversable) {
        t = put_run(t, at, length);
        result.traversable_pixels += length;
      } else {
        d = put_run(d, at, length);
        result.doubtful_pixels += length;
      }
      fits = static_cast<std::size_t>((t - t_begin) + (d - d_begin)) <= klv_unit_limit;
    }
    at += length;
    return fits;
  });
  result.fits = fits;
  result.traversable_bytes = static_cast<std::size_t>(t - t_begin);
  result.doubtful_bytes = static_cast<std::size_t>(d - d_begin);
  return result;
}

/// ST 0903 allows 1..100: a target has at least 1.
std::uint8_t percentage(std::uint64_t part, std::uint64_t whole) {
  return static_cast<std::uint8_t>(std::clamp<std::uint64_t>((part * 200 + whole) / (2 * whole), 1, 100));
}

void put_object(Bytes& target, std::string_view name) {
  Bytes object;
  put_text(object, object_ontology, "urn:terrainseg:ontology:1");
  put_text(object, object_class, name);
  put_item(target, target_object, object);
}

void put_mask_target(Bytes& series, std::uint8_t id, View runs, std::uint64_t pixels, std::uint64_t grid,
                     std::uint8_t confidence, std::string_view name) {
  Bytes mask;
  put_item(mask, mask_runs, runs);
  Bytes target;
  target.reserve(runs.size() + 128);
  target.push_back(id);
  put_number(target, target_confidence, (confidence * 100u + 127) / 255, 1);
  put_number(target, target_percentage, percentage(pixels, grid), 1);
  put_item(target, target_mask, mask);
  put_object(target, name);
  put_length(series, target.size());
  put_bytes(series, target);
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
  put_object(target, "horizon");
  put_length(series, target.size());
  put_bytes(series, target);
}

} // namespace

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
  const MaskRuns runs = write_runs(mask, traversable_, doubtful_);
  if (!runs.fits)
    return false;
  const std::uint64_t grid = static_cast<std::uint64_t>(mask.width) * static_cast<std::uint64_t>(mask.height);
  Bytes& series = extra_;
  series.clear();
  unsigned targets = 0;
  if (runs.traversable_pixels > 0) {
    put_mask_target(series, id_traversable, View(traversable_).first(runs.traversable_bytes),
                    runs.traversable_pixels, grid, e.confidence, "traversable");
    ++targets;
  }
  if (runs.doubtful_pixels > 0) {
    put_mask_target(series, id_doubtful, View(doubtful_).first(runs.doubtful_bytes), runs.doubtful_pixels,
                    grid, e.confidence, "doubtful");
    ++targets;
  }
  if (e.horizon_row >= 0) {
    put_horizon_target(series, e, mask.width, mask.height);
    ++targets;
  }

  Bytes& set = set_;
  set.clear();
  put_number(set, vmti_time, time_us, 8);
  put_text(set, vmti_system, "terrainseg");
  put_number(set, vmti_version, st0903_revision, 1);
  put_number(set, vmti_targets_total, targets, 1);
  put_number(set, vmti_targets_reported, targets, 1);
  put_number(set, vmti_frame_number, e.frame & 0xffffff);
  put_number(set, vmti_width, static_cast<unsigned>(mask.width));
  put_number(set, vmti_height, static_cast<unsigned>(mask.height));
  if (targets > 0)
    put_item(set, vmti_target_series, series);
  put_terrain_set(e, boundary);

  constexpr std::size_t sums =
      (2 + 4) + checksum_size; // CRC-32 at the end of the private set, then the checksum
  put_head(set, vmti_terrain, extra_.size() + 2 + 4);
  put_bytes(set, extra_);
  Bytes& unit = unit_;
  unit.assign(vmti_label.begin(), vmti_label.end());
  put_length(unit, set.size() + sums);
  put_bytes(unit, set);
  put_head(unit, terrain_crc, 4);
  put_big(unit, crc32(unit), 4);
  put_head(unit, vmti_checksum, 2);
  put_big(unit, checksum16(unit), 2);
  if (platform)
    nest(*platform, time_us, set.size() + sums);
  return unit.size() <= klv_unit_limit;
}

/// Appends the VMTI set of unit_, without label, length and checksum, to a UAS Datalink Local Set.
void KlvEncoder::nest(const UasPlatform& platform, std::uint64_t time_us, std::size_t vmti_size) {
  Bytes& set = set_; // its content has been copied into the unit
  set.clear();
  put_number(set, uas_time, time_us, 8);
  put_platform(set, platform);
  put_number(set, uas_version, st0601_revision, 1);
  put_item(set, uas_vmti, View(unit_).last(vmti_size).first(vmti_size - checksum_size));
  unit_.assign(uas_label.begin(), uas_label.end());
  put_length(unit_, set.size() + checksum_size);
  put_bytes(unit_, set);
  put_head(unit_, uas_checksum, 2);
  put_big(unit_, checksum16(unit_), 2);
}

/// Writes the private Local Set without its checksum into extra_.
void KlvEncoder::put_terrain_set(const Estimate& e, std::span<const std::uint16_t> boundary) {
  const auto size_of = [](int v) { return static_cast<std::uint64_t>(std::clamp(v, 0, 65535)); };
  Bytes& set = extra_;
  set.assign(terrain_label.begin(), terrain_label.end());
  put_number(set, terrain_version, terrain_set_version, 1);
  put_number(set, terrain_frame, e.frame, 8);
  put_number(set, terrain_frame_size, size_of(e.frame_width) << 16 | size_of(e.frame_height), 4);
  put_rectangle(set, terrain_region, e.mask_region);
  put_number(set, terrain_sent_mask, size_of(e.mask.width) << 16 | size_of(e.mask.height), 4);
  put_number(set, terrain_horizon,
             (std::uint64_t{static_cast<std::uint32_t>(std::max(e.horizon_row, -1))} << 8) |
                 e.horizon_confidence,
             5);
  put_number(set, terrain_confidence, e.confidence, 1);
  put_number(set, terrain_permille, static_cast<std::uint64_t>(std::clamp(e.traversable_permille, 0, 1000)),
             2);
  put_rectangle(set, terrain_window, e.window);
  put_number(set, terrain_generation, e.model_generation, 4);
  put_number(set, terrain_flags, e.flags, 4);
  Bytes& part = traversable_; // its runs have been copied into the unit
  part.clear();
  put_boundary(part, boundary);
  put_item(set, terrain_boundary, part);
  part.clear();
  for (int i = 0; i < std::clamp(e.model_count, 0, max_models); ++i) {
    const ModelSummary& model = e.models[static_cast<std::size_t>(i)];
    for (const std::uint16_t mean : model.mean)
      put_big(part, mean, 2);
    for (const std::uint32_t variance : model.variance)
      put_big(part, variance, 4);
    put_big(part, model.mass, 8);
    put_bytes(part, model.rgb);
  }
  put_item(set, terrain_models, part);
  if (e.vanishing_row >= 0 || e.speed_over_height != 0)
    put_number(set, terrain_motion,
               std::uint64_t{static_cast<std::uint32_t>(std::max(e.vanishing_row, -1))} << 32 |
                   static_cast<std::uint32_t>(e.speed_over_height),
               8);
}

} // namespace terrainseg
