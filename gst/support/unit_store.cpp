// SPDX-License-Identifier: LGPL-2.1-or-later
#include "support/unit_store.hpp"

#include <algorithm>
#include <cstdlib>
#include <iterator>
#include <utility>

namespace terrainseg {
namespace {

/// Units are never reordered further.
constexpr Time longest_reordering = GST_SECOND;
constexpr PrecisionTime longest_precise_reordering = longest_reordering / GST_USECOND;

/// `time` lies before `now` by more than a reordering.
bool is_anew(PrecisionTime time, PrecisionTime now) {
  return now > time && now - time > longest_precise_reordering;
}

} // namespace

std::uint64_t UnitStore::add(const UnitPlace& place, OwnedBuffer buffer, bool stamped) {
  const bool anew = progress_ != never && place.progress < progress_ - longest_reordering;
  const bool precisely_anew = precision_progress_ && is_anew(place.precision_progress, *precision_progress_);
  std::uint64_t dropped = 0;
  if (stamped ? precisely_anew : anew) {
    dropped = units_.size();
    clear();
  } else if (precisely_anew) {
    precise_.clear();
    precision_progress_.reset();
  }
  const std::size_t size = gst_buffer_get_size(buffer.get());
  const Key key = {place.precision, arrived_++};
  const auto unit = units_.emplace(place.time, Unit{std::move(buffer), key});
  precise_.emplace(key, unit);
  bytes_ += size;
  progress_ = std::max(progress_, place.progress);
  precision_progress_ = std::max(precision_progress_.value_or(0), place.precision_progress);
  return dropped;
}

OwnedBuffer UnitStore::remove(Units::iterator unit) {
  OwnedBuffer buffer = std::move(unit->second.buffer);
  bytes_ -= gst_buffer_get_size(buffer.get());
  precise_.erase(unit->second.key);
  units_.erase(unit);
  return buffer;
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
  return remove(best);
}

OwnedBuffer UnitStore::take_precise(PrecisionTime time) {
  const auto first = precise_.lower_bound({time, 0});
  return first != precise_.end() && first->first.first == time ? remove(first->second) : nullptr;
}

std::uint64_t UnitStore::restart_precisely(PrecisionTime time) {
  if (!precision_progress_ || !is_anew(time, *precision_progress_))
    return 0;
  const std::uint64_t dropped = units_.size();
  clear();
  return dropped;
}

std::uint64_t UnitStore::drop_before(Time time) {
  std::uint64_t count = 0;
  for (; !units_.empty() && units_.begin()->first < time; ++count)
    remove(units_.begin());
  return count;
}

std::uint64_t UnitStore::drop_before_precisely(PrecisionTime time) {
  std::uint64_t count = 0;
  for (; !precise_.empty() && precise_.begin()->first.first < time; ++count)
    remove(precise_.begin()->second);
  return count;
}

std::uint64_t UnitStore::drop_oldest() {
  if (units_.empty())
    return 0;
  remove(units_.begin());
  return 1;
}

void UnitStore::clear() {
  precise_.clear();
  units_.clear();
  bytes_ = 0;
  progress_ = gaps_ = never;
  precision_progress_.reset();
}

} // namespace terrainseg
