// SPDX-License-Identifier: LGPL-2.1-or-later
// Pools of small buffers that are attached to frames.
#pragma once

#include <gst/gst.h>

#include <memory>

#include "terrainseg/frame.hpp"

namespace terrainseg {

struct BufferUnref {
  void operator()(GstBuffer* buffer) const { gst_buffer_unref(buffer); }
};
using OwnedBuffer = std::unique_ptr<GstBuffer, BufferUnref>;

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

} // namespace terrainseg
