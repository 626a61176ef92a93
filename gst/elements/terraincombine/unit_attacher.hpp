// SPDX-License-Identifier: LGPL-2.1-or-later
// Attaches what a KLV unit says to a frame.
#pragma once

#include <gst/video/video.h>

#include <cstdint>
#include <string>
#include <vector>

#include "exchange/vmti_klv.hpp"
#include "support/buffers.hpp"
#include "support/estimate_meta.hpp"
#include "support/meta.hpp"
#include "support/times.hpp"

namespace terrainseg {

class UnitAttacher {
 public:
  void set_video(GstCaps* caps) {
    if (!gst_video_info_from_caps(&info_, caps))
      info_ = no_video();
  }
  /// Decodes the unit for attach(). What is wrong with it, or an empty text.
  std::string decode(GstBuffer* klv) {
    const MappedBuffer bytes(klv, GST_MAP_READ);
    if (!bytes.data())
      return "its memory cannot be read";
    if (unit_.decode({bytes.data(), bytes.size()}) != KlvVerdict::ok) // it was ok when it came
      return unit_.error();
    const GrayView& mask = unit_.estimate().mask;
    if (std::int64_t{mask.width} * mask.height > most_mask_pixels(info_))
      return "its mask of " + std::to_string(mask.width) + "x" + std::to_string(mask.height) +
             " is more than four times as wide and high as the video of " +
             std::to_string(GST_VIDEO_INFO_WIDTH(&info_)) + "x" +
             std::to_string(GST_VIDEO_INFO_HEIGHT(&info_)) + ": send it smaller (mask-level)";
    return {};
  }
  /// The frame with the decoded unit; as it was when there is no memory for it.
  GstBuffer* attach(GstBuffer* frame) {
    Estimate e = unit_.estimate();
    const int width = GST_VIDEO_INFO_WIDTH(&info_), height = GST_VIDEO_INFO_HEIGHT(&info_);
    if (width > 0 && height > 0 && (e.frame_width != width || e.frame_height != height))
      fit(e, {e.frame_width, width}, {e.frame_height, height});

    const OwnedBuffer mask = masks_.acquire(e.mask.width, e.mask.height);
    const OwnedBuffer boundary =
        e.boundary.empty() ? nullptr : filled(boundaries_.acquire(e.boundary.size_bytes()), e.boundary);
    if (!boundary && !e.boundary.empty())
      return frame;
    {
      const MappedBuffer pixels(mask.get(), GST_MAP_WRITE);
      if (!pixels.data())
        return frame;
      unit_.draw_mask({pixels.data(), gst_buffer_get_video_meta(mask.get())->stride[0]});
    }
    frame = gst_buffer_make_writable(frame);
    terrainseg::attach(frame, e, mask.get(), boundary.get());
    stamp_unit_time(frame, unit_.time_us());
    return frame;
  }
  void drop() { ///< the pools
    masks_.drop();
    boundaries_.drop();
  }

 private:
  /// A mask may have that many pixels for every one of the frame: video scaled to a quarter of its sides.
  static constexpr std::int64_t most_mask_per_frame = 16;

  /// Pixels that the mask of a unit may have on this video.
  static std::int64_t most_mask_pixels(const GstVideoInfo& info) {
    const std::int64_t width = GST_VIDEO_INFO_WIDTH(&info), height = GST_VIDEO_INFO_HEIGHT(&info);
    return most_mask_per_frame * (width > 0 && height > 0 ? width * height : std::int64_t{1920} * 1080);
  }

  /// The estimate in pixels of a picture that was scaled on its way here: the rules of the metadata itself.
  void fit(Estimate& e, Axis x, Axis y) {
    rows_.assign(e.boundary.begin(), e.boundary.end());
    for (std::uint16_t& row : rows_)
      row = static_cast<std::uint16_t>(row >= y.from ? y.to : y.row(row));
    e.boundary = rows_;
    if (e.horizon_row >= 0)
      e.horizon_row = y.row(e.horizon_row);
    if (e.vanishing_row >= 0)
      e.vanishing_row = static_cast<std::int32_t>(
          gst_util_uint64_scale_int_round(static_cast<guint64>(e.vanishing_row), y.to, y.from));
    for (Rectangle* r : {&e.mask_region, &e.window})
      *r = {x.edge(r->x), y.edge(r->y), x.edge(r->x + r->width) - x.edge(r->x),
            y.edge(r->y + r->height) - y.edge(r->y)};
    e.frame_width = x.to;
    e.frame_height = y.to;
  }

  GstVideoInfo info_ = no_video();
  KlvUnit unit_;
  MaskPool masks_;
  SmallPool boundaries_;
  std::vector<std::uint16_t> rows_;
};

} // namespace terrainseg
