// SPDX-License-Identifier: LGPL-2.1-or-later
#include <algorithm>
#include <cstring>
#include <type_traits>
#include <utility>

#include "exchange/vmti_codec.hpp"
#include "exchange/vmti_klv.hpp"

namespace terrainseg {

using namespace vmti;

namespace {

/// A number that takes the whole item, at most 8 bytes.
bool read_number(View item, std::uint64_t& value) {
  if (item.empty() || item.size() > 8)
    return false;
  value = Cursor(item).big(item.size());
  return true;
}

/// Reads what the encoder writes. False if it is truncated or has rows outside 0..65535.
bool read_boundary(View item, std::vector<std::uint16_t>& boundary) {
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
    if (row < 0 || row > 65535)
      return false;
    boundary.push_back(static_cast<std::uint16_t>(row));
  }
  return true;
}

/// Why a unit is refused. decode() catches it.
struct Refusal {
  KlvVerdict verdict;
  std::string why;
};

[[noreturn]] void damaged(std::string why) {
  throw Refusal{KlvVerdict::damaged, std::move(why)};
}

/// Calls take(tag, item) for each item of a set. `what` is the name of an item in messages.
template <class Take> void each_item_of(View set, const char* what, Take take) {
  Cursor in(set);
  while (!in.done()) {
    const std::uint32_t tag = in.tag();
    const View item = in.item();
    if (!in.ok())
      damaged(std::string(what) + " is cut short");
    take(tag, item);
  }
}

/// Whether the last item of a VMTI or UAS Datalink Local Set is a checksum, as required.
bool has_checksum(View set) {
  static_assert(int{vmti_checksum} == int{uas_checksum});
  return set.size() >= checksum_size && set[set.size() - 4] == vmti_checksum && set[set.size() - 3] == 2;
}

/// Checks size and checksum of the outermost set.
void check_frame(View unit, View set, const char* name) {
  if (unit.size() > klv_unit_limit)
    damaged("a unit of " + std::to_string(unit.size()) + " bytes is larger than the " +
            std::to_string(klv_unit_limit) + " that one may have");
  if (!has_checksum(set) || Cursor(unit.last(2)).big(2) != checksum16(unit.first(unit.size() - 2)))
    damaged(std::string("the checksum of the ") + name + " Local Set does not match");
}

/// Whether a UAS Datalink Local Set has an item with a VMTI Local Set.
bool holds_vmti(View set) {
  Cursor in(set);
  while (!in.done()) {
    const std::uint32_t tag = in.tag();
    in.item();
    if (in.ok() && tag == uas_vmti)
      return true;
  }
  return false;
}

/// Reads an item of the private Local Set that consists of numbers. Returns false if its size or value is
/// invalid; unknown tags, from a later writer of the same version, are valid.
bool read_terrain_item(std::uint32_t tag, View item, Estimate& estimate) {
  bool good = true;
  Cursor in(item);
  const auto read_one = [&](auto& number) {
    const std::uint64_t value = in.big(static_cast<std::size_t>(number.bytes));
    number.field = static_cast<std::remove_reference_t<decltype(number.field)>>(value);
    const auto read = static_cast<std::int64_t>(number.field);
    good = good && (number.bytes == 8 || (read >= number.least && read <= number.most));
  };
  const auto read_numbers = [&](std::uint8_t its_tag, auto... numbers) {
    if (tag != its_tag)
      return;
    (read_one(numbers), ...);
    good = good && in.ok() && in.done();
  };
  each_item(estimate, read_numbers);
  motion_item(estimate, read_numbers);
  return good;
}

/// Reads the list of learned models. Returns false if its size is not that of 0 to max_models models.
bool read_models(View models, Estimate& estimate) {
  if (models.size() % model_size != 0 || models.size() / model_size > max_models)
    return false;
  Cursor list(models);
  for (; !list.done(); ++estimate.model_count) {
    each_number(estimate.models[static_cast<std::size_t>(estimate.model_count)], [&](auto& number) {
      number = static_cast<std::remove_reference_t<decltype(number)>>(list.big(sizeof number));
    });
  }
  return true;
}

} // namespace

KlvVerdict KlvUnit::decode(View bytes) {
  error_.clear();
  estimate_ = {};
  boundary_.clear();
  runs_.clear();
  time_us_ = 0;
  try {
    read(bytes);
  } catch (const Refusal& refusal) {
    error_ = refusal.why;
    return refusal.verdict;
  }
  return KlvVerdict::ok;
}

void KlvUnit::read(View bytes) {
  // Skips sets of other programs in front of the VMTI set.
  while (!begins_with(bytes, vmti_label)) {
    Cursor in(bytes);
    const View label = in.take(16);
    const std::size_t length = in.length();
    if (!in.ok() || label[0] != 0x06 || label[1] != 0x0e || label[2] != 0x2b || label[3] != 0x34)
      damaged("not KLV: a universal label is missing");
    const View set = in.take(length);
    if (!in.ok())
      damaged("a KLV set is cut short");
    const View unit = bytes.first(bytes.size() - in.left());
    const bool uas = begins_with(label, uas_label);
    if (uas && holds_vmti(set))
      return read_nested(unit, set);
    if (in.done() && uas && has_checksum(set))
      check_frame(unit, set, "UAS Datalink");
    if (in.done())
      throw Refusal{KlvVerdict::foreign, "KLV without a VMTI Local Set (MISB ST 0903)"};
    bytes = bytes.subspan(unit.size());
  }
  Cursor in(bytes.subspan(vmti_label.size()));
  const View set = in.item();
  if (!in.ok())
    damaged("the VMTI Local Set is cut short");
  const View unit = bytes.first(bytes.size() - in.left());
  check_frame(unit, set, "VMTI");
  read_vmti(unit.first(unit.size() - set.size()), set.first(set.size() - checksum_size));
}

/// Reads the VMTI Local Set (without label, length and checksum) in the UAS Datalink Local Set `set`.
void KlvUnit::read_nested(View unit, View set) {
  check_frame(unit, set, "UAS Datalink");
  View vmti;
  each_item_of(set, "an item of the UAS Datalink Local Set", [&](std::uint32_t tag, View item) {
    if (tag == uas_time)
      read_number(item, time_us_);
    if (tag == uas_vmti && vmti.data())
      damaged("the UAS Datalink Local Set has more than one VMTI Local Set");
    if (tag == uas_vmti)
      vmti = item;
  });
  head_.assign(vmti_label.begin(), vmti_label.end());
  put_length(head_, vmti.size() + checksum_size);
  read_vmti(head_, vmti);
}

/// Reads a VMTI Local Set without its checksum. `head` is label and length as in a set that is not nested.
void KlvUnit::read_vmti(View head, View set) {
  View terrain, targets;
  std::uint64_t width = 0, height = 0;
  // The values are checked when the unit is known to be from terrainseg.
  each_item_of(set, "an item of the VMTI Local Set", [&](std::uint32_t tag, View item) {
    if (tag == vmti_time)
      read_number(item, time_us_);
    else if (tag == vmti_width)
      read_number(item, width);
    else if (tag == vmti_height)
      read_number(item, height);
    else if (tag == vmti_target_series)
      targets = item;
    else if (tag == vmti_terrain)
      terrain = item;
  });
  if (!begins_with(terrain, terrain_label))
    throw Refusal{KlvVerdict::foreign, "VMTI of another maker: it holds no Local Set of terrainseg"};
  constexpr std::size_t crc_size = 2 + 4;
  const auto checked = static_cast<std::size_t>(terrain.data() + terrain.size() - set.data()) - 4;
  const View fields = terrain.subspan(terrain_label.size());
  if (fields.size() < crc_size || fields[fields.size() - 6] != terrain_crc ||
      fields[fields.size() - 5] != 4 ||
      Cursor(fields.last(4)).big(4) != crc32(set.first(checked), crc32(head)))
    damaged("the checksum of terrainseg's Local Set does not match");
  read_terrain_set(fields.first(fields.size() - crc_size));
  read_targets(targets, width, height);
  estimate_.boundary = boundary_;
  if (const char* flaw = flaw_of(estimate_))
    damaged(flaw);
}

void KlvUnit::read_terrain_set(View set) {
  View boundary, models;
  bool versioned = false;
  each_item_of(set, "an item of terrainseg's Local Set", [&](std::uint32_t tag, View item) {
    if (tag == terrain_version) {
      std::uint64_t version = 0;
      if (item.size() != 1 || !read_number(item, version))
        damaged("terrainseg's Local Set has no readable version");
      if (version != terrain_set_version)
        throw Refusal{KlvVerdict::foreign, "terrainseg's Local Set has version " + std::to_string(version) +
                                               ", this one reads version " +
                                               std::to_string(terrain_set_version) + ": update terrainseg"};
      versioned = true;
    } else if (tag == terrain_boundary) {
      boundary = item;
    } else if (tag == terrain_models) {
      models = item;
    } else if (!read_terrain_item(tag, item, estimate_)) {
      damaged("tag " + std::to_string(tag) + " of terrainseg's Local Set has a size or value it cannot have");
    }
  });
  if (!versioned)
    damaged("terrainseg's Local Set has no version");
  if (!read_boundary(boundary, boundary_))
    damaged("the boundary is cut short or has invalid rows");
  if (!read_models(models, estimate_))
    damaged("the models have a size they cannot have");
}

void KlvUnit::read_targets(View series, std::uint64_t width, std::uint64_t height) {
  const std::string size = std::to_string(width) + "x" + std::to_string(height);
  if (width < 1 || height < 1 || width > longest_picture_side || height > longest_picture_side ||
      static_cast<std::int64_t>(width * height) > klv_mask_limit)
    damaged("a mask of " + size + " pixels is invalid");
  estimate_.mask = {{}, static_cast<int>(width), static_cast<int>(height)};
  if (estimate_.mask.width > estimate_.frame_width || estimate_.mask.height > estimate_.frame_height)
    damaged("a mask of " + size + " is larger than its frame of " + std::to_string(estimate_.frame_width) +
            "x" + std::to_string(estimate_.frame_height));
  std::uint32_t seen_targets = 0; // a bit per target
  Cursor packs(series);
  while (!packs.done()) {
    const View pack = packs.item();
    if (!packs.ok())
      damaged("a VTarget Pack is cut short");
    Cursor in(pack);
    const std::uint32_t id = in.tag();
    if (!in.ok())
      damaged("a VTarget Pack is empty");
    if (id != id_traversable && id != id_doubtful)
      continue;
    const std::string target = "target " + std::to_string(id);
    if (seen_targets & (1u << id))
      damaged(target + " comes twice");
    seen_targets |= 1u << id;
    read_mask(in.take(in.left()), target, id == id_traversable ? mask_traversable : mask_doubtful);
  }
}

void KlvUnit::read_mask(View pack, const std::string& target, std::uint8_t value) {
  // One mask per target and one series per mask: only within a series are runs in rising order, which makes
  // the work linear in the sizes of the unit and the mask.
  bool seen_mask = false, seen_series = false;
  each_item_of(pack, "an item of a VTarget Pack", [&](std::uint32_t tag, View mask) {
    if (tag != target_mask)
      return;
    if (std::exchange(seen_mask, true))
      damaged(target + " has more than one mask");
    each_item_of(mask, "a VMask Local Set", [&](std::uint32_t kind, View series) {
      if (kind != mask_runs)
        return;
      if (std::exchange(seen_series, true))
        damaged("the mask of " + target + " has more than one series of runs");
      read_runs(series, value);
    });
  });
}

void KlvUnit::read_runs(View series, std::uint8_t value) {
  const std::uint64_t pixels =
      static_cast<std::uint64_t>(estimate_.mask.width) * static_cast<std::uint64_t>(estimate_.mask.height);
  std::uint64_t next = 0;
  Cursor in(series);
  while (!in.done()) {
    Cursor pair(in.item());
    const std::size_t size = pair.length();
    const std::uint64_t number = size <= 6 ? pair.big(size) : 0;
    const std::uint64_t run = pair.length();
    if (!in.ok() || !pair.ok() || !pair.done())
      damaged("a run of the mask is cut short");
    // Rising order limits the drawing work to the size of the mask.
    if (number < 1 || run < 1 || number - 1 < next || run > pixels || number - 1 > pixels - run)
      damaged("a run of the mask lies outside it or goes back");
    next = number - 1 + run;
    runs_.push_back({static_cast<std::uint32_t>(number - 1), static_cast<std::uint32_t>(run), value});
  }
}

std::uint64_t KlvUnit::pixels_to_draw() const {
  std::uint64_t pixels =
      static_cast<std::uint64_t>(estimate_.mask.width) * static_cast<std::uint64_t>(estimate_.mask.height);
  for (const Run& run : runs_)
    pixels += run.length;
  return pixels;
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
