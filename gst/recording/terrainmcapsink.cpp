// SPDX-License-Identifier: LGPL-2.1-or-later

#include <fcntl.h>
#include <gst/base/gstbasesink.h>
#include <unistd.h>

#include <cerrno>
#include <filesystem>
#include <optional>
#include <string>
#include <utility>

#include "exchange/write_all.hpp"
#include "recording/frame_reader.hpp"
#include "recording/terrain_recording.hpp"
#include "support/element.hpp"
#include "support/meta.hpp"
#include "support/times.hpp"
#include "terrainseg_config.h"

GST_DEBUG_CATEGORY_STATIC(terrainmcapsink_debug);
#define GST_CAT_DEFAULT terrainmcapsink_debug

using namespace terrainseg;

namespace {

namespace fs = std::filesystem;

struct SinkSettings {
  MessageSettings messages;
  std::string location;
  int fd = -1;
  std::string bag_metadata; ///< of the last finished recording
};

constexpr auto common = message_rows<&SinkSettings::messages>(
    "Calibration file of the camera (ROS, Kalibr or OpenCV YAML) for the topic /camera/camera_info, none = "
    "without this topic",
    "Pose of the camera over the ground (a file, or height=..,pitch=..) for the topic /tf, none = without "
    "this topic",
    "Size of a cell of /terrain/grid in metres, doubled until a side has at most 512 cells");
const Property<SinkSettings> table[] = {
    common[0],
    common[1],
    common[2],
    common[3],
    common[4],
    common[5],
    {"location", "Location",
     "File NAME.mcap, or a folder for a ROS 2 bag (NAME_0.mcap, metadata.yaml); named *.part until complete",
     property_before_start, field<&SinkSettings::location>()},
    {"fd", "File descriptor", "Open descriptor to write to instead of a location, -1 = none",
     property_before_start, field<&SinkSettings::fd>(-1, G_MAXINT)},
    {"bag-metadata", "Bag metadata",
     "Content of metadata.yaml for the last complete recording; if it was written to fd, its file is named "
     "terrain.mcap",
     property_readable, field<&SinkSettings::bag_metadata>()},
};

std::string quoted(const fs::path& path) {
  return std::string("\"").append(path.string()).append("\"");
}

int create(const fs::path& path) {
  return ::open(path.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC | O_NOFOLLOW, 0666);
}

/// Returns 0 or the errno. Pipes and devices need no fsync.
int sync_file(int fd) {
  return fsync(fd) == 0 || errno == EINVAL || errno == EROFS ? 0 : errno;
}

/// An error message for the user, and its errno.
struct FileProblem {
  std::string text;
  int error;
};

FileProblem failed(const std::string& what, const fs::path& path, int error) {
  return {what + " " + quoted(path) + ": " + g_strerror(error), error};
}

/// The file of a recording. It has a temporary name until it is complete, and never replaces another file.
/// Throws FileProblem.
class RecordingFile {
 public:
  RecordingFile() = default;
  ~RecordingFile() { abandon(); }
  RecordingFile(const RecordingFile&) = delete;
  RecordingFile& operator=(const RecordingFile&) = delete;

  /// `location` is a file NAME.mcap, or a folder that is created as a ROS 2 bag: NAME/NAME_0.mcap and
  /// NAME/metadata.yaml. The file is named *.part until finish(). Refuses existing files.
  void open(const std::string& location) {
    abandon();
    path_ = location;
    metadata_.clear();
    if (path_.extension() != ".mcap") {
      if (!path_.has_filename()) // the name ends with a slash
        path_ = path_.parent_path();
      std::error_code error;
      fs::create_directories(path_, error);
      if (error)
        throw failed("Cannot make the folder", path_, error.value());
      metadata_ = path_ / "metadata.yaml";
      path_ /= path_.filename().string() + "_0.mcap";
    }
    part_ = path_;
    part_ += ".part";
    for (const fs::path& path : {path_, metadata_}) {
      std::error_code ignored;
      if (!path.empty() && fs::exists(fs::symlink_status(path, ignored)))
        throw FileProblem{quoted(path) + " already exists, and recordings never replace files. Choose "
                                         "another location or move it away",
                          EEXIST};
    }
    fd_ = create(part_);
    if (fd_ < 0 && errno == EEXIST)
      throw FileProblem{quoted(part_) +
                            " already exists: another recording is writing it, or was killed. Choose "
                            "another location, or move the file away: it can be read up to its end",
                        EEXIST};
    if (fd_ < 0)
      throw failed("Cannot write", part_, errno);
  }
  /// Writes to a descriptor. The caller closes it and names the file.
  void open(int fd) {
    abandon();
    path_ = part_ = metadata_ = fs::path(); // of the previous recording
    fd_ = fd;
  }

  void write(recording::ByteView bytes) const { check(write_all(fd_, bytes)); }
  /// Flushes to disk, then renames the file; in a bag it also writes `metadata`.
  void finish(const std::string& metadata) {
    const int fd = std::exchange(fd_, -1);
    if (path_.empty())
      return;
    const int unsynced = sync_file(fd);
    close(fd);
    check(unsynced);
    if (rename(part_.c_str(), path_.c_str()) != 0)
      throw failed("Cannot give its name to", path_, errno);
    if (metadata_.empty())
      return;
    const int list = create(metadata_);
    if (list < 0)
      throw failed("Cannot write", metadata_, errno);
    int error = write_all(list, recording::bytes_of(metadata));
    if (error == 0)
      error = sync_file(list);
    close(list);
    if (error != 0)
      throw failed("Cannot write", metadata_, error);
  }
  /// Closes the file and keeps its temporary name.
  void abandon() {
    if (fd_ >= 0 && !path_.empty())
      close(fd_);
    fd_ = -1;
  }

  /// Name of the file in its folder; empty for a descriptor.
  std::string name() const { return path_.filename().string(); }

 private:
  /// Throws if there is an errno of a write.
  void check(int error) const {
    if (error == 0)
      return;
    FileProblem problem =
        path_.empty() ? FileProblem{g_strerror(error), error} : failed("Cannot write", part_, error);
    problem.text += path_.empty() ? "" : ". It can be read to where it ends";
    throw problem;
  }

  fs::path path_, part_, metadata_; ///< metadata_ is empty without a bag
  int fd_ = -1;
};

/// One clock for a whole recording: that of its first frame. Its times never fall, and rise as the stream's
/// do.
class RecordingClock {
 public:
  struct Times {
    std::optional<GstClockTime> utc; ///< of the frame, where it has one
    GstClockTime stream;
    GstClockTime base; ///< of the pipeline: another one after a pause
  };
  /// Nanoseconds.
  std::uint64_t time_of(const Times& frame) {
    if (!last_) {
      wall_ = frame.utc.has_value();
      last_ = frame;
      return time_ = wall_ ? *frame.utc : frame.stream;
    }
    const GstClockTime expected =
        time_ + (frame.stream > last_->stream ? frame.stream - last_->stream : GST_MSECOND);
    GstClockTime time = expected; // between frames that have a time of day
    if (!wall_ || frame.utc) {
      time = correction_ + (wall_ ? *frame.utc : frame.stream);
      const auto ahead = static_cast<GstClockTimeDiff>(time - expected);
      const bool paused = frame.base != last_->base && ahead > 0;
      if ((ahead > largest_slew && !paused) || ahead < -largest_slew || time < time_) {
        correction_ -= static_cast<std::uint64_t>(ahead);
        step_ = ahead;
        time = expected;
      }
    }
    last_ = frame;
    return time_ = time;
  }
  /// By how much the source's clock was set at the last frame; once.
  GstClockTimeDiff take_step() { return std::exchange(step_, 0); }
  bool is_wall() const { return wall_; }
  /// Whether a time of day came too late.
  bool misses(const std::optional<GstClockTime>& utc) const { return last_ && !wall_ && utc; }

 private:
  /// Between two frames. A clock that is corrected by more is set, not slewed: chrony's and ntpd's bound is
  /// 128 ms.
  static constexpr GstClockTimeDiff largest_slew = 100 * GST_MSECOND;
  bool wall_ = false;
  std::optional<Times> last_;
  std::uint64_t time_ = 0;
  std::uint64_t correction_ = 0; ///< added to the frame's time, modulo 2^64
  GstClockTimeDiff step_ = 0;
};

/// Everything behind the instance.
struct SinkState {
  GstBaseSink* element = nullptr;
  SinkSettings settings; // under the object lock

  RecordingFile file;                                   // streaming
  std::optional<recording::TerrainRecording> recording; // streaming; nothing after the end
  RecordingClock clock;                                 // streaming
  PictureKind kind = PictureKind::raw;                  // streaming
  std::uint64_t frames = 0, labelled = 0;               // streaming
  bool warned_metadata = false, warned_clock = false;   // streaming
  bool warned_step = false;                             // streaming

  SinkState() noexcept {} // the frame names are short strings and need no allocation
};

/**
 * SECTION:element-terrainmcapsink
 * @title: terrainmcapsink
 * @short_description: video and terrain metadata as an MCAP recording
 *
 * Records the terrain metadata of video as ROS 2 messages, and the video with it when it is H.264 or JPEG, in
 * a file that Foxglove and ROS 2 open.
 *
 * ## Example launch line
 * |[
 * gst-launch-1.0 terrainscenesrc num-buffers=60 ! terrainseg ! videoconvert ! x264enc bframes=0 ! h264parse !
 * terrainmcapsink location=drive.mcap
 * ]|
 *
 * Since: 0.1
 */
using GstTerrainMcapSink = Instance<GstBaseSink, SinkState>;
using GstTerrainMcapSinkClass = GstBaseSinkClass;

G_DEFINE_TYPE(GstTerrainMcapSink, gst_terrain_mcap_sink, GST_TYPE_BASE_SINK)

// ---- the file --------------------------------------------------------------------------------------------

/// Runs `body`. When it throws, posts the error, and stops recording.
template <class Body> bool reported(SinkState& s, bool opening, Body body) {
  try {
    body();
    return true;
  } catch (const FileProblem& problem) {
    const bool full = problem.error == ENOSPC || problem.error == EDQUOT;
    const GstResourceError code = full      ? GST_RESOURCE_ERROR_NO_SPACE_LEFT
                                  : opening ? GST_RESOURCE_ERROR_OPEN_WRITE
                                            : GST_RESOURCE_ERROR_WRITE;
    gst_element_message_full(
        GST_ELEMENT(s.element), GST_MESSAGE_ERROR, GST_RESOURCE_ERROR, code,
        g_strconcat(problem.text.c_str(), problem.text.ends_with('.') ? "" : ".", nullptr),
        g_strdup_printf("errno %d", problem.error), __FILE__, GST_FUNCTION, __LINE__);
    s.recording.reset();
    s.file.abandon();
    return false;
  }
}

bool open_recording(SinkState& s) {
  SinkSettings set;
  {
    ObjectLock lock(s.element);
    set = s.settings;
    s.settings.bag_metadata.clear();
  }
  if (set.location.empty() == (set.fd < 0)) {
    GST_ELEMENT_ERROR(
        s.element, RESOURCE, NOT_FOUND,
        ("Set either location or fd, not both, for example: terrainmcapsink location=drive.mcap."),
        ("location \"%s\", fd %d", set.location.c_str(), set.fd));
    return false;
  }
  auto options = read_options(s.element, set.messages);
  if (!options)
    return false;
  if (set.location.empty())
    s.file.open(set.fd);
  else if (!reported(s, true, [&] { s.file.open(set.location); }))
    return false;
  s.clock = {};
  s.frames = s.labelled = 0;
  s.warned_metadata = s.warned_clock = s.warned_step = false;
  s.recording.emplace([&s](recording::ByteView bytes) { s.file.write(bytes); }, std::move(*options));
  return true;
}

/// Ends the recording, if any. Returns false after posting an error.
bool finish(SinkState& s) {
  if (!s.recording)
    return true;
  const std::string name = s.file.name();
  std::string metadata;
  const bool whole = reported(s, false, [&] {
    s.recording->finish();
    metadata = s.recording->bag_metadata(name.empty() ? "terrain.mcap" : name);
    s.recording.reset();
    s.file.finish(metadata);
  });
  if (!whole)
    return false;
  if (s.frames > 0 && s.labelled == 0)
    GST_ELEMENT_WARNING(s.element, STREAM, FAILED,
                        ("No frame had terrain metadata, so the recording contains none. Add terrainseg "
                         "before terrainmcapsink, without an element between them that drops metadata "
                         "(videocrop, videobox, videoflip, compositor)."),
                        ("no GstTerrainSegMeta on %" G_GUINT64_FORMAT " frames", s.frames));
  GST_DEBUG_OBJECT(s.element,
                   "\"%s\" is complete: %" G_GUINT64_FORMAT " frames, %" G_GUINT64_FORMAT " with terrain",
                   name.c_str(), static_cast<guint64>(s.frames), static_cast<guint64>(s.labelled));
  ObjectLock lock(s.element);
  s.settings.bag_metadata = std::move(metadata);
  return true;
}

// ---- frames ----------------------------------------------------------------------------------------------

/// Returns nothing after posting an error.
std::optional<std::uint64_t> time_of(SinkState& s, GstBuffer* buffer) {
  const GstSegment& segment = s.element->segment;
  GstClockTime stream = GST_BUFFER_PTS(buffer);
  if (segment.format == GST_FORMAT_TIME && GST_CLOCK_TIME_IS_VALID(stream))
    stream = stream_time_of(segment, stream);
  if (!GST_CLOCK_TIME_IS_VALID(stream)) {
    GST_ELEMENT_ERROR(s.element, STREAM, FORMAT,
                      ("Frames without time stamps cannot be recorded. Set do-timestamp=true on the source."),
                      (nullptr));
    return std::nullopt;
  }
  const auto utc = utc_of(buffer);
  if (s.clock.misses(utc) && !std::exchange(s.warned_clock, true))
    GST_ELEMENT_WARNING(s.element, STREAM, FAILED,
                        ("The time of day became known after the start of the recording, which continues in "
                         "stream time. Start the recording later, or set start-time on terrainseg."),
                        (nullptr));
  const std::uint64_t time =
      s.clock.time_of({utc, stream, gst_element_get_base_time(GST_ELEMENT(s.element))});
  if (const GstClockTimeDiff step = s.clock.take_step(); step != 0 && !std::exchange(s.warned_step, true))
    GST_ELEMENT_WARNING(s.element, STREAM, FAILED,
                        ("%s jumped by %.3f s, as when a clock is set. The recording continues from the "
                         "previous time, so that its times increase. Start a new recording for the new time.",
                         s.clock.is_wall() ? "The frames' time of day" : "The stream time",
                         static_cast<double>(step) / GST_SECOND),
                        (nullptr));
  return time;
}

GstFlowReturn record(SinkState& s, GstBuffer* buffer) {
  if (!s.recording)
    return GST_FLOW_EOS;
  const auto time = time_of(s, buffer);
  if (!time)
    return GST_FLOW_ERROR;
  const FrameReader reader(buffer, s.kind, s.settings.messages.source.c_str());
  if (!reader.check(s.element, "players of recordings", "recorded", s.warned_metadata))
    return GST_FLOW_ERROR;
  GST_LOG_OBJECT(s.element, "%s at %" GST_TIME_FORMAT ": %" GST_PTR_FORMAT, reader.content(),
                 GST_TIME_ARGS(*time), printable(buffer));
  ++s.frames;
  s.labelled += reader.has_estimate() ? 1 : 0;
  const bool added = reported(s, false, [&] { s.recording->add(reader.frame(*time)); });
  return added ? GST_FLOW_OK : GST_FLOW_ERROR;
}

bool set_caps(SinkState& s, GstCaps* caps) {
  GST_DEBUG_OBJECT(s.element, "caps %" GST_PTR_FORMAT, printable(caps));
  s.kind = kind_of(caps);
  return true;
}

gboolean take_event(SinkState& s, GstEvent* event) {
  if (GST_EVENT_TYPE(event) == GST_EVENT_EOS && !finish(s)) { // only the error is reported
    gst_event_unref(event);
    return FALSE;
  }
  return GST_BASE_SINK_CLASS(gst_terrain_mcap_sink_parent_class)->event(s.element, event);
}

void gst_terrain_mcap_sink_class_init(GstTerrainMcapSinkClass* klass) {
  GST_DEBUG_CATEGORY_INIT(terrainmcapsink_debug, "terrainmcapsink", 0, "recordings of terrain metadata");
  init_class<GstTerrainMcapSink, gst_terrain_mcap_sink_parent_class, table>(
      klass, {"Terrain recorder", "Sink/File/Metadata/Video",
              "Records video and terrain metadata as MCAP, for Foxglove and ROS 2"});
  init_message_sink_class(klass);
  GstBaseSinkClass* sink_class = GST_BASE_SINK_CLASS(klass);
  sink_class->start = GstTerrainMcapSink::call<open_recording>;
  // Also called when the pipeline is stopped without EOS.
  sink_class->stop = GstTerrainMcapSink::call<finish>;
  sink_class->set_caps = GstTerrainMcapSink::call<set_caps>;
  sink_class->render = GstTerrainMcapSink::call<record>;
  sink_class->event = GstTerrainMcapSink::call<take_event>;
}

void gst_terrain_mcap_sink_init(GstTerrainMcapSink* self) {
  const SinkState& s = self->make_state();
  gst_base_sink_set_sync(s.element, FALSE); // a file is written as fast as frames come
  gst_base_sink_set_last_sample_enabled(s.element, FALSE);
}

} // namespace

GST_ELEMENT_REGISTER_DEFINE(terrainmcapsink, "terrainmcapsink", GST_RANK_NONE,
                            gst_terrain_mcap_sink_get_type())

// A separate plugin, so that the main one does not depend on zstd.
static gboolean plugin_init(GstPlugin* plugin) {
  return register_metas() && GST_ELEMENT_REGISTER(terrainmcapsink, plugin);
}

GST_PLUGIN_DEFINE(GST_VERSION_MAJOR, GST_VERSION_MINOR, terrainmcap,
                  "Records terrain metadata for Foxglove and ROS 2", plugin_init, TERRAINSEG_VERSION, "LGPL",
                  "terrainseg", TERRAINSEG_ORIGIN)
