// SPDX-License-Identifier: LGPL-2.1-or-later
#include "support/metric_meta.hpp"

#include <gst/terrainseg/terrainsegmeta.h>

#include <iterator>
#include <utility>

#include "support/meta.hpp"

namespace terrainseg {

using namespace fields;

namespace {

// A tick is written as its three floats.
static_assert(sizeof(RangeTick) == 3 * sizeof(float));
std::span<const float> floats_of(std::span<const RangeTick> ticks) {
  return {reinterpret_cast<const float*>(ticks.data()), ticks.size() * 3};
}

static_assert(int{GST_TERRAIN_METRIC_FLAG_POSE} == metric_flag_pose);
static_assert(int{GST_TERRAIN_METRIC_FLAG_HORIZON} == metric_flag_horizon);

} // namespace

bool MetricWriter::attach(GstBuffer* buffer, const MetricEstimate& m, const char* instance) {
  const std::pair<GQuark, std::span<const float>> columns[] = {{"ranges"_field, m.ranges},
                                                               {"bearings"_field, m.bearings},
                                                               {"low"_field, m.low},
                                                               {"high"_field, m.high},
                                                               {"ticks"_field, floats_of(m.ticks)}};
  const std::size_t count = std::size(columns) - (m.ticks.empty() ? 1 : 0);
  OwnedBuffer made[std::size(columns)];
  for (std::size_t i = 0; i < count; ++i)
    if (made[i] = filled(pool_.acquire(columns[i].second.size_bytes()), columns[i].second); !made[i])
      return false;
  GstStructure* fields =
      replace_meta(buffer, GST_TERRAIN_METRIC_META_NAME, instance, GST_TERRAIN_METRIC_META_VERSION);
  if (!fields)
    return false;
  for (std::size_t i = 0; i < count; ++i)
    set_buffer(fields, columns[i].first, made[i].get());
  set_double(fields, "height"_field, m.height);
  set_double(fields, "pitch"_field, m.pitch);
  set_double(fields, "roll"_field, m.roll);
  set_double(fields, "yaw"_field, m.yaw);
  set_double(fields, "range-min"_field, m.range_min);
  set_double(fields, "range-max"_field, m.range_max);
  set_uint(fields, "flags"_field, m.flags);
  if (m.fan.beams == 0)
    return true;
  set_double(fields, "fan-angle-min"_field, m.fan.angle_min);
  set_double(fields, "fan-increment"_field, m.fan.increment);
  set_uint(fields, "fan-beams"_field, m.fan.beams);
  set_double(fields, "fan-range-min"_field, m.fan.range_min);
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

const char* MetricReader::map(ValueReader<float>& column, GstBuffer* buffer, std::span<const float>& values) {
  if (!buffer)
    return "ranges, bearings, low or high is missing";
  if (!column.map(buffer))
    return "the metres cannot be mapped";
  values = column.values();
  return column.is_whole()
             ? nullptr
             : "ranges, bearings, low and high do not have one float each for every mask column";
}

} // namespace terrainseg
