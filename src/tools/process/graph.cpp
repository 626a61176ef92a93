// SPDX-License-Identifier: LGPL-2.1-or-later
#include "tools/process/graph.hpp"

#include <fcntl.h>
#include <gst/terrainseg/terrainsegmeta.h>
#include <unistd.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <numeric>
#include <stdexcept>
#include <utility>
#include <vector>

#include "exchange/json_lines.hpp"
#include "tools/process/container.hpp"
#include "tools/process/elements.hpp"
#include "tools/process/handles.hpp"

namespace terrainseg::process {
namespace {

GstPadProbeReturn on_buffer(GstPad*, GstPadProbeInfo*, gpointer counter) {
  ++*static_cast<std::atomic<std::uint64_t>*>(counter);
  return GST_PAD_PROBE_OK;
}

/// Width or height of the annotated video for that of a frame: H.264 with 4:2:0 needs even sides, mp4mux at
/// least 16 pixels.
int annotated_side(int side) {
  return std::max(16, side + (side & 1));
}

/// Width or height of the encoded video: reduced when the encoder does not support the frame's size.
int encoded_side(int side, const GstVideoInfo& info) {
  const int longer = std::max(info.width, info.height);
  const int most = has_x264() ? 16384 : 3840;
  return longer <= most ? side
                        : std::max(1, static_cast<int>(gst_util_uint64_scale_int_round(side, most, longer)));
}

/// Colorimetry of the encoded video. The range is 16 to 235, because every player expects it in H.264. The
/// primaries and the transfer function are kept, because HDR needs them; if they are unknown, nothing is
/// claimed, except for RGB pictures. videoconvert 1.22 converts the range only when the matrix changes too,
/// so full range input gets the other matrix (BT.601 or BT.709).
std::string encoded_colorimetry(const GstVideoInfo& info) {
  GstVideoColorimetry color = info.colorimetry;
  const bool large = info.height >= 720;
  const bool full = color.range == GST_VIDEO_COLOR_RANGE_0_255 && !GST_VIDEO_INFO_IS_RGB(&info);
  if (color.matrix == GST_VIDEO_COLOR_MATRIX_UNKNOWN || color.matrix == GST_VIDEO_COLOR_MATRIX_RGB)
    color.matrix = large ? GST_VIDEO_COLOR_MATRIX_BT709 : GST_VIDEO_COLOR_MATRIX_BT601;
  else if (full)
    color.matrix = color.matrix == GST_VIDEO_COLOR_MATRIX_BT709 ? GST_VIDEO_COLOR_MATRIX_BT601
                                                                : GST_VIDEO_COLOR_MATRIX_BT709;
  color.range = GST_VIDEO_COLOR_RANGE_16_235;
  if (GST_VIDEO_INFO_IS_RGB(&info)) {
    color.transfer = large ? GST_VIDEO_TRANSFER_BT709 : GST_VIDEO_TRANSFER_BT601;
    color.primaries = large ? GST_VIDEO_COLOR_PRIMARIES_BT709 : GST_VIDEO_COLOR_PRIMARIES_SMPTE170M;
  }
  return take(gst_video_colorimetry_to_string(&color));
}

void set_caps(GstElement* filter, GstCaps* caps) {
  const CapsPointer owner(caps);
  g_object_set(filter, "caps", caps, nullptr);
}

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

Graph::~Graph() {
  if (pipeline_) {
    gst_element_set_state(pipeline_, GST_STATE_NULL);
    gst_object_unref(pipeline_);
  }
  if (scratch_ >= 0)
    close(scratch_);
}

/// Moves the start of the MP4 file to the time of the first frame: mp4mux starts every file at 0, but the
/// other outputs have the times of the input.
GstPadProbeReturn Graph::on_movie_box(GstPad*, GstPadProbeInfo* info) {
  GstBuffer* buffer = GST_PAD_PROBE_INFO_BUFFER(info);
  constexpr gsize head = 8;
  std::uint8_t bytes[head] = {};
  if (gst_buffer_extract(buffer, 0, bytes, head) < head || std::memcmp(bytes + 4, "moov", 4) != 0)
    return GST_PAD_PROBE_OK;
  std::vector<std::uint8_t> movie(gst_buffer_get_size(buffer));
  gst_buffer_extract(buffer, 0, movie.data(), movie.size());
  movie = shown_from(movie, start_);
  GstBuffer* changed = gst_buffer_new_memdup(movie.data(), movie.size());
  gst_buffer_copy_into(changed, buffer, GST_BUFFER_COPY_METADATA, 0, G_MAXSIZE);
  gst_buffer_unref(buffer);
  GST_PAD_PROBE_INFO_DATA(info) = changed;
  return GST_PAD_PROBE_OK;
}

GstPadProbeReturn Graph::on_end(GstPad*, GstPadProbeInfo* info) {
  if (GST_EVENT_TYPE(GST_PAD_PROBE_INFO_EVENT(info)) == GST_EVENT_EOS)
    ++sinks_ended_;
  return GST_PAD_PROBE_OK;
}

GstElement* Graph::named(const std::string& name) const {
  GstElement* element = gst_bin_get_by_name(GST_BIN(pipeline_), name.c_str());
  if (element)
    gst_object_unref(element);
  return element;
}

/// An encoder, and a parser where one is needed, as in gst-launch-1.0.
std::string Graph::h264(bool recording) const {
  const std::string threads = std::to_string(options_.threads);
  // A seek decodes at most 30 frames of a recording.
  if (has_x264())
    return "x264enc pass=qual speed-preset=veryfast quantizer=" + std::to_string(options_.quality) +
           " threads=" + threads + (recording ? " bframes=0 key-int-max=30 ! h264parse" : "");
  return "openh264enc rate-control=quality bitrate=8000000 qp-max=" +
         std::to_string(std::min(options_.quality + 8, 51)) + " multi-thread=" + threads +
         (recording ? " gop-size=30 ! h264parse" : " ! h264parse");
}

/// The elements after the source, as in gst-launch-1.0. Sinks and muxers have the names of their outputs.
std::string Graph::description(OutputFiles& files) const {
  // Each branch runs in its own thread. The sinks do not preroll, because an encoder may need 50 frames
  // before it outputs the first one.
  const std::string branch = " tee. ! queue max-size-buffers=4 max-size-bytes=0 max-size-time=0 ! ";
  const auto sink = [&files](const char* factory, Output kind) {
    return std::string(" ! ") + factory + " sync=false async=false name=" + names_of(kind).name +
           " fd=" + std::to_string(files[kind].fd());
  };
  std::string text = "terrainseg name=terrainseg ! tee name=tee";
  if (options_.wants(
          Output::annotated)) // videoscale is needed when the stream changes its size; videobox pads
    text += branch +          // to annotated_side(), and drops the colorimetry
            "terrainoverlay name=overlay ! videoconvert ! videoscale add-borders=true"
            " ! capsfilter name=annotated-caps ! videobox name=annotated-box"
            " ! capsfilter name=annotated-colors ! " +
            h264(false) + " ! mp4mux name=annotated-mux" + sink("fdsink", Output::annotated);
  if (options_.wants(Output::masks))
    text += branch +
            "terrainextract ! capsfilter name=masks-caps caps=video/x-raw,format=GRAY8 ! avenc_ffv1" +
            " ! matroskamux name=masks-mux" + sink("fdsink", Output::masks);
  if (options_.wants(Output::json))
    text += branch + "terrainextract json-mask=" + (options_.json_mask ? "true" : "false") +
            " ! capsfilter caps=application/x-ndjson" + sink("fdsink", Output::json);
  if (options_.wants(
          Output::mcap)) // without drawings; videoscale makes odd sides even and keeps the metadata
    text += branch + "videoconvert ! videoscale ! capsfilter name=recording-caps ! " + h264(true) +
            sink("terrainmcapsink", Output::mcap);
  if (text.ends_with("tee")) // for CSV only, which is written from the metadata
    text += " ! fakesink sync=false async=false name=csv";
  return text;
}

void Graph::build(GstElement* source, OutputFiles& files) {
  source_ = source;
  GError* error = nullptr;
  pipeline_ = gst_parse_launch(description(files).c_str(), &error);
  if (const ErrorPointer owner{error}) {
    gst_object_unref(gst_object_ref_sink(source));
    throw std::runtime_error(error->message);
  }
  gst_bin_add(GST_BIN(pipeline_), source);
  if (!gst_element_link(source, terrainseg()))
    throw std::runtime_error("cannot connect the decoder with terrainseg");
  for (const Output kind : {Output::annotated, Output::masks, Output::json, Output::mcap, Output::csv}) {
    GstElement* sink = named(names_of(kind).name);
    if (!sink)
      continue;
    // Counts EOS events at the sinks: with decodebin, a bin whose sinks have async=false sometimes loses its
    // EOS message. When the event arrives, all earlier data has been written. The sink completes its file
    // after the event, at the latest when the pipeline stops.
    ++sinks_;
    add_probe<&Graph::on_end>(pad_of(sink, "sink"), GST_PAD_PROBE_TYPE_EVENT_DOWNSTREAM, this);
    GstElement* mux = named(names_of(kind).name + std::string("-mux"));
    if (kind != Output::csv)
      gst_pad_add_probe(pad_of(mux ? mux : sink, mux ? "video_0" : "sink").get(), GST_PAD_PROBE_TYPE_BUFFER,
                        on_buffer, &written_[static_cast<std::size_t>(kind)], nullptr);
  }
  // A browser needs the index at the start of the file. Until it is known, the frames are in an unnamed file.
  if (options_.wants(Output::annotated))
    scratch_ = open(options_.output_dir.c_str(), O_RDWR | O_TMPFILE | O_CLOEXEC, 0600);
  if (scratch_ >= 0) { // otherwise the file system does not support such files
    const std::string path = "/proc/self/fd/" + std::to_string(scratch_);
    g_object_set(named("annotated-mux"), "faststart", TRUE, "faststart-file", path.c_str(), nullptr);
    add_probe<&Graph::on_movie_box>(pad_of(named("annotated-mux"), "src"), GST_PAD_PROBE_TYPE_BUFFER, this);
  }
  if (GstElement* sink = named(names_of(Output::mcap).name))
    for (const char* name : {"camera-info", "mount"})
      g_object_set(sink, name, options_.setting(name).c_str(), nullptr);
  apply_settings(options_, terrainseg(), named("overlay"));
}

void Graph::set_size(const GstVideoInfo& info) {
  const auto caps = [&info](const char* format, int width, int height) {
    return gst_caps_new_simple("video/x-raw", "format", G_TYPE_STRING, format, "width", G_TYPE_INT, width,
                               "height", G_TYPE_INT, height, "pixel-aspect-ratio", GST_TYPE_FRACTION,
                               info.par_n, info.par_d, nullptr);
  };
  const int width = encoded_side(info.width, info), height = encoded_side(info.height, info);
  if (options_.wants(Output::annotated)) {
    GstCaps* annotated = caps("I420", width, height);
    const std::string colors = encoded_colorimetry(info);
    gst_caps_set_simple(annotated, "colorimetry", G_TYPE_STRING, colors.c_str(), nullptr);
    set_caps(named("annotated-caps"), annotated);
    set_caps(named("annotated-colors"),
             gst_caps_new_simple("video/x-raw", "colorimetry", G_TYPE_STRING, colors.c_str(), nullptr));
    g_object_set(named("annotated-box"), "right", width - annotated_side(width), "bottom",
                 height - annotated_side(height), nullptr);
  }
  if (options_.wants(Output::mcap)) {
    GstCaps* recorded = caps("I420", width + (width & 1), height + (height & 1));
    gst_structure_remove_field(gst_caps_get_structure(recorded, 0), "pixel-aspect-ratio");
    const CharPointer colors(gst_video_colorimetry_to_string(&info.colorimetry));
    if (colors && !GST_VIDEO_INFO_IS_RGB(&info)) // otherwise videoconvert 1.22 labels grey as limited
      gst_caps_set_simple(recorded, "colorimetry", G_TYPE_STRING, colors.get(), nullptr);
    set_caps(named("recording-caps"), recorded);
  }
  if (options_.wants(Output::masks))
    set_caps(named("masks-caps"), caps("GRAY8", info.width, info.height));
}

std::optional<Output> Graph::output_of(const GstObject* element) const {
  for (const Output kind : options_.outputs())
    for (const char* suffix : {"", "-mux"})
      if (element && element == GST_OBJECT(named(std::string(names_of(kind).name) + suffix)))
        return kind;
  return std::nullopt;
}

bool Graph::holds(GstObject* element) const {
  return gst_object_has_as_ancestor(element, GST_OBJECT(pipeline_)) && element != GST_OBJECT(source_) &&
         !gst_object_has_as_ancestor(element, GST_OBJECT(source_));
}

std::uint64_t Graph::written() const {
  return std::accumulate(written_.begin(), written_.end(), std::uint64_t{0});
}

std::string Graph::bag_metadata() const {
  if (!options_.wants(Output::mcap))
    return {};
  gchar* text = nullptr;
  g_object_get(named(names_of(Output::mcap).name), "bag-metadata", &text, nullptr);
  return take(text);
}

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
