// SPDX-License-Identifier: LGPL-2.1-or-later
#include "exchange/vmti_klv.hpp"

#include <algorithm>
#include <cstring>
#include <string_view>

#include "exchange/bytes.hpp"

namespace terrainseg {
namespace {

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
constexpr std::uint8_t st0903_revision = 5;

enum : std::uint8_t { id_traversable = 1, id_doubtful = 2, id_horizon = 3 };

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
  terrain_crc = 127,
};
constexpr std::size_t model_size = 3 * 2 + 3 * 4 + 8 + 3;

/// Upper half of each pair of bytes added up in 16 bits, as ST 0601 defines it.
std::uint16_t checksum16(View bytes) {
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

// ---- writing ---------------------------------------------------------------------------------------------

void put_big(Bytes& out, std::uint64_t value, int bytes) {
  for (int i = bytes - 1; i >= 0; --i)
    out.push_back(static_cast<std::uint8_t>(value >> (8 * i)));
}

int bytes_of(std::uint64_t value) {
  int n = 1;
  while (n < 8 && (value >> (8 * n)) != 0)
    ++n;
  return n;
}

/// BER length: one byte under 128, else the number of bytes and the bytes.
void put_length(Bytes& out, std::size_t length) {
  if (length < 128) {
    out.push_back(static_cast<std::uint8_t>(length));
    return;
  }
  const int n = bytes_of(length);
  out.push_back(static_cast<std::uint8_t>(0x80 | n));
  put_big(out, length, n);
}

void put_bytes(Bytes& out, View bytes) {
  out.insert(out.end(), bytes.begin(), bytes.end());
}

void put_head(Bytes& out, std::uint8_t tag, std::size_t length) {
  out.push_back(tag);
  put_length(out, length);
}

void put_item(Bytes& out, std::uint8_t tag, View value) {
  put_head(out, tag, value.size());
  put_bytes(out, value);
}

void put_text(Bytes& out, std::uint8_t tag, std::string_view text) {
  put_item(out, tag, {reinterpret_cast<const std::uint8_t*>(text.data()), text.size()});
}

/// An unsigned number in `bytes` bytes, or in as few as hold it when `bytes` is 0.
void put_number(Bytes& out, std::uint8_t tag, std::uint64_t value, int bytes = 0) {
  if (bytes == 0)
    bytes = bytes_of(value);
  out.push_back(tag);
  out.push_back(static_cast<std::uint8_t>(bytes));
  put_big(out, value, bytes);
}

void put_rectangle(Bytes& out, std::uint8_t tag, const Rectangle& r) {
  out.push_back(tag);
  out.push_back(16);
  for (const int v : {r.x, r.y, r.width, r.height})
    put_big(out, static_cast<std::uint32_t>(v), 4);
}

/// A run as ST 0903 packs it: length of the pair, length of the pixel number, pixel number from 1, BER run.
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

/// Run lengths of both targets in one pass; gives up when they cannot fit a unit.
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

/// ST 0903 counts 1..100; what is there is at least 1.
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

/// Differences of neighbouring columns, zigzag, seven bits a byte: steps of up to 63 rows take one byte.
void put_boundary(Bytes& out, std::span<const std::uint16_t> boundary) {
  std::int32_t last = 0;
  for (const std::uint16_t row : boundary) {
    const std::int32_t step = row - last;
    std::uint32_t zigzag =
        step >= 0 ? static_cast<std::uint32_t>(step) * 2 : static_cast<std::uint32_t>(-step) * 2 - 1;
    for (; zigzag >= 128; zigzag >>= 7)
      out.push_back(static_cast<std::uint8_t>(zigzag | 128));
    out.push_back(static_cast<std::uint8_t>(zigzag));
    last = row;
  }
}

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
bool read_number(View item, std::uint64_t& value) {
  if (item.empty() || item.size() > 8)
    return false;
  value = Cursor(item).big(item.size());
  return true;
}

bool read_rectangle(View item, Rectangle& r) {
  if (item.size() != 16)
    return false;
  Cursor in(item);
  for (int* v : {&r.x, &r.y, &r.width, &r.height}) {
    *v = static_cast<std::int32_t>(static_cast<std::uint32_t>(in.big(4)));
    if (*v < -65536 || *v > 65536)
      return false;
  }
  return true;
}

bool read_boundary(View item, int frame_height, std::vector<std::uint16_t>& boundary) {
  boundary.clear();
  std::int32_t row = 0;
  for (std::size_t i = 0; i < item.size();) {
    std::uint32_t zigzag = 0;
    for (int shift = 0;; shift += 7) {
      if (i == item.size() || shift > 14)
        return false;
      const std::uint8_t b = item[i++];
      zigzag |= (b & 127u) << shift;
      if (b < 128)
        break;
    }
    row +=
        (zigzag & 1) ? -static_cast<std::int32_t>((zigzag + 1) >> 1) : static_cast<std::int32_t>(zigzag >> 1);
    if (row < 0 || row > frame_height)
      return false;
    boundary.push_back(static_cast<std::uint16_t>(row));
  }
  return true;
}

bool inside(const Rectangle& r, int width, int height) {
  return r.x >= 0 && r.y >= 0 && r.width >= 0 && r.height >= 0 && r.x <= width - r.width &&
         r.y <= height - r.height;
}

bool begins_with(View bytes, const std::array<std::uint8_t, 16>& label) {
  return bytes.size() >= label.size() && std::equal(label.begin(), label.end(), bytes.begin());
}

} // namespace

// ---- encoder ---------------------------------------------------------------------------------------------

std::span<const std::uint8_t> KlvEncoder::encode(const Estimate& estimate, std::uint64_t time_us) {
  if (estimate.mask.empty())
    return {};
  GrayView mask = estimate.mask;
  std::span<const std::uint16_t> boundary = estimate.boundary;
  halvings_ = 0;
  while (std::int64_t{mask.width} * mask.height > klv_mask_limit || !write(estimate, mask, boundary, time_us))
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

/// Fills unit_; false when it would pass the limit.
bool KlvEncoder::write(const Estimate& e, const GrayView& mask, std::span<const std::uint16_t> boundary,
                       std::uint64_t time_us) {
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

  constexpr std::size_t sums = (2 + 4) + (2 + 2); // CRC-32 at the end of the private set, then the checksum
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
  return unit.size() <= klv_unit_limit;
}

/// The private Local Set without its checksum, into extra_.
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
  Bytes& part = traversable_; // its runs are in the unit by now
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
}

// ---- decoder ---------------------------------------------------------------------------------------------

KlvVerdict KlvUnit::refuse(KlvVerdict verdict, std::string why) {
  error_ = std::move(why);
  return verdict;
}

KlvVerdict KlvUnit::decode(std::span<const std::uint8_t> bytes) {
  error_.clear();
  estimate_ = {};
  boundary_.clear();
  runs_.clear();
  time_us_ = 0;
  sender_width_ = sender_height_ = 0;
  grid_width_ = grid_height_ = 0;
  targets_ = {};
  seen_targets_ = 0;

  // Sets of other makers may stand before ours.
  while (!begins_with(bytes, vmti_label)) {
    Cursor skip(bytes);
    const View label = skip.take(16);
    const std::size_t length = skip.length();
    if (!skip.ok() || label[0] != 0x06 || label[1] != 0x0e || label[2] != 0x2b || label[3] != 0x34)
      return refuse(KlvVerdict::damaged, "not KLV: no universal label where one must stand");
    const View whole = skip.take(length);
    if (!skip.ok())
      return refuse(KlvVerdict::damaged, "a KLV set is cut short");
    if (skip.done())
      return refuse(KlvVerdict::foreign, "KLV without a VMTI Local Set (MISB ST 0903)");
    bytes = bytes.subspan(static_cast<std::size_t>(whole.data() + whole.size() - bytes.data()));
  }

  Cursor in(bytes);
  in.take(vmti_label.size());
  const View set = in.item();
  if (!in.ok())
    return refuse(KlvVerdict::damaged, "the VMTI Local Set is cut short");
  bytes = bytes.first(static_cast<std::size_t>(set.data() + set.size() - bytes.data()));
  if (set.size() < 4 || set[set.size() - 4] != vmti_checksum || set[set.size() - 3] != 2 ||
      Cursor(bytes.last(2)).big(2) != checksum16(bytes.first(bytes.size() - 2)))
    return refuse(KlvVerdict::damaged, "the checksum of the VMTI Local Set does not match");

  View terrain;
  if (const KlvVerdict verdict = read_vmti(set.first(set.size() - 4), terrain); verdict != KlvVerdict::ok)
    return verdict;
  if (!begins_with(terrain, terrain_label))
    return refuse(KlvVerdict::foreign, "VMTI of another maker: it holds no Local Set of terrainseg");
  const auto checked = static_cast<std::size_t>(terrain.data() + terrain.size() - bytes.data()) - 4;
  if (terrain.size() < terrain_label.size() + 6 || terrain[terrain.size() - 6] != terrain_crc ||
      terrain[terrain.size() - 5] != 4 || Cursor(terrain.last(4)).big(4) != crc32(bytes.first(checked)))
    return refuse(KlvVerdict::damaged, "the checksum of terrainseg's Local Set does not match");
  if (const KlvVerdict verdict =
          read_terrain_set(terrain.subspan(terrain_label.size(), terrain.size() - terrain_label.size() - 6));
      verdict != KlvVerdict::ok)
    return verdict;
  if (const KlvVerdict verdict = read_targets(); verdict != KlvVerdict::ok)
    return verdict;
  const Estimate& e = estimate_;
  if (e.frame_width < 1 || e.frame_height < 1 || e.horizon_row >= e.frame_height ||
      !inside(e.mask_region, e.frame_width, e.frame_height) ||
      !inside(e.window, e.frame_width, e.frame_height))
    return refuse(KlvVerdict::damaged, "the horizon, the window or the mask lies outside the frame");
  if (!boundary_.empty() && boundary_.size() != static_cast<std::size_t>(e.mask.width))
    return refuse(KlvVerdict::damaged, "the boundary does not have one row for every mask column");
  estimate_.boundary = boundary_;
  return KlvVerdict::ok;
}

KlvVerdict KlvUnit::read_terrain_set(View set) {
  Cursor in(set);
  View boundary, models;
  std::uint64_t number = 0;
  bool good = true, versioned = false;
  while (good && in.ok() && !in.done()) {
    const std::uint32_t tag = in.tag();
    const View item = in.item();
    if (!in.ok())
      break;
    const bool fixed = read_number(item, number);
    const auto sized = [&](std::size_t size) { return fixed && item.size() == size; };
    switch (tag) {
    case terrain_version:
      if (!sized(1))
        return refuse(KlvVerdict::damaged, "terrainseg's Local Set has no readable version");
      if (number != terrain_set_version)
        return refuse(KlvVerdict::foreign, "terrainseg's Local Set has version " + std::to_string(number) +
                                               ", this one reads version " +
                                               std::to_string(terrain_set_version) + ": update terrainseg");
      versioned = true;
      break;
    case terrain_frame:
      good = sized(8);
      estimate_.frame = number;
      break;
    case terrain_frame_size:
      good = sized(4) && number >> 16 <= 32767 && (number & 0xffff) <= 32767;
      estimate_.frame_width = static_cast<int>(number >> 16 & 0xffff);
      estimate_.frame_height = static_cast<int>(number & 0xffff);
      break;
    case terrain_region:
      good = read_rectangle(item, estimate_.mask_region);
      break;
    case terrain_sent_mask:
      good = sized(4);
      sender_width_ = static_cast<int>(number >> 16 & 0xffff);
      sender_height_ = static_cast<int>(number & 0xffff);
      break;
    case terrain_horizon: {
      const auto row = static_cast<std::int32_t>(static_cast<std::uint32_t>(number >> 8));
      good = sized(5) && row >= -1 && row <= 65535;
      estimate_.horizon_row = row;
      estimate_.horizon_confidence = static_cast<std::uint8_t>(number);
      break;
    }
    case terrain_confidence:
      good = sized(1);
      estimate_.confidence = static_cast<std::uint8_t>(number);
      break;
    case terrain_permille:
      good = sized(2) && number <= 1000;
      estimate_.traversable_permille = static_cast<int>(number & 0xffff);
      break;
    case terrain_window:
      good = read_rectangle(item, estimate_.window);
      break;
    case terrain_generation:
      good = sized(4);
      estimate_.model_generation = static_cast<std::uint32_t>(number);
      break;
    case terrain_flags:
      good = sized(4);
      estimate_.flags = static_cast<std::uint32_t>(number);
      break;
    case terrain_boundary:
      boundary = item;
      break;
    case terrain_models:
      models = item;
      break;
    default: // added by a later writer of the same version
      break;
    }
    if (!good)
      return refuse(KlvVerdict::damaged, "tag " + std::to_string(tag) +
                                             " of terrainseg's Local Set has a size or value it cannot have");
  }
  if (!in.ok())
    return refuse(KlvVerdict::damaged, "an item of terrainseg's Local Set is cut short");
  if (!versioned)
    return refuse(KlvVerdict::damaged, "terrainseg's Local Set has no version");
  // The range of the rows is known only now.
  if (!read_boundary(boundary, estimate_.frame_height, boundary_))
    return refuse(KlvVerdict::damaged, "the boundary holds rows outside the frame");
  if (models.size() % model_size != 0 || models.size() / model_size > max_models)
    return refuse(KlvVerdict::damaged, "the models have a size they cannot have");
  Cursor list(models);
  for (; !list.done(); ++estimate_.model_count) {
    ModelSummary& model = estimate_.models[static_cast<std::size_t>(estimate_.model_count)];
    for (std::uint16_t& mean : model.mean)
      mean = static_cast<std::uint16_t>(list.big(2));
    for (std::uint32_t& variance : model.variance)
      variance = static_cast<std::uint32_t>(list.big(4));
    model.mass = list.big(8);
    for (std::uint8_t& component : model.rgb)
      component = list.byte();
  }
  return KlvVerdict::ok;
}

/// The items of the VMTI Local Set; what is read of them is judged only when the unit is known as ours.
KlvVerdict KlvUnit::read_vmti(View set, View& terrain) {
  Cursor in(set);
  while (in.ok() && !in.done()) {
    const std::uint32_t tag = in.tag();
    const View item = in.item();
    if (tag == vmti_time)
      read_number(item, time_us_);
    else if (tag == vmti_width)
      read_number(item, grid_width_);
    else if (tag == vmti_height)
      read_number(item, grid_height_);
    else if (tag == vmti_target_series)
      targets_ = item;
    else if (tag == vmti_terrain)
      terrain = item;
  }
  return in.ok() ? KlvVerdict::ok : refuse(KlvVerdict::damaged, "an item of the VMTI Local Set is cut short");
}

KlvVerdict KlvUnit::read_targets() {
  const std::uint64_t width = grid_width_, height = grid_height_;
  if (width < 1 || height < 1 || width > 65535 || height > 65535 ||
      static_cast<std::int64_t>(width * height) > klv_mask_limit)
    return refuse(KlvVerdict::damaged,
                  "a mask of " + std::to_string(width) + "x" + std::to_string(height) + " pixels cannot be");
  estimate_.mask = {{}, static_cast<int>(width), static_cast<int>(height)};
  Cursor packs(targets_);
  while (packs.ok() && !packs.done()) {
    const View pack = packs.item();
    if (!packs.ok())
      break;
    if (const KlvVerdict verdict = read_target(pack); verdict != KlvVerdict::ok)
      return verdict;
  }
  if (!packs.ok())
    return refuse(KlvVerdict::damaged, "a VTarget Pack is cut short");
  return KlvVerdict::ok;
}

KlvVerdict KlvUnit::read_target(View pack) {
  Cursor in(pack);
  const std::uint32_t id = in.tag();
  if (id != id_traversable && id != id_doubtful)
    return in.ok() ? KlvVerdict::ok : refuse(KlvVerdict::damaged, "a VTarget Pack is empty");
  if (seen_targets_ & (1u << id))
    return refuse(KlvVerdict::damaged, "target " + std::to_string(id) + " comes twice");
  seen_targets_ |= 1u << id;
  while (in.ok() && !in.done()) {
    const std::uint32_t tag = in.tag();
    const View item = in.item();
    if (tag != target_mask || !in.ok())
      continue;
    Cursor mask(item);
    while (mask.ok() && !mask.done()) {
      const std::uint32_t kind = mask.tag();
      const View series = mask.item();
      if (kind != mask_runs || !mask.ok())
        continue;
      const std::uint8_t value = id == id_traversable ? mask_traversable : mask_doubtful;
      if (const KlvVerdict verdict = read_runs(series, value); verdict != KlvVerdict::ok)
        return verdict;
    }
    if (!mask.ok())
      return refuse(KlvVerdict::damaged, "a VMask Local Set is cut short");
  }
  return in.ok() ? KlvVerdict::ok : refuse(KlvVerdict::damaged, "an item of a VTarget Pack is cut short");
}

KlvVerdict KlvUnit::read_runs(View series, std::uint8_t value) {
  const std::uint64_t pixels =
      static_cast<std::uint64_t>(estimate_.mask.width) * static_cast<std::uint64_t>(estimate_.mask.height);
  std::uint64_t next = 0;
  Cursor in(series);
  while (in.ok() && !in.done()) {
    Cursor pair(in.item());
    const std::size_t size = pair.length();
    const std::uint64_t number = size <= 6 ? pair.big(size) : 0;
    const std::uint64_t run = pair.length();
    if (!in.ok() || !pair.ok() || !pair.done())
      return refuse(KlvVerdict::damaged, "a run of the mask is cut short");
    // Rising order bounds the work of drawing by the size of the mask.
    if (number < 1 || run < 1 || number - 1 < next || run > pixels || number - 1 > pixels - run)
      return refuse(KlvVerdict::damaged, "a run of the mask lies outside it or goes back");
    next = number - 1 + run;
    runs_.push_back({static_cast<std::uint32_t>(number - 1), static_cast<std::uint32_t>(run), value});
  }
  return KlvVerdict::ok;
}

void KlvUnit::draw_mask(const MutablePlane& target) const {
  const auto width = static_cast<std::uint32_t>(estimate_.mask.width);
  for (int y = 0; y < estimate_.mask.height; ++y)
    std::memset(target.row(y), mask_not_traversable, width);
  for (const Run& run : runs_) {
    std::uint32_t y = run.start / width, x = run.start % width, left = run.length;
    while (left > 0) {
      const std::uint32_t n = std::min(left, width - x);
      std::memset(target.row(static_cast<int>(y)) + x, run.value, n);
      left -= n;
      x = 0;
      ++y;
    }
  }
}

} // namespace terrainseg
