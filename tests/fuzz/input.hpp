// SPDX-License-Identifier: LGPL-2.1-or-later
// Takes the decisions of a fuzzer from its input. At the end everything is 0.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <span>

namespace terrainseg::fuzz {

/// Says which promise was broken: the compiler makes one call of all those to abort().
inline void require(bool condition, const char* file = __builtin_FILE(), int line = __builtin_LINE()) {
  if (condition)
    return;
  std::fprintf(stderr, "%s:%d: broken\n", file, line);
  std::abort();
}

class Input {
 public:
  Input(const std::uint8_t* data, std::size_t size) : left_(data, size) {}
  bool done() const { return left_.empty(); }
  std::uint8_t byte() {
    if (left_.empty())
      return 0;
    const std::uint8_t value = left_[0];
    left_ = left_.subspan(1);
    return value;
  }
  std::uint64_t number(int bytes) {
    std::uint64_t value = 0;
    for (int i = 0; i < bytes; ++i)
      value = value << 8 | byte();
    return value;
  }
  int below(int count) {
    return static_cast<int>(number(count > 256 ? 2 : 1) % static_cast<unsigned>(count));
  }
  bool chance(int one_in) { return byte() % one_in == 1; } ///< false at the end
  std::span<const std::uint8_t> take(std::size_t most) {
    const auto front = left_.first(most < left_.size() ? most : left_.size());
    left_ = left_.subspan(front.size());
    return front;
  }

 private:
  std::span<const std::uint8_t> left_;
};

} // namespace terrainseg::fuzz
