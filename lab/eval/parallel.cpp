// SPDX-License-Identifier: LGPL-2.1-or-later
#include "lab/eval/parallel.hpp"

#include <algorithm>
#include <atomic>
#include <exception>
#include <mutex>
#include <thread>
#include <vector>

namespace terrainseg::eval {

std::size_t worker_count(std::size_t count) {
  return std::clamp<std::size_t>(std::thread::hardware_concurrency(), 1, std::max<std::size_t>(count, 1));
}

void for_each_in_parallel(std::size_t count, const std::function<void(std::size_t, std::size_t)>& work) {
  std::atomic<std::size_t> next{0};
  std::mutex mutex;
  std::exception_ptr first;
  const auto run = [&](std::size_t worker) {
    try {
      for (std::size_t item = next++; item < count; item = next++)
        work(item, worker);
    } catch (...) {
      next = count;
      const std::lock_guard lock(mutex);
      if (!first)
        first = std::current_exception();
    }
  };
  std::vector<std::jthread> others;
  for (std::size_t worker = 1; worker < worker_count(count); ++worker)
    others.emplace_back(run, worker);
  run(0);
  others.clear();
  if (first)
    std::rethrow_exception(first);
}

} // namespace terrainseg::eval
