// SPDX-License-Identifier: LGPL-2.1-or-later
#include "workers.hpp"

#include <algorithm>
#include <sched.h>

namespace terrainseg {
namespace {

// Beyond this the bands of a frame are too thin for the memory to feed them.
constexpr int most_that_help = 8;

int processors() {
  cpu_set_t set;
  CPU_ZERO(&set);
  const int n = sched_getaffinity(0, sizeof set, &set) == 0 ? CPU_COUNT(&set) : 1;
  return std::clamp(n, 1, most_that_help);
}

} // namespace

Workers::Workers(int threads) {
  const int count = threads == 0 ? processors() : threads;
  threads_.reserve(static_cast<std::size_t>(std::max(0, count - 1)));
  for (int i = 1; i < count; ++i)
    threads_.emplace_back([this] { serve(); });
}

Workers::~Workers() {
  stop_ = true;
  ++generation_;
  generation_.notify_all();
  for (std::thread& t : threads_)
    t.join();
}

void Workers::work() {
  for (int task; (task = next_.fetch_add(1)) < tasks_;)
    call_(context_, task);
}

void Workers::serve() {
  for (std::uint32_t seen = 0;;) {
    generation_.wait(seen);
    seen = generation_;
    if (stop_)
      return;
    work();
    if (busy_.fetch_sub(1) == 1)
      busy_.notify_one();
  }
}

void Workers::run_erased(int tasks, Call call, void* context) {
  call_ = call;
  context_ = context;
  tasks_ = tasks;
  if (threads_.empty() || tasks <= 1) {
    for (int task = 0; task < tasks; ++task)
      call(context, task);
    return;
  }
  next_ = 0;
  busy_ = static_cast<int>(threads_.size());
  ++generation_;
  generation_.notify_all();
  work();
  for (int left; (left = busy_) != 0;)
    busy_.wait(left);
}

} // namespace terrainseg
