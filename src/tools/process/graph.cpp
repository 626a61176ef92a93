// SPDX-License-Identifier: LGPL-2.1-or-later
#include "tools/process/graph.hpp"

#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <cstring>
#include <utility>
#include <vector>

#include "tools/process/elements.hpp"
#include "tools/process/handles.hpp"
#include "tools/process/iso_media.hpp"

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
  const int most = most_encoded_side();
  return longer <= most ? side
                        : std::max(1, static_cast<int>(gst_util_uint64_scale_int_round(side, most, longer)));
}

/// Colorimetry of the encoded video. The range is 16 to 235, because every player expects it in H.264. The
/// primaries and the transfer function are kept, because HDR needs them; if they are unknown, nothing is
/// claimed, except for RGB pictures. videoconvert 1.22 converts the range
/// only when the matrix changes too, so full range input gets the other matrix (BT.601 or BT.709).
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

} // namespace

Graph::~Graph() {
  gst_element_set_state(pipeline_, GST_STATE_NULL);
  gst_object_unref(pipeline_);
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

GstElement* Graph::add(const char* factory) {
  GstElement* element = gst_element_factory_make(factory, nullptr);
  gst_bin_add(GST_BIN(pipeline_), element);
  return element;
}

/// Adds a queue after the tee, so that each branch runs in its own thread.
GstElement* Graph::branch(GstElement* tee) {
  GstElement* queue = add("queue");
  g_object_set(queue, "max-size-buffers", 4, "max-size-bytes", 0, "max-size-time", guint64{0}, nullptr);
  gst_element_link(tee, queue);
  return queue;
}

/// Adds the sink that writes the output's file. It does not preroll, because an encoder may need 50 frames
/// before it outputs the first one.
GstElement* Graph::add_sink(Output kind, int fd) {
  GstElement* sink = add(kind == Output::mcap ? "terrainmcapsink" : "fdsink");
  g_object_set(sink, "fd", fd, "sync", FALSE, "async", FALSE, nullptr);
  sinks_of_[static_cast<std::size_t>(kind)] = sink;
  watch_end(sink);
  return sink;
}

/// Counts EOS events at the sinks: with decodebin, a bin whose sinks have async=false sometimes loses its EOS
/// message. When the event arrives, all earlier data has been written. The sink completes its file after
/// the event, at the latest when the pipeline stops.
void Graph::watch_end(GstElement* sink) {
  ++sinks_;
  add_probe<&Graph::on_end>(pad_of(sink, "sink"), GST_PAD_PROBE_TYPE_EVENT_DOWNSTREAM, this);
}

void Graph::count_buffers(GstElement* element, const char* name, Output kind) {
  gst_pad_add_probe(pad_of(element, name).get(), GST_PAD_PROBE_TYPE_BUFFER, on_buffer,
                    &written_[static_cast<std::size_t>(kind)], nullptr);
}

void Graph::add_annotated(GstElement* tee, int fd) {
  GstElement* queue = branch(tee);
  overlay_ = add("terrainoverlay");
  GstElement* convert = add("videoconvert");
  GstElement* scale = add("videoscale"); // needed when the stream changes its size
  annotated_caps_ = add("capsfilter");
  annotated_box_ = add("videobox"); // pads to annotated_side(); drops the colorimetry
  annotated_colors_ = add("capsfilter");
  GstElement* mux = add("mp4mux");
  muxers_[static_cast<std::size_t>(Output::annotated)] = mux;
  // A browser needs the index at the start of the file. Until it is known, the frames are in an unnamed file.
  scratch_ = open(options_.output_dir.c_str(), O_RDWR | O_TMPFILE | O_CLOEXEC, 0600);
  if (scratch_ >= 0) { // otherwise the file system does not support such files
    const std::string path = "/proc/self/fd/" + std::to_string(scratch_);
    g_object_set(mux, "faststart", TRUE, "faststart-file", path.c_str(), nullptr);
    add_probe<&Graph::on_movie_box>(pad_of(mux, "src"), GST_PAD_PROBE_TYPE_BUFFER, this);
  }
  g_object_set(scale, "add-borders", TRUE, nullptr);
  gst_element_link_many(queue, overlay_, convert, scale, annotated_caps_, annotated_box_, annotated_colors_,
                        nullptr);
  GstElement* encoded = encode_h264(annotated_colors_, false);
  gst_element_link_many(encoded, mux, add_sink(Output::annotated, fd), nullptr);
  count_buffers(encoded, "src", Output::annotated);
}

/// Adds an encoder after `from`, and a parser where one is needed. Returns the last element.
GstElement* Graph::encode_h264(GstElement* from, bool recording) {
  const std::string name = h264_encoder();
  const bool x264 = name == "x264enc";
  GstElement* encoder = add(name.c_str());
  gst_element_link(from, encoder);
  constexpr guint key_frame_distance = 30; // largest number of frames that a seek decodes
  const auto threads = static_cast<guint>(options_.threads);
  if (x264) {
    gst_util_set_object_arg(G_OBJECT(encoder), "pass", "qual");
    gst_util_set_object_arg(G_OBJECT(encoder), "speed-preset", "veryfast");
    g_object_set(encoder, "quantizer", static_cast<guint>(options_.quality), "threads", threads, nullptr);
    if (recording)
      g_object_set(encoder, "bframes", 0u, "key-int-max", key_frame_distance, nullptr);
  } else {
    gst_util_set_object_arg(G_OBJECT(encoder), "rate-control", "quality");
    g_object_set(encoder, "bitrate", 8'000'000u, "qp-max",
                 static_cast<guint>(std::min(options_.quality + 8, 51)), "multi-thread", threads, nullptr);
    if (recording)
      g_object_set(encoder, "gop-size", key_frame_distance, nullptr);
  }
  if (x264 && !recording)
    return encoder;
  GstElement* parse = add("h264parse");
  gst_element_link(encoder, parse);
  return parse;
}

void Graph::add_masks(GstElement* tee, int fd) {
  GstElement* queue = branch(tee);
  GstElement* extract = add("terrainextract");
  masks_caps_ = add("capsfilter");
  GstElement* encoder = add("avenc_ffv1");
  GstElement* mux = add("matroskamux");
  muxers_[static_cast<std::size_t>(Output::masks)] = mux;
  set_caps(masks_caps_, gst_caps_new_simple("video/x-raw", "format", G_TYPE_STRING, "GRAY8", nullptr));
  gst_element_link_many(queue, extract, masks_caps_, encoder, mux, add_sink(Output::masks, fd), nullptr);
  count_buffers(encoder, "src", Output::masks);
}

void Graph::add_json(GstElement* tee, int fd) {
  GstElement* queue = branch(tee);
  GstElement* extract = add("terrainextract");
  g_object_set(extract, "json-mask", options_.json_mask, nullptr);
  GstElement* lines = add("capsfilter");
  set_caps(lines, gst_caps_new_empty_simple("application/x-ndjson"));
  GstElement* sink = add_sink(Output::json, fd);
  gst_element_link_many(queue, extract, lines, sink, nullptr);
  count_buffers(sink, "sink", Output::json);
}

/// Records the video without drawings, the metadata and the ranges. videoscale makes odd sides even and keeps
/// the metadata.
void Graph::add_recording(GstElement* tee, int fd) {
  GstElement* queue = branch(tee);
  GstElement* convert = add("videoconvert");
  GstElement* scale = add("videoscale");
  recording_caps_ = add("capsfilter");
  gst_element_link_many(queue, convert, scale, recording_caps_, nullptr);
  GstElement* sink = add_sink(Output::mcap, fd);
  for (const char* name : {"camera-info", "mount"})
    g_object_set(sink, name, options_.setting(name).c_str(), nullptr);
  gst_element_link(encode_h264(recording_caps_, true), sink);
  count_buffers(sink, "sink", Output::mcap);
}

std::optional<std::string> Graph::build(GstElement* source, const Descriptors& files) {
  source_ = source;
  gst_bin_add(GST_BIN(pipeline_), source);
  terrainseg_ = add("terrainseg");
  GstElement* tee = add("tee");
  if (!gst_element_link_many(source, terrainseg_, tee, nullptr))
    return "cannot connect the decoder with terrainseg";
  const std::pair<Output, void (Graph::*)(GstElement*, int)> branches[] = {
      {Output::annotated, &Graph::add_annotated},
      {Output::masks, &Graph::add_masks},
      {Output::json, &Graph::add_json},
      {Output::mcap, &Graph::add_recording}};
  for (const auto& [kind, add_branch] : branches)
    if (options_.wants(kind))
      (this->*add_branch)(tee, files[static_cast<std::size_t>(kind)]);
  if (sinks_ == 0) {
    GstElement* sink = add("fakesink"); // for CSV only, which is written from the metadata
    g_object_set(sink, "sync", FALSE, "async", FALSE, nullptr);
    watch_end(sink);
    gst_element_link(tee, sink);
  }
  return apply_settings(options_, terrainseg_, overlay_);
}

void Graph::set_size(const GstVideoInfo& info) {
  const auto caps = [&info](const char* format, int width, int height) {
    return gst_caps_new_simple("video/x-raw", "format", G_TYPE_STRING, format, "width", G_TYPE_INT, width,
                               "height", G_TYPE_INT, height, "pixel-aspect-ratio", GST_TYPE_FRACTION,
                               info.par_n, info.par_d, nullptr);
  };
  if (annotated_caps_) {
    const int width = encoded_side(info.width, info), height = encoded_side(info.height, info);
    GstCaps* annotated = caps("I420", width, height);
    const std::string colors = encoded_colorimetry(info);
    gst_caps_set_simple(annotated, "colorimetry", G_TYPE_STRING, colors.c_str(), nullptr);
    set_caps(annotated_caps_, annotated);
    set_caps(annotated_colors_,
             gst_caps_new_simple("video/x-raw", "colorimetry", G_TYPE_STRING, colors.c_str(), nullptr));
    g_object_set(annotated_box_, "right", width - annotated_side(width), "bottom",
                 height - annotated_side(height), nullptr);
  }
  if (recording_caps_) {
    const int width = encoded_side(info.width, info), height = encoded_side(info.height, info);
    GstCaps* recorded = caps("I420", width + (width & 1), height + (height & 1));
    gst_structure_remove_field(gst_caps_get_structure(recorded, 0), "pixel-aspect-ratio");
    const CharPointer colors(gst_video_colorimetry_to_string(&info.colorimetry));
    if (colors && !GST_VIDEO_INFO_IS_RGB(&info)) // otherwise videoconvert 1.22 labels grey as limited
      gst_caps_set_simple(recorded, "colorimetry", G_TYPE_STRING, colors.get(), nullptr);
    set_caps(recording_caps_, recorded);
  }
  if (masks_caps_)
    set_caps(masks_caps_, caps("GRAY8", info.width, info.height));
}

std::optional<Output> Graph::output_of(const GstObject* element) const {
  for (std::size_t i = 0; i < output_count; ++i)
    if (element && (GST_OBJECT(sinks_of_[i]) == element || GST_OBJECT(muxers_[i]) == element))
      return static_cast<Output>(i);
  return std::nullopt;
}

bool Graph::holds(GstObject* element) const {
  return gst_object_has_as_ancestor(element, GST_OBJECT(pipeline_)) && element != GST_OBJECT(source_) &&
         !gst_object_has_as_ancestor(element, GST_OBJECT(source_));
}

std::uint64_t Graph::written() const {
  std::uint64_t sum = 0;
  for (const auto& each : written_)
    sum += each;
  return sum;
}

std::string Graph::bag_metadata() const {
  if (!options_.wants(Output::mcap))
    return {};
  gchar* text = nullptr;
  g_object_get(sinks_of_[static_cast<std::size_t>(Output::mcap)], "bag-metadata", &text, nullptr);
  return take(text);
}

} // namespace terrainseg::process
