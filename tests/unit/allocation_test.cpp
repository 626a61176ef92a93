// SPDX-License-Identifier: LGPL-2.1-or-later
// Counts every allocation: once running, a frame needs none.
#include <atomic>
#include <cstdlib>
#include <new>

#include <gtest/gtest.h>

#include "support/frames.hpp"
#include "terrainseg/segmenter.hpp"

namespace {
std::atomic<long> allocations{0};

void* counted(std::size_t size, std::size_t alignment) {
  ++allocations;
  if (void* memory = alignment > alignof(std::max_align_t)
                         ? std::aligned_alloc(alignment, (size + alignment - 1) / alignment * alignment)
                         : std::malloc(size ? size : 1))
    return memory;
  throw std::bad_alloc();
}
} // namespace

void* operator new(std::size_t size) {
  return counted(size, 0);
}
void* operator new[](std::size_t size) {
  return counted(size, 0);
}
void* operator new(std::size_t size, std::align_val_t alignment) {
  return counted(size, static_cast<std::size_t>(alignment));
}
void* operator new[](std::size_t size, std::align_val_t alignment) {
  return counted(size, static_cast<std::size_t>(alignment));
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

namespace terrainseg {
namespace {

TEST(Allocation, TheCounterCounts) {
  const long before = allocations;
  delete new volatile int(3);
  EXPECT_EQ(allocations - before, 1);
}

TEST(Allocation, NoneOnceRunning) {
  std::vector<std::unique_ptr<test::OwnedFrame>> frames;
  for (PixelFormat format : {PixelFormat::I420, PixelFormat::YUY2, PixelFormat::BGRx})
    for (int i = 0; i < 12; ++i)
      frames.push_back(std::make_unique<test::OwnedFrame>(format, 320, 240, test::drive(320, 240, i)));
  for (Preset preset : {Preset::paper, Preset::standard})
    for (int mask_level : {0, 2})
      for (int threads : {1, 2})
        for (std::size_t first : {0, 12, 24}) {
          Settings settings = Settings::of(preset);
          settings.mask_level = mask_level;
          settings.n_threads = threads;
          settings.ignore_regions = {{0, 0, 40, 20}};
          Segmenter segmenter(settings);
          for (std::size_t i = 0; i < 3; ++i)
            ASSERT_TRUE(segmenter.process(frames[first + i]->frame()).ok());
          const long before = allocations;
          for (std::size_t i = 3; i < 12; ++i)
            ASSERT_TRUE(segmenter.process(frames[first + i]->frame()).ok());
          EXPECT_EQ(allocations - before, 0)
              << static_cast<int>(preset) << " " << mask_level << " " << threads << " " << first;
        }
}

} // namespace
} // namespace terrainseg
