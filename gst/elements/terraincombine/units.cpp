// SPDX-License-Identifier: LGPL-2.1-or-later
#include "elements/terraincombine/units.hpp"

#include <cstdlib>
#include <iterator>
#include <utility>

namespace terrainseg {
namespace {

/// Units are never reordered further.
constexpr Time longest_reordering = GST_SECOND;
constexpr PrecisionTime longest_precise_reordering = longest_reordering / GST_USECOND;

/// Where nothing tells the frame rate: 30 frames a second.
constexpr Time default_duration = GST_SECOND / 30;

/// base + steps * step, or never when that lies beyond what times are.
Time placed_at(Time base, std::uint64_t steps, Time step) {
  const auto room = static_cast<std::uint64_t>(most_time - std::max<Time>(base, 0));
  return steps > room / static_cast<std::uint64_t>(step) ? never : base + static_cast<Time>(steps) * step;
}

} // namespace

bool is_anew(PrecisionTime time, PrecisionTime now) {
  return now > time && now - time > longest_precise_reordering;
}

std::uint64_t UnitStore::add(const UnitPlace& place, OwnedBuffer buffer, bool stamped) {
  std::uint64_t dropped = 0;
  if (!stamped && progress_ != never && place.progress < progress_ - longest_reordering) {
    dropped = units_.size();
    clear();
  }
  if (precision_progress_ && is_anew(place.precision_progress, *precision_progress_)) {
    ++run_;
    precision_progress_.reset();
    if (std::exchange(frames_lead_, false)) // what came meanwhile was late
      frames_run_ = run_;
  }
  bytes_ += gst_buffer_get_size(buffer.get());
  const Key key = {run_, place.precision, arrived_++};
  const auto unit = units_.emplace(place.time, Unit{std::move(buffer), key});
  precise_.emplace(key, unit);
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
  auto best = units_.lower_bound(time);
  if (best != units_.begin()) {
    const auto before = std::prev(best);
    if (best == units_.end() || time - before->first <= best->first - time)
      best = before;
  }
  if (best == units_.end() || std::abs(best->first - time) > tolerance)
    return nullptr;
  return remove(best);
}

OwnedBuffer UnitStore::take_precise(PrecisionTime time) {
  const auto first = precise_.lower_bound({frames_run_, time, 0});
  if (first == precise_.end() || first->first.run != frames_run_ || first->first.time != time)
    return nullptr;
  frames_lead_ = false;
  return remove(first->second);
}

void UnitStore::begin_precisely() {
  frames_run_ = precise_.empty() ? run_ : precise_.begin()->first.run;
  frames_lead_ = false;
}

std::uint64_t UnitStore::leave_run() {
  if (!has_later_run()) {
    ++run_;
    precision_progress_.reset();
    frames_lead_ = true;
  }
  ++frames_run_;
  return drop_before_precisely(0);
}

std::uint64_t UnitStore::drop_before(Time time) {
  std::uint64_t count = 0;
  for (; !units_.empty() && units_.begin()->first < time; ++count)
    remove(units_.begin());
  return count;
}

std::uint64_t UnitStore::drop_before_precisely(PrecisionTime time) {
  std::uint64_t count = 0;
  for (const Key first = {frames_run_, time, 0}; !precise_.empty() && precise_.begin()->first < first;
       ++count)
    remove(precise_.begin()->second);
  return count;
}

void UnitStore::drop_oldest() {
  remove(units_.begin());
}

void UnitStore::clear() {
  precise_.clear();
  units_.clear();
  bytes_ = 0;
  progress_ = gaps_ = never;
  precision_progress_.reset();
  frames_run_ = run_;
  frames_lead_ = false;
}

bool UnitClock::see_frame(Time time, Time duration) {
  if (duration > 0)
    duration_ = duration;
  if (first_frame_ != never || time == never)
    return false;
  first_frame_ = time;
  return true;
}

void UnitClock::add(Stamp stamp, OwnedBuffer unit) {
  bytes_ += gst_buffer_get_size(unit.get());
  waiting_.push_back({stamp, std::move(unit)});
}

Time UnitClock::time_of(const Stamp& stamp) {
  if (!first_)
    first_ = stamp;
  const std::uint64_t index = count_++;
  // What goes back belongs to another run of the sender, which nothing ties to these frames.
  if (stamp.time_us != first_->time_us)
    return stamp.time_us > first_->time_us
               ? placed_at(first_frame_, stamp.time_us - first_->time_us, GST_USECOND)
               : never;
  const Time duration = duration_ > 0 ? duration_ : default_duration;
  if (stamp.frame != first_->frame)
    return stamp.frame > first_->frame ? placed_at(first_frame_, stamp.frame - first_->frame, duration)
                                       : never;
  return placed_at(first_frame_, index, duration);
}

std::list<UnitClock::Unit> UnitClock::place(bool all) {
  if (first_frame_ == never && !all)
    return {};
  for (Unit& unit : waiting_)
    unit.time = first_frame_ == never ? never : time_of(unit.stamp);
  if (!all)
    waiting_.remove_if([](const Unit& unit) { return unit.time == never; });
  bytes_ = 0;
  return std::exchange(waiting_, {});
}

void UnitClock::drop_oldest() {
  bytes_ -= gst_buffer_get_size(waiting_.front().buffer.get());
  waiting_.pop_front();
}

void UnitClock::forget_units() {
  waiting_.clear();
  bytes_ = 0;
  first_.reset();
  count_ = 0;
}

} // namespace terrainseg
