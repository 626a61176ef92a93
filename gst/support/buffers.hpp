// SPDX-License-Identifier: LGPL-2.1-or-later
// Buffers: mapped, from pools, and with the numbers of the metadata.
#pragma once

#include <gst/gst.h>
#include <gst/video/video.h>

#include <algorithm>
#include <bit>
#include <cstddef>
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
using OwnedEvent = std::unique_ptr<GstEvent, ObjectUnref>;

/// A pool of buffers of one size. It grows to the number of buffers in flight and then allocates no more.
class SmallPool {
 public:
  SmallPool() = default;
  ~SmallPool() { drop(); }
  SmallPool(const SmallPool&) = delete;
  SmallPool& operator=(const SmallPool&) = delete;

  /// Returns a buffer of `bytes` bytes, or nullptr if memory is exhausted. A new size creates a new pool.
  OwnedBuffer acquire(gsize bytes) {
    if (!pool_ || bytes != bytes_) {
      drop();
      pool_ = gst_buffer_pool_new();
      GstStructure* config = gst_buffer_pool_get_config(pool_);
      gst_buffer_pool_config_set_params(config, nullptr, static_cast<guint>(bytes), 0, 0);
      if (!gst_buffer_pool_set_config(pool_, config) || !gst_buffer_pool_set_active(pool_, TRUE)) {
        drop();
        return nullptr;
      }
      bytes_ = bytes;
    }
    GstBuffer* buffer = nullptr;
    gst_buffer_pool_acquire_buffer(pool_, &buffer, nullptr);
    return OwnedBuffer(buffer);
  }
  void drop() {
    if (pool_) // buffers in flight are freed when they return, and then the pool
      gst_buffer_pool_set_active(pool_, FALSE);
    gst_clear_object(&pool_);
  }

 private:
  GstBufferPool* pool_ = nullptr;
  gsize bytes_ = 0;
};

/// Adds the GstVideoMeta of a mask to `buffer`. Stride 0 = rows without padding, because programs may read a
/// mask as width * height bytes.
inline GstVideoMeta* describe_mask(GstBuffer* buffer, int width, int height, int stride = 0,
                                   gsize offset = 0) {
  gsize offsets[GST_VIDEO_MAX_PLANES] = {offset};
  gint strides[GST_VIDEO_MAX_PLANES] = {stride == 0 ? width : stride};
  return gst_buffer_add_video_meta_full(buffer, GST_VIDEO_FRAME_FLAG_NONE, GST_VIDEO_FORMAT_GRAY8, width,
                                        height, 1, offsets, strides);
}

/// A pool of masks: the buffers have a GstVideoMeta with GRAY8, width and height.
class MaskPool {
 public:
  OwnedBuffer acquire(int width, int height) {
    OwnedBuffer buffer = pool_.acquire(static_cast<gsize>(width) * height);
    if (!buffer)
      return nullptr;
    GstVideoMeta* meta = gst_buffer_get_video_meta(buffer.get());
    if (meta && meta->width == static_cast<guint>(width) && meta->height == static_cast<guint>(height))
      return buffer;
    if (meta) // same size in bytes, but another width and height
      gst_buffer_remove_meta(buffer.get(), &meta->meta);
    meta = describe_mask(buffer.get(), width, height);
    meta->meta.flags = static_cast<GstMetaFlags>(
        meta->meta.flags | GST_META_FLAG_POOLED); // kept when the buffer returns to the pool
    return buffer;
  }
  /// A copy of a picture, or nullptr if it is empty or memory is exhausted.
  OwnedBuffer copy_of(const GrayView& picture) {
    if (picture.empty())
      return nullptr;
    OwnedBuffer buffer = acquire(picture.width, picture.height);
    const MappedBuffer out(buffer.get(), GST_MAP_WRITE);
    if (!out.data())
      return nullptr;
    for (int y = 0; y < picture.height; ++y)
      std::copy_n(picture.plane.row(y), picture.width,
                  out.data() + static_cast<std::ptrdiff_t>(y) * picture.width);
    return buffer;
  }
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
