// SPDX-License-Identifier: LGPL-2.1-or-later
#include "unit_store.hpp"

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
  units_.emplace(time, std::move(unit));
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
  units_.erase(best);
  return unit;
}

std::uint64_t UnitStore::drop_before(Time time) {
  const auto end = units_.lower_bound(time);
  const auto count = std::distance(units_.begin(), end);
  units_.erase(units_.begin(), end);
  return static_cast<std::uint64_t>(count);
}

std::uint64_t UnitStore::drop_oldest() {
  if (units_.empty())
    return 0;
  units_.erase(units_.begin());
  return 1;
}

void UnitStore::clear() {
  units_.clear();
  progress_ = never;
}

} // namespace terrainseg
