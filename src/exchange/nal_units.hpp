// SPDX-License-Identifier: LGPL-2.1-or-later
// The NAL units of an access unit with start codes (ITU-T H.264 and H.265, annex B).
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

namespace terrainseg {

/// Walks over the NAL units of an access unit. Safe for untrusted input: linear time, no allocation.
class NalWalker {
 public:
  explicit NalWalker(std::span<const std::uint8_t> stream) : stream_(without_zeros(stream)) {}

  /// Moves to the next unit. Returns false after the last one.
  bool next() {
    begin_ = end_ = std::min(start_code(end_) + code.size(), stream_.size());
    return begin_ < stream_.size();
  }
  /// The unit without its start code; empty if another code follows. Searches the unit's end.
  std::span<const std::uint8_t> unit() {
    end_ = start_code(begin_);
    return without_zeros(stream_.subspan(begin_, end_ - begin_));
  }
  /// The unit and all that follows it. Does not search the unit's end.
  std::span<const std::uint8_t> rest() const { return stream_.subspan(begin_); }
  /// Position of the unit's start code, of three bytes or of four.
  std::size_t place() const {
    const std::size_t at = begin_ - code.size();
    return at > 0 && stream_[at - 1] == 0 ? at - 1 : at;
  }

 private:
  static constexpr std::array<std::uint8_t, 3> code = {0, 0, 1};

  /// Position of the first start code from `at`; the size if there is none.
  std::size_t start_code(std::size_t at) const {
    const auto from = stream_.begin() + static_cast<std::ptrdiff_t>(at);
    return static_cast<std::size_t>(std::search(from, stream_.end(), code.begin(), code.end()) -
                                    stream_.begin());
  }
  // A unit never ends in a zero: trailing zeros are padding, or the first byte of the next start code.
  static std::span<const std::uint8_t> without_zeros(std::span<const std::uint8_t> bytes) {
    while (!bytes.empty() && bytes.back() == 0)
      bytes = bytes.first(bytes.size() - 1);
    return bytes;
  }

  std::span<const std::uint8_t> stream_;
  std::size_t begin_ = 0, end_ = 0; ///< of the unit; equal while the end is not known
};

} // namespace terrainseg
