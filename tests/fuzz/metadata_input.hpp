// SPDX-License-Identifier: LGPL-2.1-or-later
// What the fuzzers of elements that read metadata share: estimates and metres of any kind on frames, and what
// a program can write in their place.
#pragma once

#include <gst/terrainseg/terrainsegmeta.h>

#include <bit>
#include <cmath>
#include <limits>
#include <vector>

#include "element_input.hpp"
#include "support/estimate_meta.hpp"
#include "support/times.hpp"

namespace terrainseg::fuzz {

/// Names of filters; the texts that properties are set to hold the second.
inline constexpr const char* instances[] = {"", "front", "rear"};

/// Numbers that are none, or too large, or the usual.
inline double real_from(Input& in, double usual) {
  constexpr double odd[] = {NAN, HUGE_VAL, -HUGE_VAL, 1e300, -1e300, 1e-300, 0, -1, 6.2, 1e19, 3e9};
  switch (in.byte() % 16) {
  case 1:
    return odd[in.byte() % std::size(odd)];
  case 2:
    return std::bit_cast<double>(in.number(8));
  case 3:
    return in.byte() / 16.0;
  default:
    return usual;
  }
}

/// One field of a custom meta is gone, or of another type or value.
inline void damage(Input& in, GstStructure* fields) {
  const int count = gst_structure_n_fields(fields);
  if (count == 0)
    return;
  const char* const name = gst_structure_nth_field_name(fields, static_cast<guint>(in.byte() % count));
  switch (in.byte() % 8) {
  case 0:
    gst_structure_remove_field(fields, name);
    break;
  case 1:
    gst_structure_set(fields, name, G_TYPE_UINT, static_cast<guint>(in.number(4)), nullptr);
    break;
  case 2:
    gst_structure_set(fields, name, G_TYPE_UINT64, static_cast<guint64>(in.number(8)), nullptr);
    break;
  case 3:
    gst_structure_set(fields, name, G_TYPE_DOUBLE, real_from(in, in.byte()), nullptr);
    break;
  case 4:
    gst_structure_set(fields, name, G_TYPE_STRING, "front", nullptr);
    break;
  case 5: {
    GstBuffer* buffer = gst_buffer_new_allocate(nullptr, in.byte(), nullptr);
    gst_buffer_memset(buffer, 0, in.byte(), gst_buffer_get_size(buffer));
    gst_structure_set(fields, name, GST_TYPE_BUFFER, buffer, nullptr);
    gst_buffer_unref(buffer);
    break;
  }
  default:
    gst_structure_set(fields, name, G_TYPE_INT, static_cast<gint>(in.number(4)), nullptr);
    break;
  }
}

class EstimateInput {
 public:
  /// An estimate with a mask of any size up to its frame's and a level boundary. Views are valid until the
  /// next.
  Estimate masked(Input& in, std::uint64_t frame) {
    Estimate e;
    e.frame_width = in.chance(8) ? 8192 : 1 + in.byte();
    e.frame_height = in.chance(8) ? 8192 : 1 + in.byte();
    const int width = std::min(e.frame_width, 1 + in.byte()),
              height = std::min(e.frame_height, 1 + in.byte());
    pixels_.assign(static_cast<std::size_t>(width) * static_cast<std::size_t>(height),
                   in.byte() & 1 ? mask_traversable : mask_not_traversable);
    for (const std::uint8_t at : in.take(4))
      pixels_[at * 37u % pixels_.size()] = mask_doubtful;
    rows_.assign(static_cast<std::size_t>(width), static_cast<std::uint16_t>(e.frame_height / 2));
    e.mask = {{pixels_.data(), width}, width, height};
    e.mask_region = {0, 0, e.frame_width, e.frame_height};
    e.boundary = rows_;
    e.frame = frame;
    e.model_count = in.byte() % (max_models + 1);
    return e;
  }

  /// Estimates and metres on a frame of `width` x `height` (0 = any): mostly one, sound, of that size.
  void attach_to(GstBuffer* buffer, Input& in, std::uint64_t frame, int width, int height) {
    const std::uint8_t what = in.byte();
    for (int count = what % 8 == 7 ? 0 : what % 8 == 6 ? 2 : 1; count > 0; --count) {
      const char* const instance = instances[in.byte() % 8 < 5 ? 0 : in.byte() % std::size(instances)];
      const Estimate e = any(in, frame, width, height);
      attach_estimate(buffer, in, e, instance);
      if (what & 8)
        attach_metres(buffer, in, in.chance(16) ? 1u + in.byte() : e.boundary.size(), instance);
    }
    for (const char* name : {GST_TERRAIN_SEG_META_NAME, GST_TERRAIN_METRIC_META_NAME})
      if (GstCustomMeta* meta = in.chance(8) ? gst_buffer_get_custom_meta(buffer, name) : nullptr)
        damage(in, gst_custom_meta_get_structure(meta));
  }

 private:
  Rectangle rectangle(Input& in) { return {in.byte(), in.byte(), in.byte(), in.byte()}; }

  Estimate any(Input& in, std::uint64_t frame, int width, int height) {
    Estimate e = masked(in, frame);
    if (width > 0 && !in.chance(4)) {
      e.frame_width = width;
      e.frame_height = height;
      e.mask_region = {0, 0, width, height};
    }
    const std::uint8_t what = in.byte();
    if (what & 1)
      e.mask_region = rectangle(in);
    if (what & 2)
      e.window = rectangle(in);
    if (what & 4) {
      e.horizon_row = in.byte() - 1;
      e.horizon_confidence = in.byte();
    }
    if (what & 8) {
      e.vanishing_row = static_cast<std::int32_t>(in.number(in.chance(4) ? 4 : 3));
      e.speed_over_height = static_cast<std::int32_t>(in.number(4));
    }
    if (what & 16) {
      e.flags = in.byte();
      e.confidence = in.byte();
      e.traversable_permille = in.below(1001);
      e.model_generation = static_cast<std::uint32_t>(in.number(4));
    }
    for (int i = 0; what & 32 && i < e.model_count; ++i) {
      ModelSummary& model = e.models[static_cast<std::size_t>(i)];
      model.mean[0] = static_cast<std::uint16_t>(in.number(2));
      model.variance[2] = static_cast<std::uint32_t>(in.number(4));
      model.mass = in.number(in.chance(2) ? 8 : 2);
      model.rgb = {in.byte(), in.byte(), in.byte()};
    }
    const int rows = in.chance(32) ? 65536 : e.frame_height + 1;
    for (std::size_t i = 0; what & 64 && i < rows_.size(); ++i)
      rows_[i] = static_cast<std::uint16_t>(i % 8 ? rows_[i - 1] : in.below(rows));
    if (!(what & 64) && e.frame_height / 2 != rows_[0])
      rows_.assign(rows_.size(), static_cast<std::uint16_t>(e.frame_height / 2));
    e.boundary = rows_;
    with_map_ = what & 128;
    return e;
  }

  /// Its memory holds nothing but values of masks, whatever its meta says of rows.
  static OwnedBuffer mask_buffer(Input& in, const GrayView& mask) {
    const bool plain = !in.chance(4);
    const int stride = mask.width + (plain ? 0 : in.byte());
    gsize offset[GST_VIDEO_MAX_PLANES] = {plain ? gsize{0} : in.byte()};
    const gsize size = offset[0] + static_cast<gsize>(stride) * static_cast<gsize>(mask.height);
    GstBuffer* buffer = gst_buffer_new_allocate(nullptr, size, nullptr);
    gst_buffer_memset(buffer, 0, mask_doubtful, size);
    for (int y = 0; y < mask.height; ++y)
      gst_buffer_fill(buffer, offset[0] + static_cast<gsize>(y) * static_cast<gsize>(stride),
                      mask.plane.row(y), static_cast<gsize>(mask.width));
    if (in.chance(8) && size > 2) {
      GstBuffer* rest = gst_buffer_copy_region(buffer, GST_BUFFER_COPY_MEMORY, size / 2, size - size / 2);
      gst_buffer_resize(buffer, 0, static_cast<gssize>(size / 2));
      buffer = gst_buffer_append(buffer, rest);
    }
    const bool lies = in.chance(16);
    gint strides[GST_VIDEO_MAX_PLANES] = {lies && in.chance(2) ? static_cast<gint>(in.number(4)) : stride};
    if (lies && in.chance(2))
      offset[0] = in.number(in.chance(2) ? 8 : 2);
    const GstVideoFormat format = lies && in.chance(4) ? GST_VIDEO_FORMAT_RGB : GST_VIDEO_FORMAT_GRAY8;
    const guint width = static_cast<guint>(mask.width) + (lies ? in.byte() : 0u);
    const guint height = static_cast<guint>(mask.height) + (lies ? in.byte() : 0u);
    gst_buffer_add_video_meta_full(buffer, GST_VIDEO_FRAME_FLAG_NONE, format, width, height, 1, offset,
                                   strides);
    return OwnedBuffer(buffer);
  }

  /// Rows as they are, or cut, or at an odd address.
  static OwnedBuffer row_buffer(Input& in, std::span<const std::uint16_t> rows) {
    OwnedBuffer buffer(new_boundary_buffer(rows));
    switch (in.byte() % 16) {
    case 1:
      gst_buffer_resize(buffer.get(), 0,
                        static_cast<gssize>(in.below(static_cast<int>(rows.size() * 2 + 1))));
      break;
    case 2: {
      GstBuffer* odd = gst_buffer_new_allocate(nullptr, rows.size() * 2 + 1, nullptr);
      gst_buffer_resize(odd, 1, -1);
      GstMapInfo map;
      require(gst_buffer_map(buffer.get(), &map, GST_MAP_READ));
      gst_buffer_fill(odd, 0, map.data, map.size);
      gst_buffer_unmap(buffer.get(), &map);
      buffer.reset(odd);
      break;
    }
    default:
      break;
    }
    return buffer;
  }

  void attach_estimate(GstBuffer* buffer, Input& in, const Estimate& e, const char* instance) {
    const OwnedBuffer mask = in.chance(16) ? nullptr : mask_buffer(in, e.mask),
                      boundary = in.chance(16) ? nullptr : row_buffer(in, e.boundary),
                      map = with_map_ ? mask_buffer(in, e.mask) : nullptr;
    require(attach(buffer, e, mask.get(), boundary.get(), instance, map.get()));
  }

  void attach_metres(GstBuffer* buffer, Input& in, std::size_t columns, const char* instance) {
    constexpr float none = std::numeric_limits<float>::quiet_NaN(),
                    far = std::numeric_limits<float>::infinity();
    constexpr float odd[] = {none, far, -far, 3e38F, -1, 1e-40F, 0};
    const std::uint8_t what = in.byte();
    const float first = what & 1 ? static_cast<float>(in.byte() - 128) / 40 : 0.5F,
                step = what & 2 ? static_cast<float>(in.byte()) / 2048 : 0.01F;
    for (auto* values : {&ranges_, &bearings_, &low_, &high_})
      values->resize(columns);
    for (std::size_t i = 0; i < columns; ++i) {
      bearings_[i] = first - static_cast<float>(i) * step;
      ranges_[i] = i % 16 == 0 ? static_cast<float>(in.byte()) / 16 : ranges_[i - 1];
      if (i % 16 == 5 && what & 4)
        (in.byte() & 1 ? ranges_ : bearings_)[i] = odd[in.byte() % std::size(odd)];
      low_[i] = ranges_[i] * 0.9F;
      high_[i] = ranges_[i] * 1.1F;
    }
    ticks_.clear();
    for (int i = what & 8 ? in.byte() % 40 : 0; i > 0; --i)
      ticks_.push_back({static_cast<float>(in.byte()) / 8, static_cast<float>(in.byte()) / 250,
                        static_cast<float>(in.byte()) / 250});
    MetricEstimate m;
    m.ranges = ranges_;
    m.bearings = bearings_;
    m.low = low_;
    m.high = high_;
    m.ticks = ticks_;
    m.height = real_from(in, 0.5);
    m.pitch = real_from(in, 0.3);
    m.roll = real_from(in, 0);
    m.yaw = real_from(in, 0.1);
    m.range_min = real_from(in, 0.4);
    m.range_max = real_from(in, 8);
    m.flags = in.byte();
    require(metres_.attach(buffer, m, instance));
  }

  std::vector<std::uint8_t> pixels_;
  std::vector<std::uint16_t> rows_;
  bool with_map_ = false;
  std::vector<float> ranges_, bearings_, low_, high_;
  std::vector<RangeTick> ticks_;
  MetricWriter metres_;
};

/// What a camera, a network or a parser noted of a frame's time.
inline void note_times(GstBuffer* buffer, Input& in, GstClockTime usual) {
  static constexpr const char* clocks[] = {"timestamp/x-unix", "timestamp/x-ntp", "timestamp/x-camera"};
  if (in.chance(4)) {
    const GstClockTime time = time_from(in, usual + G_GUINT64_CONSTANT(1764000000000000000));
    GstCaps* clock = gst_caps_new_empty_simple(clocks[in.byte() % std::size(clocks)]);
    if (GST_CLOCK_TIME_IS_VALID(time))
      gst_buffer_add_reference_timestamp_meta(buffer, clock, time, GST_CLOCK_TIME_NONE);
    gst_caps_unref(clock);
  }
  if (in.chance(8))
    note_stamp(buffer, VideoCodec::h264, in.number(in.chance(4) ? 8 : 5));
}

/// The times of frame `index` of a video.
inline void set_times(GstBuffer* buffer, Input& in, std::uint64_t index) {
  constexpr GstClockTime each = 33 * GST_MSECOND;
  GST_BUFFER_PTS(buffer) = time_from(in, index * each);
  GST_BUFFER_DURATION(buffer) = time_from(in, each);
  if (in.chance(4))
    GST_BUFFER_DTS(buffer) = time_from(in, index * each);
  note_times(buffer, in, index * each);
}

} // namespace terrainseg::fuzz
