// SPDX-License-Identifier: LGPL-2.1-or-later
// A mutex whose use Clang checks at compile time (-Wthread-safety): members marked TERRAINSEG_GUARDED_BY may
// be used only while it is locked.
#pragma once

#include <condition_variable>
#include <mutex>

#ifdef __clang__
#define TERRAINSEG_THREAD_SAFETY(attribute) __attribute__((attribute))
#else
#define TERRAINSEG_THREAD_SAFETY(attribute)
#endif
/// For a data member.
#define TERRAINSEG_GUARDED_BY(mutex) TERRAINSEG_THREAD_SAFETY(guarded_by(mutex))
/// For a function: the caller must hold the mutex.
#define TERRAINSEG_REQUIRES(mutex) TERRAINSEG_THREAD_SAFETY(requires_capability(mutex))

namespace terrainseg {

class TERRAINSEG_THREAD_SAFETY(capability("mutex")) Mutex {
 public:
  void lock() TERRAINSEG_THREAD_SAFETY(acquire_capability()) { mutex_.lock(); }
  void unlock() TERRAINSEG_THREAD_SAFETY(release_capability()) { mutex_.unlock(); }

 private:
  friend class Lock;
  std::mutex mutex_;
};

/// Locks a Mutex for its lifetime, except between unlock() and lock().
class TERRAINSEG_THREAD_SAFETY(scoped_lockable) Lock {
 public:
  explicit Lock(Mutex& mutex) TERRAINSEG_THREAD_SAFETY(acquire_capability(mutex)) : lock_(mutex.mutex_) {}
  ~Lock() TERRAINSEG_THREAD_SAFETY(release_capability()) {}
  Lock(const Lock&) = delete;
  Lock& operator=(const Lock&) = delete;

  void lock() TERRAINSEG_THREAD_SAFETY(acquire_capability()) { lock_.lock(); }
  void unlock() TERRAINSEG_THREAD_SAFETY(release_capability()) { lock_.unlock(); }
  /// Unlocks the mutex while waiting, and locks it again before it returns.
  void wait(std::condition_variable& changed) { changed.wait(lock_); }
  template <class Time> std::cv_status wait_until(std::condition_variable& changed, const Time& time) {
    return changed.wait_until(lock_, time);
  }

 private:
  std::unique_lock<std::mutex> lock_;
};

} // namespace terrainseg
