// SPDX-License-Identifier: LGPL-2.1-or-later
#include "tools/process/csv_rows.hpp"

#include <gst/terrainseg/terrainsegmeta.h>

#include <charconv>
#include <cmath>
#include <cstring>

#include "exchange/json_lines.hpp"

namespace terrainseg::process {

const char* const csv_header = "frame,pts,width,height,horizon_row,horizon_confidence,traversable,confidence,"
                               "blocked,learned,generation,utc,range_max,ranges,bearings,low,high\n";

namespace {

constexpr int millimetres = 3, microradians = 6; ///< decimals

void append_number(std::string& row, double value, int decimals) {
  if (std::isnan(value)) {
    row += "nan";
    return;
  }
  char text[64];
  const auto [end, error] =
      std::to_chars(text, text + sizeof text, value, std::chars_format::fixed, decimals);
  if (error == std::errc{})
    row.append(text, end);
}

/// A field with one number for each little-endian float in `values`.
void append_list(std::string& row, GstBuffer* values, int decimals) {
  row += ',';
  GstMapInfo map;
  if (!values || !gst_buffer_map(values, &map, GST_MAP_READ))
    return;
  for (gsize at = 0; at + 4 <= map.size; at += 4) {
    if (at > 0)
      row += ' ';
    gfloat value = 0; // the address may be unaligned
    std::memcpy(&value, map.data + at, sizeof value);
    append_number(row, GFLOAT_FROM_LE(value), decimals);
  }
  gst_buffer_unmap(values, &map);
}

void append_metres(std::string& row, const GstStructure* metric) {
  row += ',';
  append_number(row, gst_terrain_metric_meta_get_range_max(metric), millimetres);
  append_list(row, gst_terrain_metric_meta_get_ranges(metric), millimetres);
  append_list(row, gst_terrain_metric_meta_get_bearings(metric), microradians);
  append_list(row, gst_terrain_metric_meta_get_low(metric), millimetres);
  append_list(row, gst_terrain_metric_meta_get_high(metric), millimetres);
}

} // namespace

void make_csv_row(std::string& row, GstBuffer* frame, const GstStructure* e) {
  const guint permille = gst_terrain_seg_meta_get_traversable_permille(e);
  const guint flags = gst_terrain_seg_meta_get_flags(e);
  const gint horizon = gst_terrain_seg_meta_get_horizon_row(e);
  char text[256];
  g_snprintf(
      text, sizeof text, "%" G_GUINT64_FORMAT ",%" G_GUINT64_FORMAT ",%d,%d,%s,%u,%u.%03u,%u,%d,%d,%u,",
      gst_terrain_seg_meta_get_frame(e), GST_BUFFER_PTS(frame), gst_terrain_seg_meta_get_frame_width(e),
      gst_terrain_seg_meta_get_frame_height(e), horizon >= 0 ? std::to_string(horizon).c_str() : "",
      gst_terrain_seg_meta_get_horizon_confidence(e), permille / 1000, permille % 1000,
      gst_terrain_seg_meta_get_confidence(e), (flags & GST_TERRAIN_SEG_FLAG_BLOCKED) != 0,
      (flags & GST_TERRAIN_SEG_FLAG_LEARNED) != 0, gst_terrain_seg_meta_get_model_generation(e));
  row = text;
  if (const GstClockTime utc = gst_buffer_get_terrain_utc(frame); GST_CLOCK_TIME_IS_VALID(utc))
    row += utc_text(utc);
  const gchar* instance = gst_terrain_seg_meta_get_instance(e);
  if (const GstStructure* metric = gst_buffer_get_terrain_metric_structure(frame, instance ? instance : ""))
    append_metres(row, metric);
  else
    row += ",,,,,";
  row += '\n';
}

} // namespace terrainseg::process
