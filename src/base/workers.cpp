// SPDX-License-Identifier: LGPL-2.1-or-later
#include "base/workers.hpp"

#include <algorithm>
#include <chrono>
#include <hwy/cache_control.h>
#include <sched.h>
#include <system_error>
#include <utility>

namespace terrainseg {
namespace {

// With more threads the bands of a frame are so thin that memory bandwidth is the limit.
constexpr int most_that_help = 8;

// How long an idle thread spins before it sleeps. Each frame uses the threads twice, with the coarse stages
// in between. Waking a thread takes as long as a tenth of its share of the work.
constexpr std::chrono::microseconds awake{300};

// Waits until `value` differs from `old`: spins first, then sleeps. Returns the new value.
template <typename T> T wait_for_change(std::atomic<T>& value, T old, bool stay_awake) {
  const auto end = std::chrono::steady_clock::now() + awake;
  while (stay_awake && std::chrono::steady_clock::now() < end) {
    for (int i = 0; i < 32; ++i) {
      if (const T now = value; now != old)
        return now;
      hwy::Pause();
    }
  }
  value.wait(old);
  return value;
}

int processors() {
  cpu_set_t set;
  CPU_ZERO(&set);
  const int n = sched_getaffinity(0, sizeof set, &set) == 0 ? CPU_COUNT(&set) : 1;
  return std::clamp(n, 1, most_that_help);
}

} // namespace

Workers::Workers(int threads) {
  const int count = threads == 0 ? processors() : threads;
  stay_awake_ = count <= processors();
  threads_.reserve(std::max(0, count - 1));
  // When the system refuses to create a thread (a limit, no memory for a stack), the existing threads do the
  // work. The result does not depend on their number.
  try {
    for (int i = 1; i < count; ++i)
      threads_.emplace_back([this] { serve(); });
  } catch (const std::system_error&) {
  }
}

Workers::~Workers() {
  stop_ = true;
  ++generation_;
  generation_.notify_all();
  for (std::thread& t : threads_)
    t.join();
}

// After a thread took a task, the call's data stay valid until the task ends: run_erased() waits for it.
void Workers::work() {
  for (std::uint64_t left = left_;;) {
    const auto tasks = static_cast<std::uint32_t>(left);
    if (tasks == 0)
      return;
    if (!left_.compare_exchange_weak(left, left - 1))
      continue;
    try {
      call_(context_, tasks_ - static_cast<int>(tasks));
    } catch (...) {
      if (!failed_.exchange(true))
        thrown_ = std::current_exception();
    }
    if (unfinished_.fetch_sub(1) == 1)
      unfinished_.notify_one();
    left = left_;
  }
}

void Workers::serve() {
  for (std::uint32_t seen = 0;;) {
    seen = wait_for_change(generation_, seen, stay_awake_);
    if (stop_)
      return;
    work();
  }
}

void Workers::run_erased(int tasks, Call call, void* context) {
  if (threads_.empty() || tasks <= 1) {
    for (int task = 0; task < tasks; ++task)
      call(context, task);
    return;
  }
  call_ = call;
  context_ = context;
  tasks_ = tasks;
  unfinished_ = tasks;
  const std::uint32_t generation = generation_ + 1;
  left_ = std::uint64_t{generation} << 32 | static_cast<std::uint32_t>(tasks);
  generation_ = generation;
  generation_.notify_all();
  work();
  for (int left; (left = unfinished_) != 0;)
    wait_for_change(unfinished_, left, stay_awake_);
  if (failed_.exchange(false))
    std::rethrow_exception(std::exchange(thrown_, nullptr));
}

} // namespace terrainseg
