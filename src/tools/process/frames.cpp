// SPDX-License-Identifier: LGPL-2.1-or-later
#include "tools/process/graph.hpp"

#include <gst/terrainseg/terrainsegmeta.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <numeric>
#include <utility>

#include "exchange/json_lines.hpp"
#include "tools/process/handles.hpp"

namespace terrainseg::process {
namespace {

/// The names of the columns of the CSV file.
constexpr const char* csv_header =
    "frame,pts,width,height,horizon_row,horizon_confidence,traversable,confidence,"
    "blocked,learned,generation,utc,range_max,ranges,bearings,low,high\n";

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

/// Replaces `row` by the row of a frame. Columns of the boundary are lists in one field, separated by spaces:
/// metres and radians, `inf` = free, `nan` = unknown. They and the time of day are empty if unknown.
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

constexpr std::uint64_t stride = 5; ///< compares every fifth frame
constexpr int least_compared = 6;   ///< minimum number of pairs: a second of video at 30 frames per second
constexpr double still = 2;         ///< maximum mean change of an unchanged row: coding noise
constexpr double moving = 6;        ///< minimum mean change of the picture above
constexpr int least_permille = 30;  ///< minimum share of the height

/// 8-bit brightness of a pixel: luma, or green.
int brightness(const GstVideoFrame& frame, int component, int x, int y) {
  const auto* data = static_cast<const std::uint8_t*>(GST_VIDEO_FRAME_COMP_DATA(&frame, component));
  const std::uint8_t* pixel =
      data + static_cast<std::ptrdiff_t>(y) * GST_VIDEO_FRAME_COMP_STRIDE(&frame, component) +
      static_cast<std::ptrdiff_t>(x) * GST_VIDEO_FRAME_COMP_PSTRIDE(&frame, component);
  const int depth = GST_VIDEO_FRAME_COMP_DEPTH(&frame, component);
  if (depth <= 8)
    return pixel[0];
  const int shift = GST_VIDEO_FORMAT_INFO_SHIFT(frame.info.finfo, component);
  return ((pixel[0] | pixel[1] << 8) >> shift) >> (depth - 8) & 0xff;
}

} // namespace

void StillBottom::take(const GstVideoInfo& info, GstBuffer* buffer) {
  if (frames_++ % stride != 0)
    return;
  GstVideoFrame frame;
  GstVideoInfo copy = info;
  if (!gst_video_frame_map(&frame, &copy, buffer, GST_MAP_READ))
    return;
  const bool is_compared = frames_ > 1;
  const int component = GST_VIDEO_INFO_IS_RGB(&info) ? 1 : 0;
  for (int row = 0; row < grid_rows; ++row)
    for (int column = 0; column < grid_columns; ++column) {
      const int now = brightness(frame, component, info.width / 4 + column * info.width / (2 * grid_columns),
                                 info.height - 1 - frame_row(row, info.height));
      const int before = std::exchange(last_[row * grid_columns + column], static_cast<std::uint8_t>(now));
      change_[row] += is_compared ? static_cast<std::uint64_t>(std::abs(now - before)) : 0;
    }
  compared_ += is_compared;
  gst_video_frame_unmap(&frame);
}

int StillBottom::rows(int height) const {
  if (compared_ < least_compared)
    return 0;
  const double pixels = static_cast<double>(compared_) * grid_columns;
  int still_rows = 0;
  while (still_rows < grid_rows && static_cast<double>(change_[still_rows]) / pixels < still)
    ++still_rows;
  const auto above = std::accumulate(change_.begin() + still_rows, change_.end(), std::uint64_t{0});
  const int rows_above = grid_rows - still_rows;
  if (rows_above == 0 || static_cast<double>(above) / (pixels * rows_above) < moving)
    return 0;
  const int rows = still_rows < 2 ? 0 : frame_row(still_rows, height);
  return rows * 1000 < least_permille * height ? 0 : rows;
}

Frames::Frames(const Options& options, Graph& graph, AtomicFile& rows, Record& record)
    : options_(options), graph_(graph), rows_(rows), record_(record) {
  gst_segment_init(&segment_, GST_FORMAT_UNDEFINED);
  if (rows_.fd() >= 0)
    rows_.write(csv_header);
}

void Frames::watch(GstElement* source) {
  constexpr int all = GST_PAD_PROBE_TYPE_BUFFER | GST_PAD_PROBE_TYPE_EVENT_DOWNSTREAM;
  add_probe<&Frames::entering>(pad_of(source, "src"), all, this);
  add_probe<&Frames::leaving>(pad_of(graph_.terrainseg(), "src"), all, this);
}

GstPadProbeReturn Frames::leaving(GstPad*, GstPadProbeInfo* info) {
  if (GST_PAD_PROBE_INFO_TYPE(info) & GST_PAD_PROBE_TYPE_BUFFER)
    frame_done(GST_PAD_PROBE_INFO_BUFFER(info));
  else if (GST_EVENT_TYPE(GST_PAD_PROBE_INFO_EVENT(info)) == GST_EVENT_CAPS)
    size_known(GST_PAD_PROBE_INFO_EVENT(info));
  return GST_PAD_PROBE_OK;
}

int Frames::still_rows() const {
  const int rows = still_bottom_.rows(video_info_.height);
  return window_.h > 0 && window_.y + window_.h > video_info_.height - rows ? rows : 0;
}

/// From here on, time stamps are the presentation times of the file. Edit lists and B-frames shift the stamps
/// of a demuxer; its segment has the shift.
void Frames::segment_entering(GstPadProbeInfo* info) {
  GstEvent* event = GST_PAD_PROBE_INFO_EVENT(info);
  gst_event_copy_segment(event, &segment_);
  if (segment_.format != GST_FORMAT_TIME)
    return;
  GstSegment plain;
  gst_segment_init(&plain, GST_FORMAT_TIME);
  GstEvent* replacement = gst_event_new_segment(&plain);
  gst_event_set_seqnum(replacement, gst_event_get_seqnum(event));
  gst_event_unref(event);
  GST_PAD_PROBE_INFO_DATA(info) = replacement;
}

/// The two views of a stereo picture are labelled as one.
void Frames::warn_of_views(GstEvent* event) {
  GstVideoInfo info;
  if (!gst_video_info_from_caps(&info, caps_of(event)))
    return;
  const GstVideoMultiviewMode mode = GST_VIDEO_INFO_MULTIVIEW_MODE(&info);
  if (mode == GST_VIDEO_MULTIVIEW_MODE_NONE || mode == GST_VIDEO_MULTIVIEW_MODE_MONO)
    return;
  const std::string text = std::string("stereo video (") + gst_video_multiview_mode_to_caps_string(mode) +
                           "): its two views are taken for one picture; make a video of one view first, as "
                           "ffmpeg -i INPUT -vf stereo3d=sbsl:ml OUTPUT.mkv does for side by side";
  if (std::ranges::count(record_.warnings, text) == 0)
    record_.warnings.push_back(text);
}

/// Ends the stream after --frames frames. Frames without a time get one, which files need.
GstPadProbeReturn Frames::entering(GstPad*, GstPadProbeInfo* info) {
  if (!(GST_PAD_PROBE_INFO_TYPE(info) & GST_PAD_PROBE_TYPE_BUFFER)) {
    GstEvent* event = GST_PAD_PROBE_INFO_EVENT(info);
    if (GST_EVENT_TYPE(event) == GST_EVENT_SEGMENT)
      segment_entering(info);
    else if (GST_EVENT_TYPE(event) == GST_EVENT_CAPS)
      warn_of_views(event);
    // GAP events may overtake the segment in an encoder, which muxers report as an error. Files need none.
    return GST_EVENT_TYPE(event) == GST_EVENT_GAP ? GST_PAD_PROBE_DROP : GST_PAD_PROBE_OK;
  }
  GstBuffer* buffer = GST_PAD_PROBE_INFO_BUFFER(info);
  if (options_.max_frames && entered_ >= options_.max_frames) {
    gst_buffer_unref(buffer);
    GST_PAD_PROBE_INFO_DATA(info) = nullptr;
    GST_PAD_PROBE_INFO_FLOW_RETURN(info) = GST_FLOW_EOS;
    return GST_PAD_PROBE_HANDLED;
  }
  ++entered_;
  const GstClockTime time =
      segment_.format == GST_FORMAT_TIME && GST_BUFFER_PTS_IS_VALID(buffer)
          ? gst_segment_to_stream_time(&segment_, GST_FORMAT_TIME, GST_BUFFER_PTS(buffer))
          : GST_BUFFER_PTS(buffer);
  if (!GST_CLOCK_TIME_IS_VALID(time) || time != GST_BUFFER_PTS(buffer)) {
    buffer = gst_buffer_make_writable(buffer);
    GST_BUFFER_PTS(buffer) = GST_CLOCK_TIME_IS_VALID(time) ? time : next_pts_;
    GST_PAD_PROBE_INFO_DATA(info) = buffer;
  }
  const GstClockTime length = GST_BUFFER_DURATION_IS_VALID(buffer) && GST_BUFFER_DURATION(buffer) > 0
                                  ? GST_BUFFER_DURATION(buffer)
                                  : GST_SECOND / 30;
  next_pts_ = GST_BUFFER_PTS(buffer) + length;
  return GST_PAD_PROBE_OK;
}

/// Files have one size: the first frame's. Later frames are scaled to it. Caps may arrive twice before the
/// first frame, because the orientation is known after the size.
void Frames::size_known(GstEvent* event) {
  GstVideoInfo info;
  if (!gst_video_info_from_caps(&info, caps_of(event)))
    return;
  if (info.width != video_info_.width || info.height != video_info_.height)
    still_bottom_ = {};
  video_info_ = info;
  if (labelled_ > 0)
    return;
  record_.width = info.width;
  record_.height = info.height;
  graph_.set_size(info);
}

void Frames::frame_done(GstBuffer* buffer) {
  position_ = GST_BUFFER_PTS(buffer);
  if (labelled_ == 0)
    graph_.set_start(position_);
  const GstStructure* meta = gst_buffer_get_terrain_seg_structure(buffer);
  if (meta) {
    const guint permille = gst_terrain_seg_meta_get_traversable_permille(meta);
    const guint flags = gst_terrain_seg_meta_get_flags(meta);
    const gint horizon = gst_terrain_seg_meta_get_horizon_row(meta);
    record_.traversable_sum += permille;
    still_bottom_.take(video_info_, buffer);
    gst_terrain_seg_meta_get_window(meta, &window_);
    record_.blocked += (flags & GST_TERRAIN_SEG_FLAG_BLOCKED) != 0;
    record_.horizon_frames += horizon >= 0;
    if (rows_.fd() >= 0) {
      make_csv_row(csv_row_, buffer, meta);
      rows_.write(csv_row_);
      graph_.count(Output::csv);
    }
  } else {
    ++without_metadata_;
  }
  ++labelled_;
}

} // namespace terrainseg::process
