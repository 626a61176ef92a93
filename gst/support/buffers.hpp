// SPDX-License-Identifier: LGPL-2.1-or-later
// Buffers: mapped, from pools, and with the numbers of the metadata.
#pragma once

#include <gst/gst.h>

#include <algorithm>
#include <bit>
#include <cstdint>
#include <cstring>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "terrainseg/frame.hpp"

namespace terrainseg {

/// Maps the memory of a buffer for its lifetime.
class MappedBuffer {
 public:
  /// data() is nullptr if `buffer` is nullptr or cannot be mapped.
  MappedBuffer(GstBuffer* buffer, GstMapFlags flags)
      : buffer_(buffer && gst_buffer_map(buffer, &map_, flags) ? buffer : nullptr) {}
  ~MappedBuffer() {
    if (buffer_)
      gst_buffer_unmap(buffer_, &map_);
  }
  MappedBuffer(const MappedBuffer&) = delete;
  MappedBuffer& operator=(const MappedBuffer&) = delete;
  explicit operator bool() const { return buffer_; }
  guint8* data() const { return buffer_ ? map_.data : nullptr; }
  gsize size() const { return buffer_ ? map_.size : 0; }

 private:
  GstMapInfo map_{};
  GstBuffer* buffer_; ///< nullptr if it is not mapped
};

struct ObjectUnref {
  void operator()(gpointer object) const { gst_mini_object_unref(GST_MINI_OBJECT_CAST(object)); }
};
using OwnedBuffer = std::unique_ptr<GstBuffer, ObjectUnref>;

/// A pool of buffers of one size. It grows to the number of buffers in flight and then allocates no more.
class SmallPool {
 public:
  SmallPool() = default;
  ~SmallPool() { drop(); }
  SmallPool(const SmallPool&) = delete;
  SmallPool& operator=(const SmallPool&) = delete;

  /// Returns a buffer of `bytes` bytes, or nullptr if memory is exhausted. A new size creates a new pool.
  OwnedBuffer acquire(gsize bytes);
  void drop();

 private:
  GstBufferPool* pool_ = nullptr;
  gsize bytes_ = 0;
};

/// A pool of masks: the buffers have a GstVideoMeta with GRAY8, width and height.
class MaskPool {
 public:
  OwnedBuffer acquire(int width, int height);
  /// A copy of a picture, or nullptr if it is empty or memory is exhausted.
  OwnedBuffer copy_of(const GrayView& picture);
  void drop() { pool_.drop(); }

 private:
  SmallPool pool_;
};

/// A new buffer with these bytes; nullptr if memory is exhausted.
inline OwnedBuffer copy_of(std::span<const std::uint8_t> bytes) {
  OwnedBuffer buffer(gst_buffer_new_allocate(nullptr, bytes.size(), nullptr));
  if (buffer)
    gst_buffer_fill(buffer.get(), 0, bytes.data(), bytes.size());
  return buffer;
}

/// From the byte order of this machine to little-endian, and back.
template <class Number> void swap_for_little_endian(Number& number) {
  auto* bytes = reinterpret_cast<std::uint8_t*>(&number);
  if (std::endian::native == std::endian::big)
    std::reverse(bytes, bytes + sizeof number);
}

template <class Number> void write_values(std::span<const Number> values, guint8* bytes) {
  for (Number value : values) {
    swap_for_little_endian(value);
    std::memcpy(bytes, &value, sizeof value);
    bytes += sizeof value;
  }
}

/// `buffer`, new or from a pool, with these values, which fill it; nullptr if there is no buffer, or it
/// cannot be written to.
template <class Number> OwnedBuffer filled(OwnedBuffer buffer, std::span<const Number> values) {
  const MappedBuffer bytes(buffer.get(), GST_MAP_WRITE);
  if (!bytes)
    return nullptr;
  write_values(values, bytes.data());
  return buffer;
}

/// Holds a reference and a mapping of such a buffer, which any program can have written.
template <class Number> class ValueReader {
 public:
  /// Returns false if the buffer cannot be mapped.
  bool map(GstBuffer* buffer) {
    buffer_.reset(gst_buffer_ref(buffer));
    bytes_.emplace(buffer, GST_MAP_READ);
    const std::size_t count = bytes_->size() / sizeof(Number);
    if (std::endian::native == std::endian::little &&
        reinterpret_cast<std::uintptr_t>(bytes_->data()) % alignof(Number) == 0) {
      values_ = {reinterpret_cast<const Number*>(bytes_->data()), count};
      return static_cast<bool>(*bytes_);
    }
    host_order_.resize(count);
    std::memcpy(host_order_.data(), bytes_->data(), count * sizeof(Number));
    std::for_each(host_order_.begin(), host_order_.end(), swap_for_little_endian<Number>);
    values_ = host_order_;
    return static_cast<bool>(*bytes_);
  }
  /// Whether the buffer ends with a whole value.
  bool is_whole() const { return bytes_->size() % sizeof(Number) == 0; }
  std::span<const Number> values() const { return values_; }

 private:
  OwnedBuffer buffer_;
  std::optional<MappedBuffer> bytes_;
  std::vector<Number> host_order_; ///< used if the values cannot be read in place
  std::span<const Number> values_;
};

} // namespace terrainseg
