// SPDX-License-Identifier: LGPL-2.1-or-later
// One harness that every kernel goes through: forced targets, and rows between pages that must not be
// touched.
#pragma once

#include "kernels/targets.hpp"
#include <gtest/gtest.h>

#include <hwy/highway.h>
#include <sys/mman.h>
#include <unistd.h>

#include <cstring>
#include <random>
#include <string>
#include <vector>

namespace terrainseg::testing {

/// Calls `check` once for every target that was compiled and that this machine has; the plain loops
/// (HWY_SCALAR) are always among them. The targets that ran are recorded with the test.
template <typename Check> void on_every_target(Check&& check) {
  std::string names;
  const std::int64_t plain = HWY_STATIC_TARGET;
  for (std::int64_t targets = (hwy::SupportedTargets() | plain) & HWY_TARGETS; targets != 0;
       targets &= targets - 1) {
    const std::int64_t target = targets & ~(targets - 1);
    hwy::SetSupportedTargetsForTest(target);
    hwy::GetChosenTarget().Update(hwy::SupportedTargets());
    names += std::string(names.empty() ? "" : " ") + hwy::TargetName(target);
    {
      SCOPED_TRACE(std::string("target ") + hwy::TargetName(target));
      check();
    }
    if (::testing::Test::HasFatalFailure())
      break;
  }
  hwy::SetSupportedTargetsForTest(0);
  hwy::GetChosenTarget().Update(hwy::SupportedTargets());
  ::testing::Test::RecordProperty("targets", names);
}

/// `size` elements that end at a page which may not be touched, or begin at one.
template <typename T> class Guarded {
 public:
  Guarded(std::size_t size, bool at_end) {
    const std::size_t page = static_cast<std::size_t>(sysconf(_SC_PAGESIZE));
    const std::size_t bytes = size * sizeof(T);
    inner_ = (bytes + page - 1) / page * page + (bytes == 0 ? page : 0);
    length_ = inner_ + 2 * page;
    base_ = static_cast<std::uint8_t*>(
        mmap(nullptr, length_, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0));
    mprotect(base_, page, PROT_NONE);
    mprotect(base_ + page + inner_, page, PROT_NONE);
    data_ = reinterpret_cast<T*>(base_ + page + (at_end ? inner_ - bytes : 0));
    size_ = size;
  }
  ~Guarded() { munmap(base_, length_); }
  Guarded(const Guarded&) = delete;
  Guarded& operator=(const Guarded&) = delete;

  T* data() const { return data_; }
  std::size_t size() const { return size_; }
  T* begin() const { return data_; }
  T* end() const { return data_ + size_; }
  T& operator[](std::size_t i) const { return data_[i]; }

 private:
  std::uint8_t* base_ = nullptr;
  std::size_t inner_ = 0, length_ = 0, size_ = 0;
  T* data_ = nullptr;
};

/// Fills that overflow what is too narrow, and noise.
enum class Fill { noise, zero, full, stripes, extremes };
inline constexpr Fill all_fills[] = {Fill::noise, Fill::zero, Fill::full, Fill::stripes, Fill::extremes};

template <typename Bytes> void fill(Bytes& bytes, Fill how, std::mt19937& random) {
  for (std::size_t i = 0; i < bytes.size(); ++i) {
    const std::uint32_t r = random();
    switch (how) {
    case Fill::noise:
      bytes[i] = static_cast<std::uint8_t>(r);
      break;
    case Fill::zero:
      bytes[i] = 0;
      break;
    case Fill::full:
      bytes[i] = 255;
      break;
    case Fill::stripes:
      bytes[i] = i % 2 ? 255 : 0;
      break;
    case Fill::extremes:
      bytes[i] = r & 64 ? 255 : 0;
      break;
    }
  }
}

} // namespace terrainseg::testing
