// SPDX-License-Identifier: LGPL-2.1-or-later
#include "support/unit_store.hpp"

#include <algorithm>
#include <cstdlib>
#include <iterator>
#include <utility>

namespace terrainseg {

std::uint64_t UnitStore::add(Time time, OwnedBuffer unit, Time progress) {
  constexpr Time longest_reordering = GST_SECOND;
  std::uint64_t dropped = 0;
  if (progress_ != never && progress < progress_ - longest_reordering) {
    dropped = units_.size();
    clear();
  }
  const std::size_t size = gst_buffer_get_size(unit.get());
  units_.emplace(time, std::move(unit));
  bytes_ += size;
  advance(progress);
  return dropped;
}

OwnedBuffer UnitStore::take(Time time, Time tolerance) {
  const auto after = units_.lower_bound(time);
  auto best = units_.end();
  if (after != units_.end())
    best = after;
  if (after != units_.begin()) {
    const auto before = std::prev(after);
    if (best == units_.end() || time - before->first <= best->first - time)
      best = before;
  }
  if (best == units_.end() || std::abs(best->first - time) > tolerance)
    return nullptr;
  OwnedBuffer unit = std::move(best->second);
  count_out(unit);
  units_.erase(best);
  return unit;
}

std::uint64_t UnitStore::drop_before(Time time) {
  const auto end = units_.lower_bound(time);
  const auto count = std::distance(units_.begin(), end);
  for (auto unit = units_.begin(); unit != end; ++unit)
    count_out(unit->second);
  units_.erase(units_.begin(), end);
  return static_cast<std::uint64_t>(count);
}

std::uint64_t UnitStore::drop_oldest() {
  if (units_.empty())
    return 0;
  count_out(units_.begin()->second);
  units_.erase(units_.begin());
  return 1;
}

void UnitStore::clear() {
  units_.clear();
  bytes_ = 0;
  progress_ = never;
}

} // namespace terrainseg
