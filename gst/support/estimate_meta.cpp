// SPDX-License-Identifier: LGPL-2.1-or-later
#include "support/estimate_meta.hpp"

#include <gst/terrainseg/terrainsegmeta.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <utility>

#include "support/meta.hpp"

namespace terrainseg {
namespace {

template <std::size_t size> struct FieldName {
  char text[size];
  consteval FieldName(const char (&name)[size]) { std::copy_n(name, size, text); }
};
/// The quark of a field's name, looked up once.
template <FieldName name> GQuark operator""_field() {
  static const GQuark quark = g_quark_from_static_string(name.text);
  return quark;
}

/// Sets a field by its quark, which is faster than variadic calls with names.
template <class Store> void set(GstStructure* fields, GQuark name, GType type, Store store) {
  GValue value = G_VALUE_INIT;
  g_value_init(&value, type);
  store(&value);
  gst_structure_id_take_value(fields, name, &value);
}
template <GType type, auto store, class Number> void set_number(GstStructure* fields, GQuark name, Number v) {
  set(fields, name, type, [&](GValue* value) { store(value, v); });
}
constexpr auto set_int = set_number<G_TYPE_INT, g_value_set_int, int>;
constexpr auto set_uint = set_number<G_TYPE_UINT, g_value_set_uint, guint>;
constexpr auto set_uint64 = set_number<G_TYPE_UINT64, g_value_set_uint64, guint64>;
constexpr auto set_double = set_number<G_TYPE_DOUBLE, g_value_set_double, double>;
/// Nothing for nullptr. The structure takes its own reference.
void set_buffer(GstStructure* fields, GQuark name, GstBuffer* v) {
  if (v)
    set(fields, name, GST_TYPE_BUFFER, [&](GValue* value) { g_value_set_boxed(value, v); });
}

/// Adds the custom meta `name` of the filter `instance` (static or interned) instead of those that it has,
/// with its version. Returns its fields; nullptr if the meta is not registered.
GstStructure* replace_meta(GstBuffer* buffer, const char* name, const char* instance, guint version) {
  if (!gst_meta_get_info(name))
    return nullptr;
  remove_metas(buffer, name, instance);
  GstCustomMeta* meta = gst_buffer_add_custom_meta(buffer, name);
  GstStructure* fields = meta ? gst_custom_meta_get_structure(meta) : nullptr;
  if (fields)
    set_uint(fields, "version"_field, version);
  if (fields && *instance)
    set(fields, "instance"_field, G_TYPE_STRING,
        [&](GValue* value) { g_value_set_static_string(value, instance); });
  return fields;
}

template <class Fixed> void set_triple(GstStructure* fields, GQuark name, const std::array<Fixed, 3>& q8) {
  set(fields, name, GST_TYPE_ARRAY, [&](GValue* array) {
    for (Fixed component : q8) {
      GValue value = G_VALUE_INIT;
      g_value_init(&value, G_TYPE_DOUBLE);
      g_value_set_double(&value, component / 256.0);
      gst_value_array_append_and_take_value(array, &value);
    }
  });
}

void set_models(GstStructure* fields, const Estimate& estimate) {
  set(fields, "models"_field, GST_TYPE_LIST, [&](GValue* list) {
    for (int i = 0; i < estimate.model_count; ++i) {
      const ModelSummary& summary = estimate.models[i];
      GstStructure* model = gst_structure_new_empty("model");
      set_triple(model, "mean"_field, summary.mean);
      set_triple(model, "variance"_field, summary.variance);
      set_uint64(model, "mass"_field, summary.mass);
      set_uint(model, "rgb"_field, summary.rgb[0] << 16 | summary.rgb[1] << 8 | summary.rgb[2]);
      GValue value = G_VALUE_INIT;
      g_value_init(&value, GST_TYPE_STRUCTURE);
      g_value_take_boxed(&value, model);
      gst_value_list_append_and_take_value(list, &value);
    }
  });
}

template <class Fixed> void get_triple(const GstStructure* fields, GQuark name, std::array<Fixed, 3>& q8) {
  const GValue* array = gst_structure_id_get_value(fields, name);
  if (!array || !GST_VALUE_HOLDS_ARRAY(array))
    return;
  for (guint i = 0; i < std::min(3u, gst_value_array_get_size(array)); ++i) {
    const GValue* value = gst_value_array_get_value(array, i);
    if (!G_VALUE_HOLDS_DOUBLE(value))
      continue;
    const double fixed = std::nearbyint(g_value_get_double(value) * 256);
    if (fixed >= 0 && fixed <= std::numeric_limits<Fixed>::max())
      q8[i] = static_cast<Fixed>(fixed);
  }
}

/// An optional field in Q16.
std::int32_t get_q16(const GstStructure* fields, GQuark name, std::int32_t otherwise) {
  double value = 0;
  if (!gst_structure_id_get(fields, name, G_TYPE_DOUBLE, &value, nullptr) || !(std::abs(value) < 32767))
    return otherwise;
  return static_cast<std::int32_t>(std::lround(value * 65536));
}

void get_models(const GstStructure* fields, Estimate& estimate) {
  const guint count = std::min<guint>(gst_terrain_seg_meta_get_model_count(fields), max_models);
  for (guint i = 0; i < count; ++i) {
    const GstStructure* model = gst_terrain_seg_meta_get_model(fields, i);
    if (!model)
      continue;
    ModelSummary& summary = estimate.models[estimate.model_count++];
    get_triple(model, "mean"_field, summary.mean);
    get_triple(model, "variance"_field, summary.variance);
    guint64 mass = 0;
    if (gst_structure_id_get(model, "mass"_field, G_TYPE_UINT64, &mass, nullptr))
      summary.mass = mass;
    guint rgb = 0;
    if (gst_structure_id_get(model, "rgb"_field, G_TYPE_UINT, &rgb, nullptr))
      summary.rgb = {static_cast<std::uint8_t>(rgb >> 16), static_cast<std::uint8_t>(rgb >> 8),
                     static_cast<std::uint8_t>(rgb)};
  }
}

// A tick is written as its three floats.
static_assert(sizeof(RangeTick) == 3 * sizeof(float));
std::span<const float> floats_of(std::span<const RangeTick> ticks) {
  return {reinterpret_cast<const float*>(ticks.data()), ticks.size() * 3};
}

// The C header and the core name the same bits and values.
static_assert(int{GST_TERRAIN_SEG_FLAG_LEARNED} == flag_learned);
static_assert(int{GST_TERRAIN_SEG_FLAG_FROZEN} == flag_frozen);
static_assert(int{GST_TERRAIN_SEG_FLAG_STARVED} == flag_starved);
static_assert(int{GST_TERRAIN_SEG_FLAG_UNKNOWN} == flag_unknown);
static_assert(int{GST_TERRAIN_SEG_FLAG_HORIZON_HELD} == flag_horizon_held);
static_assert(int{GST_TERRAIN_SEG_FLAG_BLOCKED} == flag_blocked);
static_assert(int{GST_TERRAIN_SEG_FLAG_WINDOW_STILL} == flag_window_still);
static_assert(int{GST_TERRAIN_METRIC_FLAG_POSE} == metric_flag_pose);
static_assert(int{GST_TERRAIN_METRIC_FLAG_HORIZON} == metric_flag_horizon);
static_assert(int{GST_TERRAIN_SEG_NOT_TRAVERSABLE} == mask_not_traversable);
static_assert(int{GST_TERRAIN_SEG_DOUBTFUL} == mask_doubtful);
static_assert(int{GST_TERRAIN_SEG_TRAVERSABLE} == mask_traversable);

} // namespace

bool attach(GstBuffer* buffer, const Estimate& e, GstBuffer* mask, GstBuffer* boundary, const char* instance,
            GstBuffer* confidence_map) {
  GstStructure* fields =
      replace_meta(buffer, GST_TERRAIN_SEG_META_NAME, instance, GST_TERRAIN_SEG_META_VERSION);
  if (!fields)
    return false;
  set_uint64(fields, "frame"_field, e.frame);
  set_int(fields, "frame-width"_field, e.frame_width);
  set_int(fields, "frame-height"_field, e.frame_height);
  set_int(fields, "horizon-row"_field, e.horizon_row);
  set_uint(fields, "horizon-confidence"_field, e.horizon_confidence);
  set_double(fields, "vanishing-row"_field, e.vanishing_row < 0 ? -1 : e.vanishing_row / 65536.0);
  set_double(fields, "speed-over-height"_field, e.speed_over_height / 65536.0);
  set_buffer(fields, "mask"_field, mask);
  set_uint(fields, "confidence"_field, e.confidence);
  set_buffer(fields, "confidence-map"_field, confidence_map);
  set_int(fields, "mask-x"_field, e.mask_region.x);
  set_int(fields, "mask-y"_field, e.mask_region.y);
  set_int(fields, "mask-w"_field, e.mask_region.width);
  set_int(fields, "mask-h"_field, e.mask_region.height);
  set_buffer(fields, "boundary"_field, boundary);
  set_uint(fields, "traversable-permille"_field, e.traversable_permille);
  set_int(fields, "window-x"_field, e.window.x);
  set_int(fields, "window-y"_field, e.window.y);
  set_int(fields, "window-w"_field, e.window.width);
  set_int(fields, "window-h"_field, e.window.height);
  set_uint(fields, "model-generation"_field, e.model_generation);
  set_uint(fields, "flags"_field, e.flags);
  set_models(fields, e);
  return true;
}

GstBuffer* new_mask_buffer(int width, int height) {
  GstBuffer* buffer = gst_buffer_new_allocate(nullptr, static_cast<gsize>(width) * height, nullptr);
  if (buffer)
    describe_mask(buffer, width, height);
  return buffer;
}

GstBuffer* new_boundary_buffer(std::span<const std::uint16_t> rows) {
  return filled(OwnedBuffer(gst_buffer_new_allocate(nullptr, rows.size() * 2, nullptr)), rows).release();
}

EstimateReader::EstimateReader(GstBuffer* buffer, const char* source) {
  const GstStructure* fields = gst_buffer_get_terrain_seg_structure_of(buffer, *source ? source : nullptr);
  if (!fields)
    return;
  error_ = read(fields);
  valid_ = !error_;
}

const char* EstimateReader::read(const GstStructure* fields) {
  Estimate& e = estimate_;
  e.frame = gst_terrain_seg_meta_get_frame(fields);
  e.frame_width = gst_terrain_seg_meta_get_frame_width(fields);
  e.frame_height = gst_terrain_seg_meta_get_frame_height(fields);
  e.horizon_row = gst_terrain_seg_meta_get_horizon_row(fields);
  e.vanishing_row = std::max(get_q16(fields, "vanishing-row"_field, -1), -1);
  e.speed_over_height = get_q16(fields, "speed-over-height"_field, 0);
  e.horizon_confidence =
      static_cast<std::uint8_t>(std::min(gst_terrain_seg_meta_get_horizon_confidence(fields), 255u));
  e.confidence = static_cast<std::uint8_t>(std::min(gst_terrain_seg_meta_get_confidence(fields), 255u));
  e.traversable_permille =
      static_cast<int>(std::min(gst_terrain_seg_meta_get_traversable_permille(fields), 1000u));
  e.model_generation = gst_terrain_seg_meta_get_model_generation(fields);
  e.flags = gst_terrain_seg_meta_get_flags(fields);
  GstVideoRectangle r{};
  gst_terrain_seg_meta_get_mask_region(fields, &r);
  e.mask_region = {r.x, r.y, r.w, r.h};
  gst_terrain_seg_meta_get_window(fields, &r);
  e.window = {r.x, r.y, r.w, r.h};
  get_models(fields, e);
  if (GstBuffer* mask = gst_terrain_seg_meta_get_mask(fields)) {
    e.mask = mask_.emplace(mask).view();
    if (mask_->error())
      return mask_->error();
  }
  if (GstBuffer* boundary = gst_terrain_seg_meta_get_boundary(fields)) {
    if (!boundary_.map(boundary))
      return "the boundary cannot be mapped";
    e.boundary = boundary_.values();
    if (!boundary_.is_whole() || e.boundary.size() > longest_picture_side)
      return "the boundary does not have one uint16 per mask column";
  }
  if (GstBuffer* map = gst_terrain_seg_meta_get_confidence_map(fields)) {
    e.confidence_map = confidence_map_.emplace(map).view();
    if (confidence_map_->error())
      return "the confidence map is not one GRAY8 memory of the size in its GstVideoMeta";
  }
  return flaw_of(e);
}

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
  std::span<const float> ticks;
  const std::pair<GstBuffer*, std::span<const float>*> wanted[] = {
      {gst_terrain_metric_meta_get_ranges(fields), &metric_.ranges},
      {gst_terrain_metric_meta_get_bearings(fields), &metric_.bearings},
      {gst_terrain_metric_meta_get_low(fields), &metric_.low},
      {gst_terrain_metric_meta_get_high(fields), &metric_.high},
      {gst_terrain_metric_meta_get_ticks(fields), &ticks}};
  for (std::size_t i = 0; i < columns_.size(); ++i) {
    const auto& [buffer, values] = wanted[i];
    if (!buffer && values == &ticks)
      break;
    if (!buffer)
      return "ranges, bearings, low or high is missing";
    if (!columns_[i].map(buffer))
      return "the metres cannot be mapped";
    if (!columns_[i].is_whole())
      return "ranges, bearings, low and high do not have one float each for every mask column";
    *values = columns_[i].values();
  }
  if (ticks.size() % 3 || ticks.size() / 3 > ticks_.size())
    return "ticks are not three floats each, or too many";
  for (std::size_t i = 0; i < ticks.size() / 3; ++i)
    ticks_[i] = {ticks[3 * i], ticks[3 * i + 1], ticks[3 * i + 2]};
  metric_.ticks = {ticks_.data(), ticks.size() / 3};
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

} // namespace terrainseg
