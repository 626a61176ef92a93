// SPDX-License-Identifier: LGPL-2.1-or-later
// Pools of small buffers that travel with frames.
#pragma once

#include <gst/gst.h>

#include <memory>

namespace terrainseg {

struct BufferUnref {
  void operator()(GstBuffer* buffer) const { gst_buffer_unref(buffer); }
};
using OwnedBuffer = std::unique_ptr<GstBuffer, BufferUnref>;

/// A pool of buffers of one size that grows to what is in flight and allocates no more after that.
class SmallPool {
 public:
  SmallPool() = default;
  ~SmallPool() { drop(); }
  SmallPool(const SmallPool&) = delete;
  SmallPool& operator=(const SmallPool&) = delete;

  /// A buffer of `bytes` bytes; nullptr when there is no memory. Another size than last time starts a new
  /// pool.
  OwnedBuffer acquire(gsize bytes);
  void drop();

 private:
  GstBufferPool* pool_ = nullptr;
  gsize bytes_ = 0;
};

/// The same for masks: the buffers carry the GstVideoMeta that says GRAY8, width and height.
class MaskPool {
 public:
  OwnedBuffer acquire(int width, int height);
  void drop() { pool_.drop(); }

 private:
  SmallPool pool_;
};

} // namespace terrainseg
