// SPDX-License-Identifier: LGPL-2.1-or-later
// A few threads of one Segmenter that share the rows of a frame.
#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <thread>
#include <type_traits>
#include <vector>

namespace terrainseg {

/// Runs the same function for several indices at once. The caller's thread works too; with one thread nothing
/// is started. Nothing is allocated once constructed. Not to be called from two threads at a time.
class Workers {
 public:
  /// `threads`: 1..16; 0 = as many as help, which is the processors this process may use, at most 8. Fewer
  /// when the system does not give them: see count().
  explicit Workers(int threads = 1);
  ~Workers();
  Workers(const Workers&) = delete;
  Workers& operator=(const Workers&) = delete;

  int count() const { return static_cast<int>(threads_.size()) + 1; }

  /// Calls f(0) .. f(tasks - 1), each once, in any order and on any thread, and returns when all have ended.
  /// f must not throw.
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
  // Written by run_erased() before `left_`, read by the threads after they took a task.
  Call call_ = nullptr;
  void* context_ = nullptr;
  int tasks_ = 0;
  /// Tasks that no thread has taken, below the generation: a thread that wakes late takes none of a run that
  /// has ended, and no run waits for it.
  std::atomic<std::uint64_t> left_{0};
  std::atomic<int> unfinished_{0};
  std::atomic<std::uint32_t> generation_{0}; ///< of the last run
  std::atomic<bool> stop_{false};
};

} // namespace terrainseg
