// SPDX-License-Identifier: LGPL-2.1-or-later
#include "tools/process/pipeline.hpp"

#include <gst/pbutils/missing-plugins.h>
#include <gst/terrainseg/terrainsegmeta.h>
#include <gst/video/video.h>

#include <algorithm>
#include <array>
#include <chrono>

#include "exchange/counted.hpp"
#include "tools/process/conflicts.hpp"
#include "tools/process/container.hpp"
#include "tools/process/csv_rows.hpp"
#include "tools/process/elements.hpp"
#include "tools/process/handles.hpp"
#include "tools/process/reasons.hpp"
#include "tools/process/source.hpp"
#include "tools/process/still_bottom.hpp"

namespace terrainseg::process {
namespace {

namespace fs = std::filesystem;
using Clock = std::chrono::steady_clock;

/// A source that failed has this long to end its stream by itself.
constexpr std::chrono::seconds grace{2};

constexpr GstClockTime poll_interval = 20 * GST_MSECOND;
/// Between the news that there is no video and the error that says why. Without an error it is waited for in
/// vain.
constexpr std::chrono::seconds error_delay{1};

/// Of one input; a stream that changes its size may give one with each.
constexpr std::size_t most_warnings = 16;

/// Whether an element that reads gave up without a word why (souphttpsrc, when refused). Where what comes
/// after it fails that is told first.
bool source_gave_up(GstMessage* message) {
  const GstStructure* details = nullptr;
  gst_message_parse_error_details(message, &details);
  int flow = GST_FLOW_OK;
  return details && gst_structure_get_int(details, "flow-return", &flow) && flow == GST_FLOW_ERROR;
}

/// Whose fault an error is: of a file or a stream that cannot be opened or read, or of what is in it.
Cause cause_of(GstMessage* message) {
  if (!GST_IS_ELEMENT(message->src) || !GST_OBJECT_FLAG_IS_SET(message->src, GST_ELEMENT_FLAG_SOURCE))
    return Cause::damaged;
  GError* error = nullptr;
  gst_message_parse_error(message, &error, nullptr);
  const bool unreadable = error->domain == GST_RESOURCE_ERROR || source_gave_up(message);
  g_error_free(error);
  return unreadable ? Cause::missing : Cause::damaged;
}

/// A disk or a memory, and no setting or stream.
bool is_of_a_resource(GstMessage* message) {
  GError* error = nullptr;
  gst_message_parse_error(message, &error, nullptr);
  const bool result = error->domain == GST_RESOURCE_ERROR && error->code != GST_RESOURCE_ERROR_SETTINGS;
  g_error_free(error);
  return result;
}

/// An element of this project: its warnings speak of settings and pictures, for whoever started the program.
bool is_of_this_project(const GstObject* from) {
  const GstElementFactory* factory =
      GST_IS_ELEMENT(from) ? gst_element_get_factory(GST_ELEMENT(from)) : nullptr;
  return factory && g_str_has_prefix(GST_OBJECT_NAME(factory), "terrain");
}

bool is_decoding_problem(GstMessage* warning) {
  GError* error = nullptr;
  gst_message_parse_warning(warning, &error, nullptr);
  const bool result = error->domain == GST_STREAM_ERROR;
  g_error_free(error);
  return result;
}

/// What is wrong, for people and for scripts; no cause: nothing is.
struct Fault {
  Cause cause = Cause::none;
  std::string text;
};

/// Folders for outputs that are more than one file; those that are empty in the end go.
class BagFolders {
 public:
  BagFolders() = default;
  ~BagFolders() {
    std::error_code not_empty;
    for (const fs::path& folder : folders_)
      fs::remove(folder, not_empty);
  }
  BagFolders(const BagFolders&) = delete;
  BagFolders& operator=(const BagFolders&) = delete;

  /// The folder of an output, where it is not that of the others.
  [[nodiscard]] std::optional<std::string> make(const fs::path& folder, const fs::path& others) {
    if (folder == others)
      return std::nullopt;
    std::error_code error;
    fs::create_directories(folder, error);
    folders_.push_back(folder);
    if (error)
      return "cannot make the folder " + folder.string() + ": " + error.message();
    return std::nullopt;
  }

 private:
  std::vector<fs::path> folders_;
};

class Run {
 public:
  Run(const Input& input, const Naming& naming, const Options& options, Progress& progress)
      : input_(input), naming_(naming), options_(options), progress_(progress), source_(input, options) {
    gst_segment_init(&segment_, GST_FORMAT_UNDEFINED);
    pipeline_ = gst_pipeline_new(nullptr);
    gst_bin_add(GST_BIN(pipeline_), source_.bin());
  }
  ~Run() {
    gst_element_set_state(pipeline_, GST_STATE_NULL);
    gst_object_unref(pipeline_);
  }
  Run(const Run&) = delete;
  Run& operator=(const Run&) = delete;

  Outcome run(const std::atomic<int>& interrupted);

 private:
  bool wants(Output kind) const { return options_.wanted[static_cast<int>(kind)]; }
  /// The beginning of a message when it comes from what writes a file; empty otherwise.
  std::string unwritten_file(const GstObject* from);
  AtomicFile& file(Output kind) { return files_[static_cast<int>(kind)]; }

  std::optional<std::string> open_files();
  std::optional<std::string> build();
  GstElement* add(const char* factory);
  GstElement* branch(GstElement* tee);
  GstElement* add_sink(Output kind);
  void add_annotated(GstElement* tee);
  void add_masks(GstElement* tee);
  void add_json(GstElement* tee);
  void add_recording(GstElement* tee);
  GstElement* encode_h264(GstElement* from, bool recording);
  void write_bag_metadata();
  void count(GstElement* element, const char* pad, Output kind);
  void watch_end(GstElement* sink);
  static GstPadProbeReturn on_end(GstPad*, GstPadProbeInfo* info, gpointer self);

  void play(const std::atomic<int>& interrupted);
  void handle(GstMessage* message);
  void warn(GstMessage* message);
  void handle_messages(GstBus* bus, GstClockTime timeout);
  void update_progress();
  std::uint64_t moved() const;
  Outcome conclude();
  Fault damage() const;
  std::optional<Fault> cut_off() const;
  Fault emptiness() const;
  std::optional<std::string> miscount() const;
  std::optional<std::string> write_record(const Record& record, const fs::path& path);
  Outcome keep(const Fault& damage);
  Outcome fail(const Fault& fault) const;

  GstPadProbeReturn entering(GstPadProbeInfo* info);
  void segment_entering(GstPadProbeInfo* info);
  void size_known(GstCaps* caps);
  void frame_done(GstBuffer* buffer);
  void learn_from_the_run();
  static GstPadProbeReturn on_entering(GstPad*, GstPadProbeInfo* info, gpointer self);
  static GstPadProbeReturn on_labelled(GstPad*, GstPadProbeInfo* info, gpointer self);
  static GstPadProbeReturn on_written(GstPad*, GstPadProbeInfo*, gpointer counter);

  const Input& input_;
  const Naming& naming_;
  const Options& options_;
  Progress& progress_;
  BagFolders folders_; // removed when the files are gone
  AtomicFile summary_;
  std::array<AtomicFile, output_count> files_;
  std::array<GstElement*, output_count> file_sinks_{}; // of the pipeline
  Record record_;
  Source source_;
  GstElement* pipeline_ = nullptr;
  GstElement* overlay_ = nullptr;
  GstElement* terrainseg_ = nullptr;
  GstElement* annotated_caps_ = nullptr; ///< nullptr where the output is not wanted, like the next two
  GstElement* annotated_box_ = nullptr;
  GstElement* masks_caps_ = nullptr;
  GstElement* recording_caps_ = nullptr;
  std::array<std::atomic<std::uint64_t>, output_count> written_{};

  // The streaming thread's, read by the others when the pipeline has stopped.
  GstSegment segment_{}; ///< of the decoder
  std::uint64_t entered_ = 0;
  GstClockTime next_pts_ = 0;
  GstVideoInfo video_info_{}; ///< behind terrainseg
  StillBottom still_bottom_;
  std::string csv_row_;
  GstVideoRectangle window_{}; ///< of the last frame
  std::uint64_t without_metadata_ = 0;
  std::atomic<std::uint64_t> labelled_{0};
  std::atomic<GstClockTime> position_{0};
  std::atomic<int> sinks_ended_{0};

  // The controlling thread's.
  gint64 duration_ = -1;
  int sinks_ = 0;
  bool stopped_ = false;     ///< by the user
  std::string source_error_; ///< the input's fault
  Cause source_cause_ = Cause::none;
  bool gave_up_ = false;        ///< an element of it, without a word why
  std::string source_warning_;  ///< the first that the decoder gave
  std::string missing_decoder_; ///< why there is none, and what to do
  std::string filter_error_;    ///< behind the decoder: settings, encoders, disk
  Cause filter_cause_ = Cause::none;
};

GstElement* Run::add(const char* factory) {
  GstElement* element = gst_element_factory_make(factory, nullptr);
  gst_bin_add(GST_BIN(pipeline_), element);
  return element;
}

/// A queue behind the tee: every branch works in a thread of its own.
GstElement* Run::branch(GstElement* tee) {
  GstElement* queue = add("queue");
  g_object_set(queue, "max-size-buffers", 4, "max-size-bytes", 0, "max-size-time", guint64{0}, nullptr);
  gst_element_link(tee, queue);
  return queue;
}

/// Writes to the output's file. Without preroll: an encoder may look at 50 frames before it gives the first.
GstElement* Run::add_sink(Output kind) {
  GstElement* sink = add("fdsink");
  g_object_set(sink, "fd", file(kind).fd(), "sync", FALSE, "async", FALSE, nullptr);
  file_sinks_[static_cast<std::size_t>(kind)] = sink;
  watch_end(sink);
  return sink;
}

/// Ends are counted here: behind decodebin, a bin whose sinks are async=false sometimes loses its EOS
/// message. When the event reaches a sink, everything in front of it has been written; what the sink itself
/// does at the end comes after it (play() waits for that).
void Run::watch_end(GstElement* sink) {
  ++sinks_;
  const PadPointer pad(gst_element_get_static_pad(sink, "sink"));
  gst_pad_add_probe(pad.get(), GST_PAD_PROBE_TYPE_EVENT_DOWNSTREAM, on_end, this, nullptr);
}

GstPadProbeReturn Run::on_end(GstPad*, GstPadProbeInfo* info, gpointer self) {
  if (GST_EVENT_TYPE(GST_PAD_PROBE_INFO_EVENT(info)) == GST_EVENT_EOS)
    ++static_cast<Run*>(self)->sinks_ended_;
  return GST_PAD_PROBE_OK;
}

void Run::count(GstElement* element, const char* name, Output kind) {
  PadPointer pad(gst_element_get_static_pad(element, name));
  gst_pad_add_probe(pad.get(), GST_PAD_PROBE_TYPE_BUFFER, on_written, &written_[static_cast<int>(kind)],
                    nullptr);
}

void Run::add_annotated(GstElement* tee) {
  GstElement* queue = branch(tee);
  overlay_ = add("terrainoverlay");
  GstElement* convert = add("videoconvert");
  GstElement* scale = add("videoscale"); // only where a stream changes its size: a file has one
  annotated_caps_ = add("capsfilter");
  annotated_box_ = add("videobox"); // fills up to annotated_side()
  GstElement* mux = add("mp4mux");
  g_object_set(scale, "add-borders", TRUE, nullptr);
  gst_element_link_many(queue, overlay_, convert, scale, annotated_caps_, annotated_box_, nullptr);
  GstElement* encoded = encode_h264(annotated_box_, false);
  gst_element_link_many(encoded, mux, add_sink(Output::annotated), nullptr);
  count(encoded, "src", Output::annotated);
}

/// An encoder, and a parser where one is needed, behind `from`; the last of them.
GstElement* Run::encode_h264(GstElement* from, bool recording) {
  const std::string name = h264_encoder();
  const bool x264 = name == "x264enc";
  GstElement* encoder = add(name.c_str());
  gst_element_link(from, encoder);
  constexpr guint key_frame_distance = 30; // frames that a seek has to decode
  if (x264) {
    gst_util_set_object_arg(G_OBJECT(encoder), "pass", "qual");
    gst_util_set_object_arg(G_OBJECT(encoder), "speed-preset", "veryfast");
    g_object_set(encoder, "quantizer", static_cast<guint>(options_.quality), "threads",
                 static_cast<guint>(options_.threads), nullptr);
    if (recording)
      g_object_set(encoder, "bframes", 0u, "key-int-max", key_frame_distance, nullptr);
  } else {
    gst_util_set_object_arg(G_OBJECT(encoder), "rate-control", "quality");
    g_object_set(encoder, "bitrate", 8'000'000u, "qp-max",
                 static_cast<guint>(std::min(options_.quality + 8, 51)), "multi-thread",
                 static_cast<guint>(options_.threads), nullptr);
    if (recording)
      g_object_set(encoder, "gop-size", key_frame_distance, nullptr);
  }
  if (x264 && !recording)
    return encoder;
  GstElement* parse = add("h264parse");
  gst_element_link(encoder, parse);
  return parse;
}

void Run::add_masks(GstElement* tee) {
  GstElement* queue = branch(tee);
  GstElement* extract = add("terrainextract");
  masks_caps_ = add("capsfilter");
  GstElement* encoder = add("avenc_ffv1");
  GstElement* mux = add("matroskamux");
  const CapsPointer caps(gst_caps_new_simple("video/x-raw", "format", G_TYPE_STRING, "GRAY8", nullptr));
  g_object_set(masks_caps_, "caps", caps.get(), nullptr);
  gst_element_link_many(queue, extract, masks_caps_, encoder, mux, add_sink(Output::masks), nullptr);
  count(encoder, "src", Output::masks);
}

void Run::add_json(GstElement* tee) {
  GstElement* queue = branch(tee);
  GstElement* extract = add("terrainextract");
  g_object_set(extract, "json-mask", static_cast<gboolean>(options_.json_mask), nullptr);
  GstElement* lines = add("capsfilter");
  const CapsPointer caps(gst_caps_new_empty_simple("application/x-ndjson"));
  g_object_set(lines, "caps", caps.get(), nullptr);
  GstElement* sink = add_sink(Output::json);
  gst_element_link_many(queue, extract, lines, sink, nullptr);
  count(sink, "sink", Output::json);
}

/// The untouched video, the metadata and the metres. A scaler makes odd sides even; it keeps the metadata.
void Run::add_recording(GstElement* tee) {
  GstElement* queue = branch(tee);
  GstElement* convert = add("videoconvert");
  GstElement* scale = add("videoscale");
  recording_caps_ = add("capsfilter");
  gst_element_link_many(queue, convert, scale, recording_caps_, nullptr);
  GstElement* sink = add("terrainmcapsink");
  g_object_set(sink, "fd", file(Output::mcap).fd(), "sync", FALSE, "async", FALSE, nullptr);
  for (const char* name : {"camera-info", "mount"})
    g_object_set(sink, name, options_.setting(name).c_str(), nullptr);
  gst_element_link(encode_h264(recording_caps_, true), sink);
  file_sinks_[static_cast<std::size_t>(Output::mcap)] = sink;
  watch_end(sink);
  count(sink, "sink", Output::mcap);
}

/// When the recording is whole.
void Run::write_bag_metadata() {
  gchar* text = nullptr;
  g_object_get(file_sinks_[static_cast<std::size_t>(Output::mcap)], "bag-metadata", &text, nullptr);
  if (const std::string metadata = take(text); !metadata.empty()) {
    file(Output::bag).write(metadata);
    written_[static_cast<int>(Output::bag)] = written_[static_cast<int>(Output::mcap)].load();
  }
}

/// The record's temporary file comes first: who holds it owns the name, whichever outputs are wanted.
std::optional<std::string> Run::open_files() {
  std::error_code error;
  if (const fs::path folder = naming_.record().parent_path(); !folder.empty())
    fs::create_directories(folder, error);
  if (error)
    return "cannot make the folder of " + naming_.record().string() + ": " + error.message();
  if (auto problem = summary_.open(naming_.record()))
    return problem;
  // Another run may have finished another input under this name since the whole batch was looked at.
  if (auto problem = foreign_files(naming_, input_, options_))
    return problem;
  for (int i = 0; i < output_count; ++i) {
    if (!options_.wanted[i])
      continue;
    const fs::path path = naming_.output(static_cast<Output>(i));
    if (auto problem = folders_.make(path.parent_path(), naming_.record().parent_path()))
      return problem;
    if (auto problem = files_[i].open(path))
      return problem;
  }
  return std::nullopt;
}

std::optional<std::string> Run::build() {
  terrainseg_ = add("terrainseg");
  GstElement* tee = add("tee");
  if (!gst_element_link_many(source_.bin(), terrainseg_, tee, nullptr))
    return "cannot connect the decoder with terrainseg";
  if (wants(Output::annotated))
    add_annotated(tee);
  if (wants(Output::masks))
    add_masks(tee);
  if (wants(Output::json))
    add_json(tee);
  if (wants(Output::mcap))
    add_recording(tee);
  if (sinks_ == 0) {
    GstElement* sink = add("fakesink"); // the CSV comes from the metadata
    g_object_set(sink, "sync", FALSE, "async", FALSE, nullptr);
    watch_end(sink);
    gst_element_link(tee, sink);
  }
  const PadPointer in(gst_element_get_static_pad(source_.bin(), "src"));
  gst_pad_add_probe(
      in.get(), static_cast<GstPadProbeType>(GST_PAD_PROBE_TYPE_BUFFER | GST_PAD_PROBE_TYPE_EVENT_DOWNSTREAM),
      on_entering, this, nullptr);
  const PadPointer out(gst_element_get_static_pad(terrainseg_, "src"));
  gst_pad_add_probe(
      out.get(),
      static_cast<GstPadProbeType>(GST_PAD_PROBE_TYPE_BUFFER | GST_PAD_PROBE_TYPE_EVENT_DOWNSTREAM),
      on_labelled, this, nullptr);
  return apply_settings(options_, terrainseg_, overlay_);
}

/// Behind this point a time stamp is the time in the file, as its player shows it: an edit list, or the
/// frames that B-frames hold back, move a demuxer's stamps away from it, and its segment says how far.
void Run::segment_entering(GstPadProbeInfo* info) {
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

/// Frames beyond --frames end the stream; frames without a time get one, because files need it.
GstPadProbeReturn Run::entering(GstPadProbeInfo* info) {
  if (!(GST_PAD_PROBE_INFO_TYPE(info) & GST_PAD_PROBE_TYPE_BUFFER)) {
    if (GST_EVENT_TYPE(GST_PAD_PROBE_INFO_EVENT(info)) == GST_EVENT_SEGMENT)
      segment_entering(info);
    return GST_PAD_PROBE_OK;
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

/// The side of an annotated picture that holds a frame's: H.264 4:2:0 wants even ones, mp4mux 16 pixels and
/// more.
int annotated_side(int side) {
  return std::max(16, side + (side & 1));
}

/// Files have one size: the first frame's. Later frames of another size are scaled to it. Caps may come twice
/// before the first frame: the orientation of a video comes behind them and turns them.
void Run::size_known(GstCaps* caps) {
  GstVideoInfo info;
  if (!gst_video_info_from_caps(&info, caps))
    return;
  video_info_ = info;
  if (labelled_ > 0)
    return;
  record_.width = info.width;
  record_.height = info.height;
  if (annotated_caps_) {
    const CapsPointer filter(gst_caps_new_simple(
        "video/x-raw", "format", G_TYPE_STRING, "I420", "width", G_TYPE_INT, info.width, "height", G_TYPE_INT,
        info.height, "pixel-aspect-ratio", GST_TYPE_FRACTION, info.par_n, info.par_d, "colorimetry",
        G_TYPE_STRING, info.height >= 720 ? "bt709" : "bt601", nullptr));
    g_object_set(annotated_caps_, "caps", filter.get(), nullptr);
    g_object_set(annotated_box_, "right", info.width - annotated_side(info.width), "bottom",
                 info.height - annotated_side(info.height), nullptr);
  }
  if (recording_caps_) {
    const CapsPointer filter(gst_caps_new_simple("video/x-raw", "format", G_TYPE_STRING, "I420", "width",
                                                 G_TYPE_INT, info.width + (info.width & 1), "height",
                                                 G_TYPE_INT, info.height + (info.height & 1), nullptr));
    g_object_set(recording_caps_, "caps", filter.get(), nullptr);
  }
  if (masks_caps_) {
    const CapsPointer filter(gst_caps_new_simple(
        "video/x-raw", "format", G_TYPE_STRING, "GRAY8", "width", G_TYPE_INT, info.width, "height",
        G_TYPE_INT, info.height, "pixel-aspect-ratio", GST_TYPE_FRACTION, info.par_n, info.par_d, nullptr));
    g_object_set(masks_caps_, "caps", filter.get(), nullptr);
  }
}

void Run::frame_done(GstBuffer* buffer) {
  position_ = GST_BUFFER_PTS(buffer);
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
    if (wants(Output::csv)) {
      make_csv_row(csv_row_, buffer, meta);
      file(Output::csv).write(csv_row_);
      ++written_[static_cast<int>(Output::csv)];
    }
  } else {
    ++without_metadata_;
  }
  ++labelled_;
}

GstPadProbeReturn Run::on_entering(GstPad*, GstPadProbeInfo* info, gpointer self) {
  return static_cast<Run*>(self)->entering(info);
}

GstPadProbeReturn Run::on_labelled(GstPad*, GstPadProbeInfo* info, gpointer self) {
  Run* run = static_cast<Run*>(self);
  if (GST_PAD_PROBE_INFO_TYPE(info) & GST_PAD_PROBE_TYPE_BUFFER) {
    run->frame_done(GST_PAD_PROBE_INFO_BUFFER(info));
  } else if (GstEvent* event = GST_PAD_PROBE_INFO_EVENT(info); GST_EVENT_TYPE(event) == GST_EVENT_CAPS) {
    GstCaps* caps = nullptr;
    gst_event_parse_caps(event, &caps);
    run->size_known(caps);
  }
  return GST_PAD_PROBE_OK;
}

GstPadProbeReturn Run::on_written(GstPad*, GstPadProbeInfo*, gpointer counter) {
  ++*static_cast<std::atomic<std::uint64_t>*>(counter);
  return GST_PAD_PROBE_OK;
}

void Run::handle(GstMessage* message) {
  const bool decoding = message->src == GST_OBJECT(source_.bin()) ||
                        gst_object_has_as_ancestor(message->src, GST_OBJECT(source_.bin()));
  switch (GST_MESSAGE_TYPE(message)) {
  case GST_MESSAGE_ERROR: {
    std::string& error = decoding ? source_error_ : filter_error_;
    if (!error.empty())
      break;
    const std::string file = is_of_a_resource(message) ? unwritten_file(message->src) : "";
    gave_up_ = decoding && says_nothing(message);
    error = file + (gave_up_ ? giving_up(message) : text_of(message));
    if (!decoding) {
      filter_cause_ = file.empty() ? Cause::unsupported : Cause::disk;
      break;
    }
    source_cause_ = cause_of(message);
    if (source_cause_ == Cause::missing && source_gave_up(message))
      error = "it cannot be reached or read: " + error;
    break;
  }
  case GST_MESSAGE_WARNING:
    if (decoding && source_warning_.empty() && is_decoding_problem(message))
      source_warning_ = text_of(message);
    if (is_of_this_project(message->src))
      warn(message);
    break;
  case GST_MESSAGE_ELEMENT:
    if (gst_is_missing_plugin_message(message) && missing_decoder_.empty())
      missing_decoder_ = no_decoder(message);
    break;
  default:
    break;
  }
}

/// Each text once: several outputs are made from the same metadata.
void Run::warn(GstMessage* message) {
  GError* error = nullptr;
  gst_message_parse_warning(message, &error, nullptr);
  const std::string text = error->message;
  g_error_free(error);
  std::vector<std::string>& known = record_.warnings;
  if (known.size() < most_warnings && std::find(known.begin(), known.end(), text) == known.end())
    known.push_back(text);
}

std::string Run::unwritten_file(const GstObject* from) {
  for (std::size_t i = 0; i < files_.size(); ++i)
    if (file_sinks_[i] && GST_OBJECT(file_sinks_[i]) == from)
      return "cannot write " + files_[i].final_path().string() + ": ";
  return {};
}

std::uint64_t Run::moved() const {
  std::uint64_t sum = labelled_;
  for (const auto& written : written_)
    sum += written;
  return sum;
}

void Run::update_progress() {
  progress_.frames = labelled_.load();
  std::uint64_t done = position_, whole = 0;
  if (options_.max_frames || input_.kind == Input::Kind::images) {
    done = labelled_;
    whole = input_.images.empty() ? options_.max_frames : input_.images.size();
    if (options_.max_frames)
      whole = std::min(whole, options_.max_frames);
  } else {
    if (duration_ <= 0)
      gst_element_query_duration(source_.bin(), GST_FORMAT_TIME, &duration_);
    whole = static_cast<std::uint64_t>(std::max<gint64>(duration_, 0));
  }
  if (whole)
    progress_.permille =
        static_cast<int>(std::min<std::uint64_t>(gst_util_uint64_scale(done, 1000, whole), 1000));
}

/// Waits for a message as long as `timeout`, then takes all that are there.
void Run::handle_messages(GstBus* bus, GstClockTime timeout) {
  constexpr auto wanted =
      static_cast<GstMessageType>(GST_MESSAGE_ERROR | GST_MESSAGE_WARNING | GST_MESSAGE_ELEMENT);
  while (const MessagePointer message{gst_bus_timed_pop_filtered(bus, timeout, wanted)}) {
    handle(message.get());
    timeout = 0;
  }
}

void Run::play(const std::atomic<int>& interrupted) {
  const BusPointer bus(gst_element_get_bus(pipeline_));
  if (gst_element_set_state(pipeline_, GST_STATE_PLAYING) == GST_STATE_CHANGE_FAILURE) {
    const MessagePointer message(gst_bus_timed_pop_filtered(bus.get(), 0, GST_MESSAGE_ERROR));
    if (message)
      handle(message.get());
    if (source_error_.empty() && filter_error_.empty())
      filter_error_ = "the pipeline does not start";
    if (filter_cause_ == Cause::none)
      filter_cause_ = Cause::resources;
    return;
  }
  const std::chrono::seconds patience(options_.stall_seconds);
  auto last_move = Clock::now();
  std::uint64_t last_moved = 0;
  bool asked_to_end = false;
  while (sinks_ended_ < sinks_ && filter_error_.empty()) {
    handle_messages(bus.get(), poll_interval);
    update_progress();

    const auto now = Clock::now();
    if (const std::uint64_t moves = moved(); moves != last_moved) {
      last_moved = moves;
      last_move = now;
    }
    // A stream has no end of its own: the first interruption is its end. A file is simply not done.
    if (interrupted && (input_.kind != Input::Kind::uri || interrupted > 1 || labelled_ == 0)) {
      stopped_ = true;
      return;
    }
    const bool failed = !source_error_.empty() || !source_.problem().empty();
    if (failed && labelled_ == 0 && (!source_.has_video() || now - last_move > grace)) {
      // The error that says why may be on its way, and late on a busy machine.
      for (const auto until = now + error_delay; source_error_.empty() && Clock::now() < until;)
        handle_messages(bus.get(), poll_interval);
      return;
    }
    if (!asked_to_end && labelled_ > 0 && (interrupted || (failed && now - last_move > grace))) {
      asked_to_end = true;
      source_.end();
    }
    if (now - last_move > grace && source_.has_given_up())
      return;
    if (now - last_move > patience) {
      if (source_error_.empty()) {
        source_error_ = "no frame came for " + std::to_string(options_.stall_seconds) +
                        " s (--stall-timeout): the decoder hangs or its source gives nothing";
        source_cause_ = input_.kind == Input::Kind::uri ? Cause::missing : Cause::stalled;
      }
      if (asked_to_end || labelled_ == 0)
        return;
      asked_to_end = true;
      last_move = now;
      source_.end();
    }
  }
  // The ends have reached the sinks; stopping their threads waits for what they still write, and say of it.
  gst_element_set_state(pipeline_, GST_STATE_READY);
  handle_messages(bus.get(), 0);
}

std::optional<Fault> Run::cut_off() const {
  if (input_.kind != Input::Kind::file)
    return std::nullopt;
  if (const auto length = missing_length(input_.path))
    return Fault{Cause::damaged, "the file is cut off: " + std::to_string(record_.identity.bytes) + " of " +
                                     std::to_string(*length) + " bytes are there"};
  if (lacks_end_mark(input_.path))
    return Fault{Cause::damaged, "the file is cut off: its end mark is missing"};
  return std::nullopt;
}

/// Why not a single frame came.
Fault Run::emptiness() const {
  if (!missing_decoder_.empty())
    return {Cause::unsupported, missing_decoder_};
  if (const std::string problem = source_.problem();
      !problem.empty() && (problem != no_video || source_error_.empty()))
    return {source_.cause(), problem};
  if (!source_.has_video() && !source_.other_streams().empty())
    return {Cause::unsupported, "there is no video in it, only " + source_.other_streams()};
  if (auto cut = cut_off()) {
    cut->text += source_error_.empty() ? "" : "; " + source_error_;
    return *cut;
  }
  if (!source_error_.empty()) {
    const std::string image = source_.image_after(0);
    return {source_cause_,
            (image.empty() ? "" : image + ": ") + source_error_ +
                (gave_up_ && source_cause_ == Cause::damaged ? std::string("; ") + make_it_anew : "")};
  }
  return {Cause::unsupported, no_video};
}

/// What is wrong with an input of which frames came.
Fault Run::damage() const {
  if (!source_.problem().empty())
    return {source_.cause(), source_.problem()};
  if (!source_error_.empty()) {
    const std::string image = source_.image_after(labelled_);
    return {source_cause_, (image.empty() ? "" : image + ": ") + source_error_};
  }
  if (options_.max_frames && labelled_ >= options_.max_frames)
    return {};
  if (input_.kind == Input::Kind::images && labelled_ < input_.images.size())
    return {Cause::damaged, source_.image_after(labelled_) + ": no picture came out of it" +
                                (source_warning_.empty() ? "" : ": " + source_warning_)};
  if (const auto cut = cut_off())
    return *cut;
  if (!source_warning_.empty())
    return {Cause::damaged, source_warning_};
  if (const std::uint64_t lost = source_.lost(); lost > 0)
    return {Cause::damaged, counted(lost, "frame") + " in it could not be decoded"};
  if (source_.corrupted() > 0)
    return {Cause::damaged, "the decoder marked " + counted(source_.corrupted(), "frame") + " as damaged"};
  return {};
}

/// Every output must hold every frame; if one does not, none is kept.
std::optional<std::string> Run::miscount() const {
  if (without_metadata_ > 0)
    return counted(without_metadata_, "frame") + " came without metadata out of terrainseg";
  for (int i = 0; i < output_count; ++i)
    if (options_.wanted[i] && written_[i] != labelled_)
      return std::string(output_kinds[i].name) + " holds " + std::to_string(written_[i]) + " of " +
             counted(labelled_, "frame");
  return std::nullopt;
}

/// Writes a record under its name. The name stays owned: its temporary file is there again afterwards.
std::optional<std::string> Run::write_record(const Record& record, const fs::path& path) {
  summary_.write(record.to_json());
  if (auto problem = summary_.commit(path))
    return problem;
  return summary_.open(naming_.record());
}

/// Nothing is kept.
Outcome Run::fail(const Fault& fault) const {
  Outcome outcome;
  outcome.record = record_;
  outcome.record.problem = fault.text;
  outcome.record.cause = fault.cause;
  return outcome;
}

Outcome Run::keep(const Fault& damage) {
  Outcome outcome;
  outcome.record = record_;
  outcome.record.problem = damage.text;
  outcome.record.cause = damage.cause;
  const bool partial = damage.cause != Cause::none;
  // From here until the new record is there, nothing may say that these outputs are complete; but whose they
  // are must be said at every moment.
  const fs::path record = naming_.record(partial);
  Record announced = record_;
  announced.problem = "its outputs are being renamed";
  announced.cause = Cause::interrupted; // if this is what stays
  if (auto problem = write_record(announced, record))
    return fail({Cause::disk, *problem});
  for (int i = 0; i < output_count; ++i) {
    if (!options_.wanted[i])
      continue;
    const fs::path path = naming_.output(static_cast<Output>(i), partial);
    outcome.record.outputs[i] =
        Record::Written{path.lexically_relative(record.parent_path()).string(), files_[i].size()};
    if (auto problem = folders_.make(path.parent_path(), naming_.record().parent_path()))
      return fail({Cause::disk, *problem});
    if (auto problem = files_[i].commit(path))
      return fail({Cause::disk, *problem});
  }
  if (auto problem = write_record(outcome.record, record))
    return fail({Cause::disk, *problem});
  std::error_code ignored;
  if (!partial) { // what an earlier attempt could save is of no use beside the whole
    for (int i = 0; i < output_count; ++i)
      fs::remove(naming_.output(static_cast<Output>(i), true), ignored);
    fs::remove(naming_.output(Output::bag, true).parent_path(),
               ignored); // stays where something else is in it
    fs::remove(naming_.record(true), ignored);
  }
  outcome.kind = partial ? Outcome::Kind::partial : Outcome::Kind::complete;
  return outcome;
}

Outcome Run::conclude() {
  if (stopped_) {
    Outcome outcome = fail({Cause::interrupted, "interrupted"});
    outcome.kind = Outcome::Kind::interrupted;
    return outcome;
  }
  if (!filter_error_.empty())
    return fail({filter_cause_, filter_error_});
  if (labelled_ == 0)
    return fail(emptiness());
  if (wants(Output::mcap))
    write_bag_metadata();
  if (auto problem = miscount())
    return fail({source_error_.empty() ? Cause::resources : source_cause_,
                 source_error_.empty() ? *problem : source_error_ + "; " + *problem});
  return keep(damage());
}

/// What only shows when all frames are through.
void Run::learn_from_the_run() {
  GstStructure* stats = nullptr;
  g_object_get(terrainseg_, "stats", &stats, nullptr);
  double microseconds = 0;
  if (stats && gst_structure_get_double(stats, "total-median-us", &microseconds))
    record_.filter_milliseconds = microseconds / 1000;
  if (stats)
    gst_structure_free(stats);
  const int rows = still_bottom_.rows();
  if (window_.h > 0 && window_.y + window_.h > video_info_.height - rows)
    record_.still_rows = rows;
}

Outcome Run::run(const std::atomic<int>& interrupted) {
  record_.input = input_.label;
  record_.place = input_.place();
  record_.identity = input_.identity();
  record_.settings = describe(options_, input_);
  if (auto problem = open_files())
    return fail({Cause::disk, *problem});
  if (auto problem = build())
    return fail({Cause::resources, *problem});
  if (wants(Output::csv))
    file(Output::csv).write(csv_header);
  const auto begin = Clock::now();
  play(interrupted);
  gst_element_set_state(pipeline_, GST_STATE_NULL);
  update_progress();
  record_.seconds = std::chrono::duration<double>(Clock::now() - begin).count();
  record_.frames = labelled_;
  learn_from_the_run();
  return conclude();
}

} // namespace

Outcome process(const Input& input, const Naming& naming, const Options& options, Progress& progress,
                const std::atomic<int>& interrupted) {
  if (!input.problem.empty()) {
    Outcome outcome;
    outcome.record.input = input.label;
    outcome.record.problem = input.problem;
    outcome.record.cause = input.cause;
    return outcome;
  }
  return Run(input, naming, options, progress).run(interrupted);
}

} // namespace terrainseg::process
