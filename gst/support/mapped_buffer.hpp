// SPDX-License-Identifier: LGPL-2.1-or-later
// Maps the memory of a buffer for the lifetime of an object.
#pragma once

#include <gst/gst.h>

namespace terrainseg {

class MappedBuffer {
 public:
  /// data() is nullptr if `buffer` is nullptr or cannot be mapped.
  MappedBuffer(GstBuffer* buffer, GstMapFlags flags) : buffer_(buffer) {
    mapped_ = buffer && gst_buffer_map(buffer, &map_, flags);
  }
  ~MappedBuffer() {
    if (mapped_)
      gst_buffer_unmap(buffer_, &map_);
  }
  MappedBuffer(const MappedBuffer&) = delete;
  MappedBuffer& operator=(const MappedBuffer&) = delete;
  explicit operator bool() const { return mapped_; }
  guint8* data() const { return mapped_ ? map_.data : nullptr; }
  gsize size() const { return mapped_ ? map_.size : 0; }

 private:
  GstBuffer* buffer_;
  GstMapInfo map_{};
  bool mapped_ = false;
};

} // namespace terrainseg
