// SPDX-License-Identifier: LGPL-2.1-or-later
#include "tools/process/graph.hpp"

#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <cstring>
#include <numeric>
#include <stdexcept>
#include <vector>

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
  if (h264_encoder() == std::string("x264enc"))
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

} // namespace terrainseg::process
