// SPDX-License-Identifier: LGPL-2.1-or-later
#include "frame_set.hpp"

#include <algorithm>
#include <cstring>
#include <unistd.h>

#include "scene/scene.hpp"

namespace terrainseg::bench {
namespace {

constexpr std::size_t alignment = 64;

} // namespace

std::size_t last_level_cache_bytes() {
  const long l3 = sysconf(_SC_LEVEL3_CACHE_SIZE), l2 = sysconf(_SC_LEVEL2_CACHE_SIZE);
  const long bytes = std::max(l3, l2);
  return bytes > 0 ? static_cast<std::size_t>(bytes) : std::size_t{32} << 20;
}

std::size_t rotation_bytes() {
  const auto free =
      static_cast<std::size_t>(sysconf(_SC_AVPHYS_PAGES)) * static_cast<std::size_t>(sysconf(_SC_PAGESIZE));
  return std::min(last_level_cache_bytes() / 4 * 5, free / 4);
}

FrameSet::FrameSet(PixelFormat format, int width, int height, std::size_t bytes, int rendered)
    : format_(format), width_(width), height_(height), rendered_(rendered) {
  const FormatLayout& layout = layout_of(format);
  for (int p = 0; p < layout.planes; ++p) {
    strides_[p] = (row_bytes(layout, p, width) + 3) / 4 * 4;
    offsets_[p] = frame_bytes_;
    frame_bytes_ +=
        static_cast<std::size_t>(strides_[p]) * static_cast<std::size_t>(plane_rows(layout, p, height));
  }
  frame_bytes_ = (frame_bytes_ + alignment - 1) / alignment * alignment;
  count_ = static_cast<int>(std::max(static_cast<std::size_t>(rendered), bytes / frame_bytes_));
  memory_.resize(frame_bytes_ * static_cast<std::size_t>(count_));
  scene::Renderer renderer({}, width, height);
  for (int i = 0; i < rendered; ++i)
    renderer.render(static_cast<std::uint64_t>(i), mutable_frame(i));
  originals_.assign(memory_.begin(),
                    memory_.begin() +
                        static_cast<std::ptrdiff_t>(frame_bytes_ * static_cast<std::size_t>(rendered)));
  refill();
}

void FrameSet::refill() {
  const int turn = 2 * (rendered_ - 1);
  for (int i = 0; i < count_; ++i) {
    const int original = turn > 4 ? std::min(i % turn, turn - i % turn) : i % rendered_;
    std::memcpy(memory_.data() + frame_bytes_ * index(i),
                originals_.data() + frame_bytes_ * static_cast<std::size_t>(original), frame_bytes_);
  }
}

Frame FrameSet::frame(int i) const {
  Frame f;
  f.format = format_;
  f.width = width_;
  f.height = height_;
  f.pts = std::int64_t{i} * 1000000000 / 30;
  for (int p = 0; p < layout_of(format_).planes; ++p)
    f.planes[p] = {bytes(i) + offsets_[p], strides_[p]};
  return f;
}

MutableFrame FrameSet::mutable_frame(int i) {
  MutableFrame f;
  f.format = format_;
  f.width = width_;
  f.height = height_;
  for (int p = 0; p < layout_of(format_).planes; ++p)
    f.planes[p] = {memory_.data() + frame_bytes_ * index(i) + offsets_[p], strides_[p]};
  return f;
}

Pool::Pool(std::size_t bytes) : bytes_(bytes), memory_(bytes * buffers, 1) {}

std::uint8_t* Pool::next() {
  turn_ = (turn_ + 1) % buffers;
  return memory_.data() + bytes_ * static_cast<std::size_t>(turn_);
}

} // namespace terrainseg::bench
