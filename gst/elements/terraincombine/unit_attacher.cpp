// SPDX-License-Identifier: LGPL-2.1-or-later
#include "elements/terraincombine/unit_attacher.hpp"

#include <algorithm>

#include "support/buffers.hpp"
#include "support/estimate_meta.hpp"
#include "support/wall_clock.hpp"

namespace terrainseg {
namespace {

/// A mask may have that many pixels for every one of the frame: video scaled to a quarter of its sides.
constexpr std::int64_t most_mask_per_frame = 16;

int scaled(int position, int to, int from) {
  return static_cast<int>(gst_util_uint64_scale_int(static_cast<guint64>(position), to, from));
}

Rectangle scaled(const Rectangle& r, const Estimate& e, int width, int height) {
  const int x = scaled(r.x, width, e.frame_width), y = scaled(r.y, height, e.frame_height);
  return {x, y, scaled(r.x + r.width, width, e.frame_width) - x,
          scaled(r.y + r.height, height, e.frame_height) - y};
}

/// The estimate in pixels of a picture that was scaled on its way here: the rules of the metadata itself.
void fit(Estimate& e, std::vector<std::uint16_t>& rows, int width, int height) {
  const auto row_of = [&](int row) {
    return std::min(
        static_cast<int>(gst_util_uint64_scale_int_round(static_cast<guint64>(row), height, e.frame_height)),
        height - 1);
  };
  rows.assign(e.boundary.begin(), e.boundary.end());
  for (std::uint16_t& row : rows)
    row = static_cast<std::uint16_t>(row >= e.frame_height ? height : row_of(row));
  e.boundary = rows;
  if (e.horizon_row >= 0)
    e.horizon_row = row_of(e.horizon_row);
  if (e.vanishing_row >= 0)
    e.vanishing_row = static_cast<std::int32_t>(
        gst_util_uint64_scale_int_round(static_cast<guint64>(e.vanishing_row), height, e.frame_height));
  e.mask_region = scaled(e.mask_region, e, width, height);
  e.window = scaled(e.window, e, width, height);
  e.frame_width = width;
  e.frame_height = height;
}

/// Pixels that the mask of a unit may have on this video.
std::int64_t most_mask_pixels(const GstVideoInfo& info) {
  const std::int64_t width = GST_VIDEO_INFO_WIDTH(&info), height = GST_VIDEO_INFO_HEIGHT(&info);
  return most_mask_per_frame * (width > 0 && height > 0 ? width * height : std::int64_t{1920} * 1080);
}

} // namespace

void UnitAttacher::set_video(GstCaps* caps) {
  if (!gst_video_info_from_caps(&info_, caps))
    gst_video_info_init(&info_);
}

std::string UnitAttacher::decode(GstBuffer* klv) {
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

GstBuffer* UnitAttacher::attach(GstBuffer* frame) {
  Estimate e = unit_.estimate();
  const int width = GST_VIDEO_INFO_WIDTH(&info_), height = GST_VIDEO_INFO_HEIGHT(&info_);
  if (width > 0 && height > 0 && (e.frame_width != width || e.frame_height != height))
    fit(e, rows_, width, height);

  const OwnedBuffer mask = masks_.acquire(e.mask.width, e.mask.height);
  const OwnedBuffer boundary = e.boundary.empty() ? nullptr : boundary_buffer(boundaries_, e.boundary);
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

void UnitAttacher::drop() {
  masks_.drop();
  boundaries_.drop();
}

} // namespace terrainseg
