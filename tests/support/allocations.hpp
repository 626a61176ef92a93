// SPDX-License-Identifier: LGPL-2.1-or-later
// Counts every allocation of a program by operator new, and of the plugins that it loads when it exports its
// symbols. For one file of a program: the operators are defined here.
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdlib>
#include <new>

namespace terrainseg::test {

inline std::atomic<long> allocations = 0;
/// While set every allocation of this thread fails.
inline thread_local bool no_memory = false;
/// The allocation of this number fails, in whatever thread; 0 = none.
inline std::atomic<long> failing_allocation = 0;

inline void* counted(std::size_t size, std::size_t alignment) {
  if (++allocations == failing_allocation || no_memory)
    throw std::bad_alloc();
  if (void* memory = alignment > alignof(std::max_align_t)
                         ? std::aligned_alloc(alignment, (size + alignment - 1) / alignment * alignment)
                         : std::malloc(size ? size : 1))
    return memory;
  throw std::bad_alloc();
}
} // namespace terrainseg::test

void* operator new(std::size_t size) {
  return terrainseg::test::counted(size, 0);
}
void* operator new[](std::size_t size) {
  return terrainseg::test::counted(size, 0);
}
void* operator new(std::size_t size, std::align_val_t alignment) {
  return terrainseg::test::counted(size, static_cast<std::size_t>(alignment));
}
void* operator new[](std::size_t size, std::align_val_t alignment) {
  return terrainseg::test::counted(size, static_cast<std::size_t>(alignment));
}
void operator delete(void* memory) noexcept {
  std::free(memory);
}
void operator delete[](void* memory) noexcept {
  std::free(memory);
}
void operator delete(void* memory, std::size_t) noexcept {
  std::free(memory);
}
void operator delete[](void* memory, std::size_t) noexcept {
  std::free(memory);
}
void operator delete(void* memory, std::align_val_t) noexcept {
  std::free(memory);
}
void operator delete[](void* memory, std::align_val_t) noexcept {
  std::free(memory);
}
void operator delete(void* memory, std::size_t, std::align_val_t) noexcept {
  std::free(memory);
}
void operator delete[](void* memory, std::size_t, std::align_val_t) noexcept {
  std::free(memory);
}
