// SPDX-License-Identifier: LGPL-2.1-or-later
#include "support/estimate_meta.hpp"

#include <gst/terrainseg/terrainsegmeta.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>

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
  NAME(frame, "frame");
  NAME(frame_width, "frame-width");
  NAME(frame_height, "frame-height");
  NAME(horizon_row, "horizon-row");
  NAME(horizon_confidence, "horizon-confidence");
  NAME(vanishing_row, "vanishing-row");
  NAME(speed_over_height, "speed-over-height");
  NAME(mask, "mask");
  NAME(confidence, "confidence");
  NAME(confidence_map, "confidence-map");
  NAME(mask_x, "mask-x");
  NAME(mask_y, "mask-y");
  NAME(mask_w, "mask-w");
  NAME(mask_h, "mask-h");
  NAME(boundary, "boundary");
  NAME(traversable, "traversable-permille");
  NAME(window_x, "window-x");
  NAME(window_y, "window-y");
  NAME(window_w, "window-w");
  NAME(window_h, "window-h");
  NAME(generation, "model-generation");
  NAME(flags, "flags");
  NAME(models, "models");
  NAME(mean, "mean");
  NAME(variance, "variance");
  NAME(mass, "mass");
  NAME(rgb, "rgb");
#undef NAME
  static const Names& get() {
    static const Names names;
    return names;
  }
};

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
  const Names& n = Names::get();
  set(fields, n.models, GST_TYPE_LIST, [&](GValue* list) {
    for (int i = 0; i < estimate.model_count; ++i) {
      const ModelSummary& summary = estimate.models[i];
      GstStructure* model = gst_structure_new_empty("model");
      set_triple(model, n.mean, summary.mean);
      set_triple(model, n.variance, summary.variance);
      set_uint64(model, n.mass, summary.mass);
      set_uint(model, n.rgb, summary.rgb[0] << 16 | summary.rgb[1] << 8 | summary.rgb[2]);
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
  const Names& n = Names::get();
  const guint count = std::min<guint>(gst_terrain_seg_meta_get_model_count(fields), max_models);
  for (guint i = 0; i < count; ++i) {
    const GstStructure* model = gst_terrain_seg_meta_get_model(fields, i);
    if (!model)
      continue;
    ModelSummary& summary = estimate.models[estimate.model_count++];
    get_triple(model, n.mean, summary.mean);
    get_triple(model, n.variance, summary.variance);
    guint64 mass = 0;
    if (gst_structure_id_get(model, n.mass, G_TYPE_UINT64, &mass, nullptr))
      summary.mass = mass;
    guint rgb = 0;
    if (gst_structure_id_get(model, n.rgb, G_TYPE_UINT, &rgb, nullptr))
      summary.rgb = {static_cast<std::uint8_t>(rgb >> 16), static_cast<std::uint8_t>(rgb >> 8),
                     static_cast<std::uint8_t>(rgb)};
  }
}

// The C header and the core name the same bits and values.
static_assert(int{GST_TERRAIN_SEG_FLAG_LEARNED} == flag_learned);
static_assert(int{GST_TERRAIN_SEG_FLAG_FROZEN} == flag_frozen);
static_assert(int{GST_TERRAIN_SEG_FLAG_STARVED} == flag_starved);
static_assert(int{GST_TERRAIN_SEG_FLAG_UNKNOWN} == flag_unknown);
static_assert(int{GST_TERRAIN_SEG_FLAG_HORIZON_HELD} == flag_horizon_held);
static_assert(int{GST_TERRAIN_SEG_FLAG_BLOCKED} == flag_blocked);
static_assert(int{GST_TERRAIN_SEG_FLAG_WINDOW_STILL} == flag_window_still);
static_assert(int{GST_TERRAIN_SEG_NOT_TRAVERSABLE} == mask_not_traversable);
static_assert(int{GST_TERRAIN_SEG_DOUBTFUL} == mask_doubtful);
static_assert(int{GST_TERRAIN_SEG_TRAVERSABLE} == mask_traversable);

} // namespace

bool attach(GstBuffer* buffer, const Estimate& e, GstBuffer* mask, GstBuffer* boundary, const char* instance,
            GstBuffer* confidence_map) {
  if (!gst_meta_get_info(GST_TERRAIN_SEG_META_NAME))
    return false;
  remove_metas(buffer, GST_TERRAIN_SEG_META_NAME, instance);
  GstCustomMeta* meta = gst_buffer_add_custom_meta(buffer, GST_TERRAIN_SEG_META_NAME);
  if (!meta)
    return false;
  const Names& n = Names::get();
  GstStructure* fields = gst_custom_meta_get_structure(meta);
  set_uint(fields, n.version, GST_TERRAIN_SEG_META_VERSION);
  if (*instance)
    set_static_string(fields, n.instance, instance);
  set_uint64(fields, n.frame, e.frame);
  set_int(fields, n.frame_width, e.frame_width);
  set_int(fields, n.frame_height, e.frame_height);
  set_int(fields, n.horizon_row, e.horizon_row);
  set_uint(fields, n.horizon_confidence, e.horizon_confidence);
  set_double(fields, n.vanishing_row, e.vanishing_row < 0 ? -1 : e.vanishing_row / 65536.0);
  set_double(fields, n.speed_over_height, e.speed_over_height / 65536.0);
  if (mask)
    set_buffer(fields, n.mask, mask);
  set_uint(fields, n.confidence, e.confidence);
  if (confidence_map)
    set_buffer(fields, n.confidence_map, confidence_map);
  set_int(fields, n.mask_x, e.mask_region.x);
  set_int(fields, n.mask_y, e.mask_region.y);
  set_int(fields, n.mask_w, e.mask_region.width);
  set_int(fields, n.mask_h, e.mask_region.height);
  if (boundary)
    set_buffer(fields, n.boundary, boundary);
  set_uint(fields, n.traversable, e.traversable_permille);
  set_int(fields, n.window_x, e.window.x);
  set_int(fields, n.window_y, e.window.y);
  set_int(fields, n.window_w, e.window.width);
  set_int(fields, n.window_h, e.window.height);
  set_uint(fields, n.generation, e.model_generation);
  set_uint(fields, n.flags, e.flags);
  set_models(fields, e);
  return true;
}

GstVideoMeta* describe_mask(GstBuffer* buffer, int width, int height) {
  // Rows without padding, because programs may read a mask as width * height bytes.
  gsize offset[GST_VIDEO_MAX_PLANES] = {};
  gint stride[GST_VIDEO_MAX_PLANES] = {width};
  return gst_buffer_add_video_meta_full(buffer, GST_VIDEO_FRAME_FLAG_NONE, GST_VIDEO_FORMAT_GRAY8, width,
                                        height, 1, offset, stride);
}

GstBuffer* new_mask_buffer(int width, int height) {
  GstBuffer* buffer = gst_buffer_new_allocate(nullptr, static_cast<gsize>(width) * height, nullptr);
  if (buffer)
    describe_mask(buffer, width, height);
  return buffer;
}

void write_boundary(std::span<const std::uint16_t> rows, guint8* bytes) {
  for (std::size_t i = 0; i < rows.size(); ++i)
    GST_WRITE_UINT16_LE(bytes + 2 * i, rows[i]);
}

static OwnedBuffer filled(OwnedBuffer buffer, std::span<const std::uint16_t> rows) {
  GstMapInfo map;
  if (!buffer || !gst_buffer_map(buffer.get(), &map, GST_MAP_WRITE))
    return nullptr;
  write_boundary(rows, map.data);
  gst_buffer_unmap(buffer.get(), &map);
  return buffer;
}

GstBuffer* new_boundary_buffer(std::span<const std::uint16_t> rows) {
  return filled(OwnedBuffer(gst_buffer_new_allocate(nullptr, rows.size() * 2, nullptr)), rows).release();
}

OwnedBuffer boundary_buffer(SmallPool& pool, std::span<const std::uint16_t> rows) {
  return filled(pool.acquire(rows.size() * 2), rows);
}

EstimateReader::EstimateReader(GstBuffer* buffer, const char* source) {
  const GstStructure* fields = gst_buffer_get_terrain_seg_structure_of(buffer, *source ? source : nullptr);
  if (!fields)
    return;
  error_ = read(fields);
  valid_ = !error_;
}

EstimateReader::~EstimateReader() {
  mask_map_.reset();
  confidence_map_map_.reset();
  if (boundary_map_.memory)
    gst_buffer_unmap(boundary_, &boundary_map_);
  gst_clear_buffer(&mask_);
  gst_clear_buffer(&boundary_);
  gst_clear_buffer(&confidence_map_);
}

const char* EstimateReader::read(const GstStructure* fields) {
  Estimate& e = estimate_;
  e.frame = gst_terrain_seg_meta_get_frame(fields);
  e.frame_width = gst_terrain_seg_meta_get_frame_width(fields);
  e.frame_height = gst_terrain_seg_meta_get_frame_height(fields);
  e.horizon_row = gst_terrain_seg_meta_get_horizon_row(fields);
  e.vanishing_row = std::max(get_q16(fields, Names::get().vanishing_row, -1), -1);
  e.speed_over_height = get_q16(fields, Names::get().speed_over_height, 0);
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
    mask_ = gst_buffer_ref(mask);
    if (const char* error = map_mask())
      return error;
  }
  if (GstBuffer* boundary = gst_terrain_seg_meta_get_boundary(fields)) {
    boundary_ = gst_buffer_ref(boundary);
    if (const char* error = map_boundary())
      return error;
  }
  if (GstBuffer* map = gst_terrain_seg_meta_get_confidence_map(fields)) {
    confidence_map_ = gst_buffer_ref(map);
    confidence_map_map_.emplace(confidence_map_);
    e.confidence_map = confidence_map_map_->view();
    if (confidence_map_map_->error())
      return "the confidence map is not one GRAY8 memory of the size in its GstVideoMeta";
  }
  return flaw_of(e);
}

const char* EstimateReader::map_mask() {
  mask_map_.emplace(mask_);
  estimate_.mask = mask_map_->view();
  return mask_map_->error();
}

const char* EstimateReader::map_boundary() {
  if (!gst_buffer_map(boundary_, &boundary_map_, GST_MAP_READ))
    return "the boundary cannot be mapped";
  const std::size_t columns = boundary_map_.size / 2;
  if (boundary_map_.size % 2 || columns > longest_picture_side)
    return "the boundary does not have one uint16 per mask column";
  const bool readable_in_place = std::endian::native == std::endian::little &&
                                 reinterpret_cast<std::uintptr_t>(boundary_map_.data) % 2 == 0;
  if (readable_in_place) {
    estimate_.boundary = {reinterpret_cast<const std::uint16_t*>(boundary_map_.data), columns};
    return nullptr;
  }
  host_order_.resize(columns);
  std::memcpy(host_order_.data(), boundary_map_.data, columns * 2);
  for (std::uint16_t& row : host_order_)
    row = GUINT16_FROM_LE(row);
  estimate_.boundary = host_order_;
  return nullptr;
}

} // namespace terrainseg
