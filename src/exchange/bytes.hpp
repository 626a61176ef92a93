// SPDX-License-Identifier: LGPL-2.1-or-later
// Numbers, checksums and run lengths that the output formats share.
#pragma once

#include <algorithm>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <string_view>
#include <vector>

#include "terrainseg/frame.hpp"

namespace terrainseg {

/// The bytes of the text without a terminating zero.
inline std::span<const std::uint8_t> bytes_of(std::string_view text) {
  return {reinterpret_cast<const std::uint8_t*>(text.data()), text.size()};
}

inline void append(std::vector<std::uint8_t>& out, std::span<const std::uint8_t> bytes) {
  const std::size_t at = out.size();
  out.resize(at + bytes.size());
  std::copy(bytes.begin(), bytes.end(), out.begin() + static_cast<std::ptrdiff_t>(at));
}

/// Appends the lowest `bytes` bytes of a number, little-endian.
template <class Integer>
void put_integer(std::vector<std::uint8_t>& out, Integer value, std::size_t bytes = sizeof(Integer)) {
  for (std::size_t i = 0; i < bytes; ++i)
    out.push_back(static_cast<std::uint8_t>(static_cast<std::uint64_t>(value) >> (8 * i)));
}

/// Appends the lowest `bytes` bytes of a number, big-endian.
inline void put_big(std::vector<std::uint8_t>& out, std::uint64_t value, int bytes) {
  for (int i = bytes - 1; i >= 0; --i)
    out.push_back(static_cast<std::uint8_t>(value >> (8 * i)));
}

/// Reads untrusted bytes from the front. After a read past the end, or fail(), all reads are empty or 0 and
/// ok() is false.
class ByteReader {
 public:
  explicit ByteReader(std::span<const std::uint8_t> bytes) : left_(bytes) {}
  bool ok() const { return ok_; }
  std::size_t left() const { return left_.size(); }
  bool done() const { return left_.empty(); }
  std::span<const std::uint8_t> take(std::size_t n) {
    if (n > left_.size())
      fail();
    const auto front = left_.first(ok_ ? n : 0);
    left_ = left_.subspan(front.size());
    return front;
  }
  /// A big-endian number of `n` bytes, at most 8.
  std::uint64_t big(std::size_t n) {
    std::uint64_t value = 0;
    for (const std::uint8_t byte : take(n))
      value = (value << 8) | byte;
    return value;
  }
  /// A little-endian number.
  template <class Integer> Integer little() {
    std::uint64_t value = 0;
    unsigned shift = 0;
    for (const std::uint8_t byte : take(sizeof(Integer))) {
      value |= std::uint64_t{byte} << shift;
      shift += 8;
    }
    return static_cast<Integer>(value);
  }
  void fail() {
    ok_ = false;
    left_ = {};
  }

 private:
  std::span<const std::uint8_t> left_;
  bool ok_ = true;
};

/// Calls pass(number) for the moments of a learned model in the order of all formats.
template <class Model, class Pass> void each_moment(Model& model, const Pass& pass) {
  for (auto& mean : model.mean)
    pass(mean);
  for (auto& variance : model.variance)
    pass(variance);
  pass(model.mass);
}

/// CRC-32 (polynomial of zlib, PNG and Ethernet). `before` is the CRC of the preceding bytes.
std::uint32_t crc32(std::span<const std::uint8_t> bytes, std::uint32_t before = 0);

/// Returns the first position in [from, end) whose byte differs from *from, or `end`. Requires from < end.
inline const std::uint8_t* run_end(const std::uint8_t* from, const std::uint8_t* end) {
  const std::uint8_t value = *from;
  const std::uint64_t pattern = value * 0x0101010101010101ull;
  const std::uint8_t* p = from;
  // Runs are mostly long: compares 32 bytes a step, then 8, then 1.
  for (; end - p >= 32; p += 32) {
    std::uint64_t w[4];
    std::memcpy(w, p, 32);
    if (((w[0] ^ pattern) | (w[1] ^ pattern) | (w[2] ^ pattern) | (w[3] ^ pattern)) != 0)
      break;
  }
  for (; end - p >= 8; p += 8) {
    std::uint64_t w;
    std::memcpy(&w, p, 8);
    const std::uint64_t difference = w ^ pattern;
    if (difference == 0)
      continue;
    // Whether the lowest or the highest byte of the number comes first in memory.
    const int bits = std::endian::native == std::endian::little ? std::countr_zero(difference)
                                                                : std::countl_zero(difference);
    return p + bits / 8;
  }
  while (p < end && *p == value)
    ++p;
  return p;
}

/// Calls take(value, length) for each run of equal bytes in raster order. A run may continue in the next row.
/// Stops and returns false when take returns false.
template <class Take> bool for_each_run(const GrayView& view, Take take) {
  if (view.empty())
    return true;
  std::uint8_t value = *view.plane.row(0);
  std::size_t length = 0;
  for (int y = 0; y < view.height; ++y) {
    const std::uint8_t* p = view.plane.row(y);
    const std::uint8_t* const end = p + view.width;
    while (p < end) {
      const std::uint8_t* const next = run_end(p, end);
      if (*p != value) {
        if (!take(value, length))
          return false;
        value = *p;
        length = 0;
      }
      length += static_cast<std::size_t>(next - p);
      p = next;
    }
  }
  return take(value, length);
}

} // namespace terrainseg
