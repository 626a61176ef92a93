// SPDX-License-Identifier: LGPL-2.1-or-later
// Frames to measure with: more of them than the last-level cache holds, so that each comes from memory.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "terrainseg/frame.hpp"

namespace terrainseg::bench {

/// Bytes that rotate: a quarter more than the last-level cache, but at most a quarter of the free memory.
std::size_t rotation_bytes();
std::size_t last_level_cache_bytes();

class FrameSet {
 public:
  /// Renders that many frames of the project's own scene and repeats them over `bytes` of memory; more than
  /// three forward and back in turns, as a drive.
  FrameSet(PixelFormat format, int width, int height, std::size_t bytes, int rendered = 3);

  int count() const { return count_; }
  std::size_t frame_bytes() const { return frame_bytes_; }
  /// Frame `i` modulo count(); pts follow at 30 frames a second.
  Frame frame(int i) const;
  MutableFrame mutable_frame(int i);
  const std::uint8_t* bytes(int i) const { return memory_.data() + frame_bytes_ * index(i); }
  void refill(); ///< the pixels as they were rendered

 private:
  std::size_t index(int i) const { return static_cast<std::size_t>(i % count_); }

  PixelFormat format_;
  int width_, height_, rendered_;
  std::array<std::ptrdiff_t, 3> strides_{};
  std::array<std::size_t, 3> offsets_{};
  std::size_t frame_bytes_ = 0;
  int count_ = 0;
  std::vector<std::uint8_t> memory_, originals_;
};

/// Where copies and masks go: a few buffers in turn, as from a pipeline's pool.
class Pool {
 public:
  explicit Pool(std::size_t bytes);
  std::uint8_t* next();

 private:
  static constexpr int buffers = 4;
  std::size_t bytes_;
  int turn_ = 0;
  std::vector<std::uint8_t> memory_;
};

} // namespace terrainseg::bench
