// SPDX-License-Identifier: LGPL-2.1-or-later
// Lists of bytes, and values as CDR (XCDR1, little-endian), the format of ROS 2 messages on the wire and in
// recordings.
#pragma once

#include <array>
#include <bit>
#include <cstdint>
#include <span>
#include <string_view>
#include <type_traits>
#include <vector>

#include "exchange/bytes.hpp"

namespace terrainseg::recording {

using Bytes = std::vector<std::uint8_t>;
using ByteView = std::span<const std::uint8_t>;
using terrainseg::bytes_of; // callers name it with this namespace

/// Appends the members of one message in order. A number is aligned to its size; the alignment counts from
/// the end of the 4-byte encapsulation header.
class CdrWriter {
 public:
  /// Begins a message; clears `out`.
  explicit CdrWriter(Bytes& out) : out_(out) { out_.assign({0, 1, 0, 0}); }

  /// Numbers, whose types are those of the message, and texts. An array is its elements; a span is a
  /// sequence: the number of its elements, then they.
  template <class... Members> void put(const Members&... members) { (put_one(members), ...); }
  /// The number of elements of a sequence; the elements must follow.
  void count(std::size_t elements) { put_one(static_cast<std::uint32_t>(elements)); }
  /// Bytes without a count.
  void raw(ByteView bytes) { append(out_, bytes); }

 private:
  template <class Number>
  requires std::is_arithmetic_v<Number>
  void put_one(Number value) {
    constexpr std::size_t header = 4, size = sizeof value;
    using Bits = std::conditional_t<size == 8, std::uint64_t,
                                    std::conditional_t<size == 4, std::uint32_t, std::uint8_t>>;
    out_.resize(out_.size() + (size - (out_.size() - header) % size) % size);
    put_integer(out_, std::bit_cast<Bits>(value));
  }
  /// A length that includes the terminating zero, the text, the zero.
  void put_one(std::string_view text) {
    count(text.size() + 1);
    append(out_, bytes_of(text));
    out_.push_back(0);
  }
  template <class Element, std::size_t size> void put_one(const std::array<Element, size>& elements) {
    for (const Element& element : elements)
      put_one(element);
  }
  template <class Element> void put_one(std::span<const Element> elements) {
    count(elements.size());
    if constexpr (sizeof(Element) == 1)
      raw({reinterpret_cast<const std::uint8_t*>(elements.data()), elements.size()});
    else
      for (const Element& element : elements)
        put_one(element);
  }
  Bytes& out_;
};

} // namespace terrainseg::recording
