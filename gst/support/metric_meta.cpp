// SPDX-License-Identifier: LGPL-2.1-or-later
#include "support/metric_meta.hpp"

#include <gst/terrainseg/terrainsegmeta.h>

#include <bit>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <iterator>
#include <utility>

#include "support/meta.hpp"
#include "support/meta_fields.hpp"

namespace terrainseg {

using namespace fields;

namespace {

/// Names as quarks, created once.
struct Names {
#define NAME(member, text) GQuark member = g_quark_from_static_string(text)
  NAME(version, "version");
  NAME(instance, "instance");
  NAME(ranges, "ranges");
  NAME(bearings, "bearings");
  NAME(low, "low");
  NAME(high, "high");
  NAME(ticks, "ticks");
  NAME(height, "height");
  NAME(pitch, "pitch");
  NAME(roll, "roll");
  NAME(yaw, "yaw");
  NAME(range_min, "range-min");
  NAME(range_max, "range-max");
  NAME(flags, "flags");
  NAME(fan_angle_min, "fan-angle-min");
  NAME(fan_increment, "fan-increment");
  NAME(fan_beams, "fan-beams");
  NAME(fan_range_min, "fan-range-min");
#undef NAME
  static const Names& get() {
    static const Names names;
    return names;
  }
};

OwnedBuffer floats(SmallPool& pool, std::span<const float> values) {
  OwnedBuffer buffer = pool.acquire(values.size() * 4);
  GstMapInfo map;
  if (!buffer || !gst_buffer_map(buffer.get(), &map, GST_MAP_WRITE))
    return nullptr;
  for (std::size_t i = 0; i < values.size(); ++i)
    GST_WRITE_FLOAT_LE(map.data + 4 * i, values[i]);
  gst_buffer_unmap(buffer.get(), &map);
  return buffer;
}

// A tick is written as its three floats.
static_assert(sizeof(RangeTick) == 3 * sizeof(float));
std::span<const float> floats_of(std::span<const RangeTick> ticks) {
  return {reinterpret_cast<const float*>(ticks.data()), ticks.size() * 3};
}

static_assert(int{GST_TERRAIN_METRIC_FLAG_POSE} == metric_flag_pose);
static_assert(int{GST_TERRAIN_METRIC_FLAG_HORIZON} == metric_flag_horizon);

} // namespace

bool MetricWriter::attach(GstBuffer* buffer, const MetricEstimate& m, const char* instance) {
  if (!gst_meta_get_info(GST_TERRAIN_METRIC_META_NAME))
    return false;
  const Names& n = Names::get();
  const std::pair<GQuark, std::span<const float>> columns[] = {{n.ranges, m.ranges},
                                                               {n.bearings, m.bearings},
                                                               {n.low, m.low},
                                                               {n.high, m.high},
                                                               {n.ticks, floats_of(m.ticks)}};
  const std::size_t count = std::size(columns) - (m.ticks.empty() ? 1 : 0);
  OwnedBuffer made[std::size(columns)];
  for (std::size_t i = 0; i < count; ++i)
    if (made[i] = floats(pool_, columns[i].second); !made[i])
      return false;
  remove_metas(buffer, GST_TERRAIN_METRIC_META_NAME, instance);
  GstCustomMeta* meta = gst_buffer_add_custom_meta(buffer, GST_TERRAIN_METRIC_META_NAME);
  if (!meta)
    return false;
  GstStructure* fields = gst_custom_meta_get_structure(meta);
  set_uint(fields, n.version, GST_TERRAIN_METRIC_META_VERSION);
  if (*instance)
    set_static_string(fields, n.instance, instance);
  for (std::size_t i = 0; i < count; ++i)
    set_buffer(fields, columns[i].first, made[i].get());
  set_double(fields, n.height, m.height);
  set_double(fields, n.pitch, m.pitch);
  set_double(fields, n.roll, m.roll);
  set_double(fields, n.yaw, m.yaw);
  set_double(fields, n.range_min, m.range_min);
  set_double(fields, n.range_max, m.range_max);
  set_uint(fields, n.flags, m.flags);
  if (m.fan.beams == 0)
    return true;
  set_double(fields, n.fan_angle_min, m.fan.angle_min);
  set_double(fields, n.fan_increment, m.fan.increment);
  set_uint(fields, n.fan_beams, m.fan.beams);
  set_double(fields, n.fan_range_min, m.fan.range_min);
  return true;
}

MetricReader::MetricReader(GstBuffer* buffer, const char* source) {
  const GstStructure* estimate = gst_buffer_get_terrain_seg_structure_of(buffer, *source ? source : nullptr);
  const char* instance = *source ? source : nullptr;
  if (estimate) {
    const char* its = gst_terrain_seg_meta_get_instance(estimate);
    instance = its ? its : "";
  }
  const GstStructure* fields = gst_buffer_get_terrain_metric_structure(buffer, instance);
  if (!fields)
    return;
  error_ = read(fields);
  GstBuffer* boundary = estimate ? gst_terrain_seg_meta_get_boundary(estimate) : nullptr;
  if (!error_ && boundary && gst_buffer_get_size(boundary) / 2 != metric_.ranges.size())
    error_ = "the metres do not have one value for every column of the boundary";
  valid_ = !error_;
}

MetricReader::~MetricReader() {
  for (Column& column : columns_) {
    if (column.map.memory)
      gst_buffer_unmap(column.buffer, &column.map);
    gst_clear_buffer(&column.buffer);
  }
}

const char* MetricReader::read(const GstStructure* fields) {
  const std::pair<GstBuffer*, std::span<const float>*> wanted[] = {
      {gst_terrain_metric_meta_get_ranges(fields), &metric_.ranges},
      {gst_terrain_metric_meta_get_bearings(fields), &metric_.bearings},
      {gst_terrain_metric_meta_get_low(fields), &metric_.low},
      {gst_terrain_metric_meta_get_high(fields), &metric_.high}};
  for (std::size_t i = 0; i < 4; ++i)
    if (const char* error = map(columns_[i], wanted[i].first, *wanted[i].second))
      return error;
  if (const char* error = read_ticks(fields))
    return error;
  metric_.height = gst_terrain_metric_meta_get_height(fields);
  metric_.pitch = gst_terrain_metric_meta_get_pitch(fields);
  metric_.roll = gst_terrain_metric_meta_get_roll(fields);
  metric_.yaw = gst_terrain_metric_meta_get_yaw(fields);
  metric_.range_min = gst_terrain_metric_meta_get_range_min(fields);
  metric_.range_max = gst_terrain_metric_meta_get_range_max(fields);
  metric_.flags = gst_terrain_metric_meta_get_flags(fields);
  metric_.fan = {
      gst_terrain_metric_meta_get_fan_angle_min(fields), gst_terrain_metric_meta_get_fan_increment(fields),
      gst_terrain_metric_meta_get_fan_beams(fields), gst_terrain_metric_meta_get_fan_range_min(fields)};
  return flaw_of(metric_);
}

const char* MetricReader::read_ticks(const GstStructure* fields) {
  GstBuffer* const ticks = gst_terrain_metric_meta_get_ticks(fields);
  if (!ticks)
    return nullptr;
  std::span<const float> values;
  if (const char* error = map(columns_[4], ticks, values))
    return error;
  if (values.size() % 3 || values.size() / 3 > ticks_.size())
    return "ticks are not three floats each, or too many";
  for (std::size_t i = 0; i < values.size() / 3; ++i)
    ticks_[i] = {values[3 * i], values[3 * i + 1], values[3 * i + 2]};
  metric_.ticks = {ticks_.data(), values.size() / 3};
  return nullptr;
}

const char* MetricReader::map(Column& column, GstBuffer* buffer, std::span<const float>& values) {
  if (!buffer)
    return "ranges, bearings, low or high is missing";
  column.buffer = gst_buffer_ref(buffer);
  if (!gst_buffer_map(buffer, &column.map, GST_MAP_READ))
    return "the metres cannot be mapped";
  if (column.map.size % 4)
    return "ranges, bearings, low and high do not have one float each for every mask column";
  const std::size_t count = column.map.size / 4;
  const guint8* data = column.map.data;
  if (std::endian::native == std::endian::little &&
      reinterpret_cast<std::uintptr_t>(data) % alignof(float) == 0) {
    values = {reinterpret_cast<const float*>(data), count};
    return nullptr;
  }
  column.host_order.resize(count);
  std::memcpy(column.host_order.data(), data, count * 4);
  for (float& value : column.host_order)
    value = GFLOAT_FROM_LE(value);
  values = column.host_order;
  return nullptr;
}

} // namespace terrainseg
