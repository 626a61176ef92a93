// SPDX-License-Identifier: LGPL-2.1-or-later
#include "elements/terraincombine/unit_clock.hpp"

#include <algorithm>

namespace terrainseg {
namespace {

/// Where nothing tells the frame rate: 30 frames a second.
constexpr Time default_duration = GST_SECOND / 30;

/// base + steps * step, or never when that lies beyond what times are.
Time placed_at(Time base, std::uint64_t steps, Time step) {
  const auto room = static_cast<std::uint64_t>(most_time - std::max<Time>(base, 0));
  return steps > room / static_cast<std::uint64_t>(step) ? never : base + static_cast<Time>(steps) * step;
}

} // namespace

bool UnitClock::see_frame(Time time, Time duration) {
  if (duration > 0)
    duration_ = duration;
  if (first_frame_ != never || time == never)
    return false;
  first_frame_ = time;
  return true;
}

void UnitClock::add(Stamp stamp, OwnedBuffer unit) {
  const std::size_t size = gst_buffer_get_size(unit.get());
  waiting_.push_back({stamp, std::move(unit)});
  bytes_ += size;
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

std::list<UnitClock::Placed> UnitClock::place(bool all) {
  std::list<Placed> placed;
  if (first_frame_ == never && !all)
    return placed;
  for (; !waiting_.empty(); waiting_.pop_front()) {
    Waiting& front = waiting_.front();
    bytes_ -= gst_buffer_get_size(front.unit.get());
    if (const Time time = first_frame_ == never ? never : time_of(front.stamp); time != never || all)
      placed.push_back({time, front.stamp.time_us, std::move(front.unit)});
  }
  return placed;
}

std::uint64_t UnitClock::drop_oldest() {
  if (waiting_.empty())
    return 0;
  bytes_ -= gst_buffer_get_size(waiting_.front().unit.get());
  waiting_.pop_front();
  return 1;
}

void UnitClock::forget_units() {
  waiting_.clear();
  bytes_ = 0;
  first_.reset();
  count_ = 0;
}

void UnitClock::reset() {
  forget_units();
  first_frame_ = never;
  duration_ = 0;
}

} // namespace terrainseg
