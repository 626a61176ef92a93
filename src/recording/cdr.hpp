// SPDX-License-Identifier: LGPL-2.1-or-later
// Encodes values as CDR (XCDR1, little-endian), the format of ROS 2 messages on the wire and in recordings.
#pragma once

#include <bit>
#include <cstdint>
#include <string_view>

#include "recording/little_endian.hpp"

namespace terrainseg::recording {

/// Appends the members of one message in order. A number is aligned to its size; the alignment counts from
/// the end of the 4-byte encapsulation header.
class CdrWriter {
 public:
  /// Begins a message; clears `out`.
  explicit CdrWriter(Bytes& out) : out_(out) { out_.assign({0, 1, 0, 0}); }

  void u8(std::uint8_t value) { out_.push_back(value); }
  void u32(std::uint32_t value) { aligned(value); }
  void i32(std::int32_t value) { aligned(value); }
  void f32(float value) { aligned(std::bit_cast<std::uint32_t>(value)); }
  void f64(double value) { aligned(std::bit_cast<std::uint64_t>(value)); }
  void boolean(bool value) { u8(value ? 1 : 0); }
  /// A length that includes the terminating zero, the text, the zero.
  void string(std::string_view text) {
    u32(static_cast<std::uint32_t>(text.size() + 1));
    append(out_, bytes_of(text));
    out_.push_back(0);
  }
  /// The number of elements of a sequence; the elements must follow. An array has no count.
  void count(std::size_t elements) { u32(static_cast<std::uint32_t>(elements)); }
  /// Bytes without a count.
  void raw(ByteView bytes) { append(out_, bytes); }

 private:
  template <class Integer> void aligned(Integer value) {
    constexpr std::size_t header = 4, size = sizeof value;
    out_.resize(out_.size() + (size - (out_.size() - header) % size) % size);
    put_integer(out_, value);
  }
  Bytes& out_;
};

} // namespace terrainseg::recording
