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

/// Whether the last item of a VMTI or UAS Datalink Local Set is a checksum, as required.
bool has_checksum(View set) {
  static_assert(int{vmti_checksum} == int{uas_checksum});
  return set.size() >= checksum_size && set[set.size() - 4] == vmti_checksum && set[set.size() - 3] == 2;
}

/// Whether a UAS Datalink Local Set has an item with a VMTI Local Set.
bool holds_vmti(View set) {
  Cursor in(set);
  while (in.ok() && !in.done()) {
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

bool KlvUnit::refuse(KlvVerdict verdict, std::string why) {
  verdict_ = verdict;
  error_ = std::move(why);
  return false;
}

bool KlvUnit::damaged(std::string why) {
  return refuse(KlvVerdict::damaged, std::move(why));
}

/// Calls take(tag, item) for each item of a set, until it returns false. `what` is the name in messages.
template <class Take> bool KlvUnit::each_item_of(View set, const char* what, Take take) {
  Cursor in(set);
  while (in.ok() && !in.done()) {
    const std::uint32_t tag = in.tag();
    const View item = in.item();
    if (in.ok() && !take(tag, item))
      return false;
  }
  return in.ok() || damaged(std::string(what) + " is cut short");
}

KlvVerdict KlvUnit::decode(std::span<const std::uint8_t> bytes) {
  verdict_ = KlvVerdict::ok;
  error_.clear();
  estimate_ = {};
  boundary_.clear();
  runs_.clear();
  time_us_ = 0;
  grid_width_ = grid_height_ = 0;
  targets_ = {};
  seen_targets_ = seen_masks_ = 0;
  read(bytes);
  return verdict_;
}

bool KlvUnit::read(View bytes) {
  // Skips sets of other programs in front of the VMTI set.
  while (!begins_with(bytes, vmti_label)) {
    Cursor in(bytes);
    const View label = in.take(16);
    const std::size_t length = in.length();
    if (!in.ok() || label[0] != 0x06 || label[1] != 0x0e || label[2] != 0x2b || label[3] != 0x34)
      return damaged("not KLV: a universal label is missing");
    const View set = in.take(length);
    if (!in.ok())
      return damaged("a KLV set is cut short");
    const auto size = static_cast<std::size_t>(set.data() + set.size() - bytes.data());
    if (begins_with(label, uas_label) && holds_vmti(set))
      return read_nested(bytes.first(size), set);
    if (in.done() && begins_with(label, uas_label) && has_checksum(set) &&
        !check_frame(bytes, set, "UAS Datalink"))
      return false;
    if (in.done())
      return refuse(KlvVerdict::foreign, "KLV without a VMTI Local Set (MISB ST 0903)");
    bytes = bytes.subspan(size);
  }
  return read_alone(bytes);
}

/// Reads a VMTI Local Set at the beginning of `bytes`.
bool KlvUnit::read_alone(View bytes) {
  Cursor in(bytes);
  in.take(vmti_label.size());
  const View set = in.item();
  if (!in.ok())
    return damaged("the VMTI Local Set is cut short");
  const auto head = static_cast<std::size_t>(set.data() - bytes.data());
  const View unit = bytes.first(head + set.size());
  return check_frame(unit, set, "VMTI") &&
         read_items(unit.first(head), set.first(set.size() - checksum_size));
}

/// Reads the VMTI Local Set (without label, length and checksum) in the UAS Datalink Local Set `set`.
bool KlvUnit::read_nested(View unit, View set) {
  View vmti;
  const auto take = [&](std::uint32_t tag, View item) {
    if (tag == uas_time)
      read_number(item, time_us_);
    if (tag == uas_vmti && vmti.data())
      return damaged("the UAS Datalink Local Set has more than one VMTI Local Set");
    if (tag == uas_vmti)
      vmti = item;
    return true;
  };
  if (!check_frame(unit, set, "UAS Datalink") ||
      !each_item_of(set, "an item of the UAS Datalink Local Set", take))
    return false;
  head_.assign(vmti_label.begin(), vmti_label.end());
  put_length(head_, vmti.size() + checksum_size);
  return read_items(head_, vmti);
}

/// Checks size and checksum of the outermost set.
bool KlvUnit::check_frame(View unit, View set, const char* name) {
  if (unit.size() > klv_unit_limit)
    return damaged("a unit of " + std::to_string(unit.size()) + " bytes is larger than the " +
                   std::to_string(klv_unit_limit) + " that one may have");
  if (!has_checksum(set) || Cursor(unit.last(2)).big(2) != checksum16(unit.first(unit.size() - 2)))
    return damaged(std::string("the checksum of the ") + name + " Local Set does not match");
  return true;
}

/// Reads the items of a VMTI Local Set without its checksum. `head` is label and length as in a set that is
/// not nested.
bool KlvUnit::read_items(View head, View set) {
  View terrain;
  if (!read_vmti(set, terrain))
    return false;
  if (!begins_with(terrain, terrain_label))
    return refuse(KlvVerdict::foreign, "VMTI of another maker: it holds no Local Set of terrainseg");
  const auto checked = static_cast<std::size_t>(terrain.data() + terrain.size() - set.data()) - 4;
  if (terrain.size() < terrain_label.size() + 6 || terrain[terrain.size() - 6] != terrain_crc ||
      terrain[terrain.size() - 5] != 4 ||
      Cursor(terrain.last(4)).big(4) != crc32(set.first(checked), crc32(head)))
    return damaged("the checksum of terrainseg's Local Set does not match");
  if (!read_terrain_set(terrain.subspan(terrain_label.size(), terrain.size() - terrain_label.size() - 6)) ||
      !read_targets())
    return false;
  estimate_.boundary = boundary_;
  const char* flaw = flaw_of(estimate_);
  return !flaw || damaged(flaw);
}

bool KlvUnit::read_terrain_set(View set) {
  View boundary, models;
  bool versioned = false;
  const auto take = [&](std::uint32_t tag, View item) {
    if (tag == terrain_version) {
      std::uint64_t version = 0;
      if (item.size() != 1 || !read_number(item, version))
        return damaged("terrainseg's Local Set has no readable version");
      if (version != terrain_set_version)
        return refuse(KlvVerdict::foreign, "terrainseg's Local Set has version " + std::to_string(version) +
                                               ", this one reads version " +
                                               std::to_string(terrain_set_version) + ": update terrainseg");
      versioned = true;
    } else if (tag == terrain_boundary) {
      boundary = item;
    } else if (tag == terrain_models) {
      models = item;
    } else if (!read_terrain_item(tag, item, estimate_)) {
      return damaged("tag " + std::to_string(tag) +
                     " of terrainseg's Local Set has a size or value it cannot have");
    }
    return true;
  };
  if (!each_item_of(set, "an item of terrainseg's Local Set", take))
    return false;
  if (!versioned)
    return damaged("terrainseg's Local Set has no version");
  if (!read_boundary(boundary, boundary_))
    return damaged("the boundary is cut short or has invalid rows");
  return read_models(models, estimate_) || damaged("the models have a size they cannot have");
}

/// Reads the items of the VMTI Local Set. The values are checked later, when the unit is known to be from
/// terrainseg.
bool KlvUnit::read_vmti(View set, View& terrain) {
  return each_item_of(set, "an item of the VMTI Local Set", [&](std::uint32_t tag, View item) {
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
    return true;
  });
}

bool KlvUnit::read_targets() {
  const std::uint64_t width = grid_width_, height = grid_height_;
  const std::string size = std::to_string(width) + "x" + std::to_string(height);
  if (width < 1 || height < 1 || width > longest_picture_side || height > longest_picture_side ||
      static_cast<std::int64_t>(width * height) > klv_mask_limit)
    return damaged("a mask of " + size + " pixels is invalid");
  estimate_.mask = {{}, static_cast<int>(width), static_cast<int>(height)};
  if (estimate_.mask.width > estimate_.frame_width || estimate_.mask.height > estimate_.frame_height)
    return damaged("a mask of " + size + " is larger than its frame of " +
                   std::to_string(estimate_.frame_width) + "x" + std::to_string(estimate_.frame_height));
  Cursor packs(targets_);
  while (packs.ok() && !packs.done()) {
    const View pack = packs.item();
    if (packs.ok() && !read_target(pack))
      return false;
  }
  return packs.ok() || damaged("a VTarget Pack is cut short");
}

bool KlvUnit::read_target(View pack) {
  Cursor in(pack);
  const std::uint32_t id = in.tag();
  if (id != id_traversable && id != id_doubtful)
    return in.ok() || damaged("a VTarget Pack is empty");
  const std::string target = "target " + std::to_string(id);
  if (seen_targets_ & (1u << id))
    return damaged(target + " comes twice");
  seen_targets_ |= 1u << id;
  // One mask per target and one series per mask: only within a series are runs in rising order, which makes
  // the work linear in the sizes of the unit and the mask.
  bool seen_series = false;
  const auto take_series = [&](std::uint32_t kind, View series) {
    if (kind != mask_runs)
      return true;
    if (std::exchange(seen_series, true))
      return damaged("the mask of " + target + " has more than one series of runs");
    return read_runs(series, id == id_traversable ? mask_traversable : mask_doubtful);
  };
  return each_item_of(in.take(in.left()), "an item of a VTarget Pack", [&](std::uint32_t tag, View item) {
    if (tag != target_mask)
      return true;
    if (seen_masks_ & (1u << id))
      return damaged(target + " has more than one mask");
    seen_masks_ |= 1u << id;
    return each_item_of(item, "a VMask Local Set", take_series);
  });
}

bool KlvUnit::read_runs(View series, std::uint8_t value) {
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
      return damaged("a run of the mask is cut short");
    // Rising order limits the drawing work to the size of the mask.
    if (number < 1 || run < 1 || number - 1 < next || run > pixels || number - 1 > pixels - run)
      return damaged("a run of the mask lies outside it or goes back");
    next = number - 1 + run;
    runs_.push_back({static_cast<std::uint32_t>(number - 1), static_cast<std::uint32_t>(run), value});
  }
  return true;
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
