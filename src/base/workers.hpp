// SPDX-License-Identifier: LGPL-2.1-or-later
// Threads of one Segmenter that share the rows of a frame.
#pragma once

#include <atomic>
#include <cstdint>
#include <exception>
#include <thread>
#include <type_traits>
#include <vector>

namespace terrainseg {

/// Runs a function for several indices in parallel. The caller's thread also works; with one thread no thread
/// is started. Allocates only in the constructor. Must not be called from two threads at the same time.
class Workers {
 public:
  /// `threads`: 1..16; 0 = the number of processors that this process may use, at most 8. The number is
  /// smaller when the system refuses to create threads: see count().
  explicit Workers(int threads = 1);
  ~Workers();
  Workers(const Workers&) = delete;
  Workers& operator=(const Workers&) = delete;

  int count() const { return static_cast<int>(threads_.size()) + 1; }

  /// Calls f(0) .. f(tasks - 1), each once, in any order and on any thread. Returns when all calls have
  /// ended. Rethrows one of the exceptions of the calls.
  template <typename F> void run(int tasks, F&& f) {
    using Function = std::remove_reference_t<F>;
    run_erased(
        tasks, [](void* context, int task) { (*static_cast<Function*>(context))(task); },
        const_cast<void*>(static_cast<const void*>(&f)));
  }

 private:
  using Call = void (*)(void* context, int task);
  void run_erased(int tasks, Call call, void* context);
  void work();
  void serve();

  std::vector<std::thread> threads_;
  bool stay_awake_ = false; ///< written before the threads start
  // Written by run_erased() before `left_`; read by the threads after they took a task.
  Call call_ = nullptr;
  void* context_ = nullptr;
  int tasks_ = 0;
  /// Number of tasks that no thread has taken yet, with the generation of the run in the upper bits. A thread
  /// that wakes late therefore takes no task of a finished run, and no run waits for it.
  std::atomic<std::uint64_t> left_{0};
  std::atomic<int> unfinished_{0};
  std::atomic<bool> failed_{false}; ///< a task of this run threw; the first to set it writes `thrown_`
  std::exception_ptr thrown_;
  std::atomic<std::uint32_t> generation_{0}; ///< number of the last run
  std::atomic<bool> stop_{false};
};

} // namespace terrainseg
