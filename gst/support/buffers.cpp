// SPDX-License-Identifier: LGPL-2.1-or-later
#include "support/buffers.hpp"

#include <gst/video/video.h>

#include <cstddef>

#include "support/estimate_meta.hpp"

namespace terrainseg {

OwnedBuffer SmallPool::acquire(gsize bytes) {
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

void SmallPool::drop() {
  if (pool_)
    gst_buffer_pool_set_active(pool_,
                               FALSE); // buffers in flight are freed when they return, and then the pool
  gst_clear_object(&pool_);
}

OwnedBuffer MaskPool::acquire(int width, int height) {
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

OwnedBuffer MaskPool::copy_of(const GrayView& picture) {
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

} // namespace terrainseg
