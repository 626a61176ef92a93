// SPDX-License-Identifier: LGPL-2.1-or-later
// Reads CDR values (XCDR1, little-endian) from untrusted bytes.
#pragma once

#include <bit>
#include <cstdint>
#include <string_view>

#include "recording/little_endian.hpp"

namespace terrainseg::recording {

/// Reads the members of one message in order. A read past the end or of an invalid value returns 0 and marks
/// the reader as failed. Check whole() after the last member.
class CdrReader {
 public:
  /// Refuses other encodings: big-endian, parameter lists, XCDR2.
  explicit CdrReader(ByteView message) : rest_(message) {
    const ByteView header = take(header_size);
    failed_ = failed_ || header[0] != 0 || header[1] != 1;
  }

  std::uint8_t u8() { return integer<std::uint8_t>(); }
  std::uint32_t u32() { return integer<std::uint32_t>(); }
  std::int32_t i32() { return static_cast<std::int32_t>(u32()); }
  float f32() { return std::bit_cast<float>(u32()); }
  double f64() { return std::bit_cast<double>(integer<std::uint64_t>()); }
  bool boolean() {
    const std::uint8_t value = u8();
    failed_ = failed_ || value > 1;
    return value == 1;
  }
  /// A string without its terminating zero; a view into the message.
  std::string_view string() {
    const ByteView text = take(u32());
    failed_ = failed_ || text.empty() || text.back() != 0;
    return failed_ ? std::string_view()
                   : std::string_view(reinterpret_cast<const char*>(text.data()), text.size() - 1);
  }
  void skip_reals(std::size_t count) {
    f64(); // only for its alignment
    take((count - 1) * sizeof(double));
  }

  /// The bytes that have not been read.
  std::size_t left() const { return rest_.size(); }
  /// Whether all reads succeeded and only padding follows.
  bool whole() const { return !failed_ && rest_.size() < 4; }

 private:
  static constexpr std::size_t header_size = 4;

  ByteView take(std::size_t size) {
    failed_ = failed_ || size > rest_.size();
    if (failed_)
      return ByteView(zeros_).first(size <= sizeof zeros_ ? size : 0);
    const ByteView taken = rest_.first(size);
    rest_ = rest_.subspan(size);
    at_ += size;
    return taken;
  }
  template <class Integer> Integer integer() {
    constexpr std::size_t size = sizeof(Integer);
    take((size - (at_ - header_size) % size) % size);
    std::uint64_t value = 0;
    unsigned shift = 0;
    for (const std::uint8_t byte : take(size)) {
      value |= std::uint64_t{byte} << shift;
      shift += 8;
    }
    return static_cast<Integer>(value);
  }

  static constexpr std::uint8_t zeros_[8] = {};
  ByteView rest_;
  std::size_t at_ = 0;
  bool failed_ = false;
};

} // namespace terrainseg::recording
