// SPDX-License-Identifier: LGPL-2.1-or-later

#include <gst/terrainseg/terrainsegmeta.h>

#include <chrono>
#include <memory>
#include <optional>
#include <string>
#include <utility>

#include "elements/terrainseg/analytics.hpp"
#include "elements/terrainseg/announcer.hpp"
#include "elements/terrainseg/frame_settings.hpp"
#include "elements/terrainseg/metric_stage.hpp"
#include "elements/terrainseg/shared.hpp"
#include "elements/terrainseg/summary.hpp"
#include "exchange/model_file.hpp"
#include "support/buffers.hpp"
#include "support/colour_watch.hpp"
#include "support/element.hpp"
#include "support/estimate_meta.hpp"
#include "support/meta.hpp"
#include "support/metric_drawing.hpp"
#include "support/pixel_metas.hpp"
#include "support/times.hpp"
#include "support/transform.hpp"
#include "support/video_frame.hpp"

GST_DEBUG_CATEGORY(terrainseg_debug);

namespace terrainseg {
/// What the streaming thread alone touches, or others while there is none.
struct Streaming {
  FrameSettings settings;
  GstVideoInfo info = no_video();
  std::optional<ColorSpace> space; ///< of the caps
  std::string stream_id;
  bool fresh = true; ///< no frame since the start
  struct {
    Once<> misfit;        ///< video, terrain or calibration that does not fit
    Once<> training_flaw; ///< of training pixels
    Once<> veto_flaw;     ///< of vetoed pixels
    Once<> still_window;
  } told; ///< since the start
  ColourWatch colours;
  TrainingReader training;
  VetoReader veto;
  MaskPool masks, confidence_maps;
  SmallPool boundaries;
  MetricStage metres;     ///< its poses come from any thread: it locks them by itself
  std::string shape_flaw; ///< of the calibration, for the frames of these caps; waits for the first
  MetricWriter metre_writer;
  MetricDrawing drawing;
  std::optional<GstClockTime> start_utc; ///< of start-time
  Announcer announcer;
  Summary summary;
#ifdef TERRAINSEG_ANALYTICS
  AnalyticsWriter analytics;
#endif
};

/// Everything behind the instance.
struct ElementState {
  Shared shared;
  Streaming streaming;
};

} // namespace terrainseg

using namespace terrainseg;

/**
 * SECTION:element-terrainseg
 * @title: terrainseg
 * @short_description: learns the ground in front of a rover and labels what is traversable
 *
 * Learns the appearance of the ground in a window in front of the rover, labels every pixel as traversable,
 * not traversable or doubtful, and attaches the result to the frame as `GstTerrainSegMeta`. The frame is
 * drawn on only with #GstTerrainSeg:overlay.
 *
 * ## Example launch line
 * |[
 * gst-launch-1.0 terrainscenesrc num-buffers=60 ! terrainseg overlay=true ! videoconvert ! autovideosink
 * ]|
 *
 * Since: 0.1
 */
using GstTerrainSeg = Instance<GstBaseTransform, ElementState>;
using GstTerrainSegClass = GstBaseTransformClass;
G_DEFINE_TYPE(GstTerrainSeg, gst_terrain_seg, GST_TYPE_BASE_TRANSFORM)
GST_ELEMENT_REGISTER_DEFINE(terrainseg, "terrainseg", GST_RANK_NONE, gst_terrain_seg_get_type())

namespace {

Shared& shared_of(gpointer object) {
  return reinterpret_cast<GstTerrainSeg*>(object)->state->shared;
}
Streaming& streaming_of(gpointer object) {
  return reinterpret_cast<GstTerrainSeg*>(object)->state->streaming;
}

// ---- properties and signals ------------------------------------------------------------------------------

GstStructure* statistics_of(gpointer object) {
  Shared& shared = shared_of(object);
  const auto copy = std::make_unique<Statistics>(); // may fail, and not under the lock
  Lock lock(shared.mutex);
  *copy = shared.statistics;
  lock.unlock();
  return copy->structure();
}

/// Properties that are no settings of the filter; their ids follow.
const Property<Shared> table[] = {
    stats_row<Shared>("Number of frames, of skipped updates by cause, and the median and 99th percentile of "
                      "the time of each stage in microseconds",
                      statistics_of),
    {"instance", "Instance",
     "Name stored in the metadata, which tells several terrainseg elements in one chain apart; none = "
     "replaces other metadata without a name",
     property_playing, field<&Shared::instance>()},
    {"navigation", "Navigation",
     "Let the pointer in a video window downstream edit rectangles: the left button draws the training "
     "window, the right button ignored regions",
     property_playing, field<&Shared::navigation>()},
};
/// Nothing for a setting of the filter.
const Field<Shared>* field_of(guint id) {
  return id > SettingsBook::last_id() ? &table[id - SettingsBook::last_id() - 1].field : nullptr;
}

void set_property(GObject* object, guint id, const GValue* value, GParamSpec*) {
  guarded(object, [&] {
    Shared& shared = shared_of(object);
    if (const Field<Shared>* own = field_of(id))
      return own->set(shared, value);
    SettingsBook::Ids changed;
    Lock lock(shared.mutex);
    shared.book.set(id, value, changed);
    lock.unlock();
    SettingsBook::notify(object, changed);
  });
}

void get_property(GObject* object, guint id, GValue* value, GParamSpec*) {
  guarded(object, [&] {
    Shared& shared = shared_of(object);
    const Field<Shared>* own = field_of(id);
    if (own && own->make)
      return g_value_take_boxed(value, own->make(object));
    if (own)
      return own->get(shared, value);
    const Lock lock(shared.mutex);
    shared.book.get(id, value);
  });
}

void on_reset(GstTerrainSeg* self) {
  guarded(self, [&] { shared_of(self).learned.reset(); });
}

gboolean on_save_model(GstTerrainSeg* self, const gchar* path) {
  return guarded<gboolean>(self, FALSE, [&]() -> gboolean {
    if (!path)
      return FALSE;
    const auto terrain = shared_of(self).learned.learned();
    if (!terrain) {
      GST_ELEMENT_WARNING(self, RESOURCE, WRITE,
                          ("\"%s\" was not saved: there is no learned terrain yet.", path),
                          ("save-model(\"%s\"): no learned models", path));
      return FALSE;
    }
    const std::string error = save_terrain(path, *terrain);
    if (!error.empty())
      GST_ELEMENT_WARNING(self, RESOURCE, WRITE, ("The learned terrain was not saved: %s", error.c_str()),
                          ("save-model(\"%s\"): %s", path, error.c_str()));
    return error.empty();
  });
}

gboolean on_load_model(GstTerrainSeg* self, const gchar* path) {
  return guarded<gboolean>(self, FALSE, [&]() -> gboolean {
    if (!path)
      return FALSE;
    TerrainResult read = load_terrain(path);
    std::string error = read.error;
    if (read.terrain) {
      const Status status = shared_of(self).learned.load(std::move(*read.terrain), path);
      if (status.ok())
        return TRUE;
      error = status.message();
    }
    GST_ELEMENT_WARNING(
        self, RESOURCE, READ,
        ("The terrain file \"%s\" was not loaded, the current one is kept: %s", path, error.c_str()),
        ("load-model(\"%s\"): %s", path, error.c_str()));
    return FALSE;
  });
}

gboolean on_unset_property(GstTerrainSeg* self, const gchar* name) {
  return guarded<gboolean>(self, FALSE, [&]() -> gboolean {
    Shared& shared = shared_of(self);
    SettingsBook::Ids changed;
    Lock lock(shared.mutex);
    const bool known = shared.book.unset(name, changed);
    lock.unlock();
    SettingsBook::notify(self, changed);
    return known;
  });
}

// ---- start, stop, caps -----------------------------------------------------------------------------------

/// Reads the file of model-location, unless load-model gave another terrain since. False after an error was
/// posted.
bool read_model_location(gpointer object, const std::string& path) {
  LearnedTerrain& learned = shared_of(object).learned;
  if (path.empty() || learned.was_loaded())
    return true;
  TerrainResult read = load_terrain(path);
  if (!read.terrain) {
    GST_ELEMENT_ERROR(GST_ELEMENT(object), RESOURCE, READ,
                      ("The learned terrain \"%s\" of property model-location cannot be used: %s",
                       path.c_str(), read.error.c_str()),
                      ("property model-location, value \"%s\": %s", path.c_str(), read.error.c_str()));
    return false;
  }
  learned.offer(std::move(*read.terrain), path);
  return true;
}

/// Reads camera-info, mount and start-time. False after an error was posted.
bool start_metres(gpointer object, Streaming& s) {
  const ElementSettings& set = s.settings.values();
  auto flaw = s.metres.start(set.camera_info, set.mount);
  s.start_utc.reset();
  std::string error;
  if (!flaw && !set.start_time.empty() && !(s.start_utc = parse_start_time(set.start_time, error)))
    flaw = SettingsError{"start-time", set.start_time, error};
  if (flaw) {
    post_error(GST_ELEMENT(object), *flaw);
    return false;
  }
  if (set.camera_info.empty() != set.mount.empty())
    GST_ELEMENT_WARNING(GST_ELEMENT(object), LIBRARY, SETTINGS,
                        ("Ranges are disabled: set both camera-info and mount (%s is missing).",
                         set.mount.empty() ? "mount" : "camera-info"),
                        ("camera-info \"%s\", mount \"%s\"", set.camera_info.c_str(), set.mount.c_str()));
  return true;
}

gboolean start(GstBaseTransform* transform) {
  return guarded<gboolean>(transform, FALSE, [&]() -> gboolean {
    Shared& shared = shared_of(transform);
    Streaming& s = streaming_of(transform);
    if (!s.settings.start(GST_ELEMENT(transform), shared) ||
        !read_model_location(transform, s.settings.values().model_location) || !start_metres(transform, s))
      return FALSE;
    s.fresh = true;
    s.announcer = {};
    s.told = {};
    s.colours = {};
    s.summary = {};
    const bool is_new = shared.learned.start(s.settings.values().core);
    const Lock lock(shared.mutex);
    shared.pose_flaw.again();
    if (is_new)
      shared.statistics = {};
    return TRUE;
  });
}

ResetOn reset_on_of(Shared& shared) {
  const Lock lock(shared.mutex);
  return shared.book.settings().reset_on;
}

gboolean stop(GstBaseTransform* transform) {
  return guarded<gboolean>(transform, FALSE, [&]() -> gboolean {
    Streaming& s = streaming_of(transform);
    s.masks.drop();
    s.confidence_maps.drop();
    s.boundaries.drop();
    s.metre_writer.drop();
#ifdef TERRAINSEG_ANALYTICS
    s.analytics.drop();
#endif
    const ResetOn reset_on = reset_on_of(shared_of(transform));
    shared_of(transform).learned.stop(reset_on, s.stream_id);
    if (reset_on != ResetOn::never) {
      s.stream_id.clear();
      s.space.reset();
    }
    return TRUE;
  });
}

void forget(gpointer object, const char* why) {
  GST_INFO_OBJECT(object, "the learned terrain is forgotten: %s", why);
  shared_of(object).learned.forget();
}

/// Whether the loaded terrain was learned in the video's colour space. False after an error was posted.
bool check_terrain(GstBaseTransform* transform, Streaming& s, const ColorSpace& space, GstCaps* caps) {
  LearnedTerrain& learned = shared_of(transform).learned;
  const auto foreign = learned.foreign(space);
  if (!foreign)
    return true;
  if (!s.space) { // what the user asked for cannot be had; later it is the stream that changed
    if (s.told.misfit.first())
      GST_ELEMENT_ERROR(GST_ELEMENT(transform), STREAM, WRONG_TYPE,
                        ("%s Convert the video before terrainseg, or use another terrain.", foreign->c_str()),
                        ("caps %" GST_PTR_FORMAT, printable(caps)));
    return false;
  }
  GST_ELEMENT_WARNING(GST_ELEMENT(transform), STREAM, WRONG_TYPE,
                      ("%s The terrain is discarded and learning starts again.", foreign->c_str()),
                      ("caps %" GST_PTR_FORMAT, printable(caps)));
  learned.discard_loaded();
  return true;
}

gboolean set_caps(GstBaseTransform* transform, GstCaps* caps, GstCaps*) {
  return guarded<gboolean>(transform, FALSE, [&]() -> gboolean {
    Streaming& s = streaming_of(transform);
    GstVideoInfo info;
    if (!read_video_info(info, caps)) {
      GST_ELEMENT_ERROR(GST_ELEMENT(transform), STREAM, FORMAT, ("Unsupported video format."),
                        ("caps %" GST_PTR_FORMAT, printable(caps)));
      return FALSE;
    }
    if (!may_be_progressive(info)) {
      const std::string mode = gst_video_interlace_mode_to_string(GST_VIDEO_INFO_INTERLACE_MODE(&info));
      if (s.told.misfit.first()) // upstream tries other caps, again and again
        report_interlaced(transform, ("interlace-mode=" + mode).c_str());
      return FALSE;
    }
    const ColorSpace space =
        learning_space(s.settings.values().core, {GST_VIDEO_INFO_IS_RGB(&info) != 0, colorimetry_of(info)});
    if (!check_terrain(transform, s, space, caps))
      return FALSE;
    s.shape_flaw = s.metres.fit(GST_VIDEO_INFO_WIDTH(&info), GST_VIDEO_INFO_HEIGHT(&info));
    if (s.space && *s.space != space)
      forget(transform, "another colour space");
    GST_DEBUG_OBJECT(transform, "learns in %s, caps %" GST_PTR_FORMAT, name_of(space).c_str(),
                     printable(caps));
    s.space = space;
    s.info = info;
    shared_of(transform).frame_width = GST_VIDEO_INFO_WIDTH(&info);
    shared_of(transform).frame_height = GST_VIDEO_INFO_HEIGHT(&info);
    return TRUE;
  });
}

// ---- events ----------------------------------------------------------------------------------------------

bool take_custom_event(gpointer object, GstEvent* event) {
  return take_custom_event(GST_ELEMENT(object), shared_of(object), streaming_of(object).metres, event);
}

void take_stream_start(gpointer object, GstEvent* event) {
  Streaming& s = streaming_of(object);
  const gchar* id = nullptr;
  gst_event_parse_stream_start(event, &id);
  const std::string last = std::exchange(s.stream_id, id ? id : "");
  const ResetOn reset_on = reset_on_of(shared_of(object));
  if (last == s.stream_id)
    return;
  if (reset_on == ResetOn::per_stream)
    shared_of(object).learned.change_stream(last, s.stream_id);
  if (!last.empty() && reset_on != ResetOn::never)
    forget(object, "a new stream");
}

gboolean sink_event(GstBaseTransform* transform, GstEvent* event) {
  const bool taken = guarded(transform, false, [&] {
    switch (GST_EVENT_TYPE(event)) {
    case GST_EVENT_STREAM_START:
      take_stream_start(transform, event);
      break;
    case GST_EVENT_FLUSH_STOP: // after a seek neighbours in time are none in the picture
      shared_of(transform).learned.reset_temporal();
      streaming_of(transform).metres.flush();
      break;
    case GST_EVENT_CUSTOM_DOWNSTREAM:
    case GST_EVENT_CUSTOM_DOWNSTREAM_OOB:
    case GST_EVENT_CUSTOM_BOTH:
    case GST_EVENT_CUSTOM_BOTH_OOB:
      return take_custom_event(transform, event);
    default:
      break;
    }
    return false;
  });
  return GST_BASE_TRANSFORM_CLASS(gst_terrain_seg_parent_class)->sink_event(transform, event) || taken;
}

gboolean src_event(GstBaseTransform* transform, GstEvent* event) {
  if (GST_EVENT_TYPE(event) == GST_EVENT_NAVIGATION && shared_of(transform).navigation)
    guarded(transform, [&] { edit_regions(GST_ELEMENT(transform), shared_of(transform), event); });
  if (stops_qos(transform, event)) {
    GST_LOG_OBJECT(transform, "stopped, qos is off: %" GST_PTR_FORMAT, printable(event));
    gst_event_unref(event);
    return TRUE;
  }
  const bool taken = guarded(transform, false, [&] { return take_custom_event(transform, event); });
  return GST_BASE_TRANSFORM_CLASS(gst_terrain_seg_parent_class)->src_event(transform, event) || taken;
}

// ---- frames ----------------------------------------------------------------------------------------------

/// What one frame gave. The buffers go with the frame; the estimate's mask points into the first.
struct Outcome {
  OwnedBuffer mask, boundary;
  OwnedBuffer confidence_map; ///< none where the pipeline makes none
  Estimate estimate;
  const MetricEstimate* metric = nullptr; ///< in memory of the metric stage
  Counters counters;
  std::array<std::int64_t, stage_count> stage_times;
};

bool fail(GstBaseTransform* transform, const Status& status) {
  const char* const why = status.message().c_str();
  if (status.code() == Status::Code::window_outside_frame)
    GST_ELEMENT_ERROR(transform, LIBRARY, SETTINGS, ("%s", why), ("window outside the frame: %s", why));
  else if (status.code() == Status::Code::bad_frame)
    GST_ELEMENT_ERROR(transform, STREAM, FORMAT, ("%s", why), ("bad frame: %s", why));
  else
    GST_ELEMENT_ERROR(transform, LIBRARY, FAILED, ("%s", why),
                      ("status %d: %s", static_cast<int>(status.code()), why));
  return false;
}

/// Reads the pixels of the frame that metadata names; invalid ones are reported once a stream.
template <typename Reader>
auto read_pixels(gpointer object, const GstVideoInfo& info, GstBuffer* buffer, Reader& reader, Once<>& flaw,
                 const char* what) {
  const auto pixels = reader.read(buffer, GST_VIDEO_INFO_WIDTH(&info), GST_VIDEO_INFO_HEIGHT(&info));
  if (reader.error() && flaw.first())
    GST_ELEMENT_WARNING(GST_ELEMENT(object), STREAM, FAILED,
                        ("Invalid %s, ignored: %s.", what, reader.error()), ("%s", reader.error()));
  return pixels;
}

/// Adds the frame to `stats`, and to the log: GST_DEBUG=terrainseg:5 has a line a second, :6 one a frame.
void note_times(gpointer object, const Outcome& outcome, bool supplied,
                std::chrono::steady_clock::time_point began) {
  const auto nanoseconds = [](auto duration) {
    return std::chrono::duration_cast<std::chrono::nanoseconds>(duration).count();
  };
  const auto ended = std::chrono::steady_clock::now();
  const std::int64_t took = nanoseconds(ended - began);
  const Estimate& e = outcome.estimate;
  {
    Shared& shared = shared_of(object);
    const Lock lock(shared.mutex);
    shared.statistics.add(outcome.stage_times, took, outcome.counters, e.model_generation);
  }
  if (G_LIKELY(gst_debug_category_get_threshold(GST_CAT_DEFAULT) < GST_LEVEL_DEBUG))
    return;
  const std::int64_t now = nanoseconds(ended.time_since_epoch());
  if (const auto line = streaming_of(object).summary.add(e, outcome.counters, supplied, now, took))
    GST_DEBUG_OBJECT(object, "%s", line->c_str());
  GST_LOG_OBJECT(object,
                 "frame %" G_GUINT64_FORMAT
                 ": flags %#x, generation %u, horizon %d, traversable %d permille, %" G_GINT64_FORMAT " us",
                 e.frame, e.flags, e.model_generation, e.horizon_row, e.traversable_permille, took / 1000);
}

/// Runs the segmenter into the buffers of `outcome`.
Status run(GstBaseTransform* transform, GstBuffer* buffer, const Frame& frame, const Supervision& supervision,
           const Veto& veto, const MaskTarget& target, guint8* boundary, Outcome& outcome) {
  Streaming& s = streaming_of(transform);
  const LearnedTerrain::Turn turn(shared_of(transform).learned);
  Segmenter& segmenter = turn.segmenter();
  s.settings.configure(segmenter, is_learnable(transform->segment, buffer));
  Status status = segmenter.process(frame, supervision, target, veto);
  if (!status.ok())
    return status;
  outcome.estimate = segmenter.estimate();
  outcome.confidence_map = s.confidence_maps.copy_of(outcome.estimate.confidence_map);
  outcome.estimate.confidence_map = {}; // the segmenter's memory
  outcome.counters = segmenter.counters();
  outcome.stage_times = segmenter.stage_times();
  write_values(outcome.estimate.boundary, boundary); // a row for every column of the mask
  outcome.estimate.boundary = {reinterpret_cast<const std::uint16_t*>(boundary),
                               static_cast<std::size_t>(target.width)};
  return status;
}

/// Labels the frame into new buffers and draws when asked to. False after an error was posted.
bool label(GstBaseTransform* transform, GstBuffer* buffer, const MappedFrame& mapped, Outcome& outcome) {
  const auto began = std::chrono::steady_clock::now();
  Streaming& s = streaming_of(transform);
  const ElementSettings& set = s.settings.values();
  const GstClockTime running_time = running_time_of(transform->segment, GST_BUFFER_PTS(buffer));
  Frame frame = mapped.view();
  frame.vanishing_row = s.metres.vanishing_row(running_time);
  const int width = mask_extent(frame.width, set.core.mask_level);
  const int height = mask_extent(frame.height, set.core.mask_level);
  outcome.mask = s.masks.acquire(width, height);
  outcome.boundary = s.boundaries.acquire(static_cast<gsize>(width) * 2);
  const MappedBuffer mask(outcome.mask.get(), GST_MAP_WRITE);
  const MappedBuffer boundary(outcome.boundary.get(), GST_MAP_WRITE);
  if (!mask.data() || !boundary.data()) {
    GST_ELEMENT_ERROR(GST_ELEMENT(transform), RESOURCE, NO_SPACE_LEFT, ("Out of memory for the mask."),
                      ("a mask of %d x %d cannot be allocated", width, height));
    return false;
  }
  const Supervision supervision =
      read_pixels(transform, s.info, buffer, s.training, s.told.training_flaw, "training pixels");
  s.veto.choose(set.veto_roi_types);
  const Veto veto = read_pixels(transform, s.info, buffer, s.veto, s.told.veto_flaw, "veto");
  const Status status = run(transform, buffer, frame, supervision, veto,
                            {{mask.data(), width}, width, height}, boundary.data(), outcome);
  s.training.release();
  s.veto.release();
  if (!status.ok())
    return fail(transform, status);
  outcome.metric = s.metres.measure(outcome.estimate, running_time, set.range_max);
  if (set.overlay)
    s.drawing.draw(mapped.mutable_view(), outcome.estimate, outcome.metric, set.drawing.paint());
#ifdef TERRAINSEG_ANALYTICS
  if (set.analytics && !s.analytics.attach(buffer, outcome.estimate))
    GST_WARNING_OBJECT(transform, "the GstAnalytics metadata could not be attached");
#endif
  note_times(transform, outcome, !supervision.empty(), began);
  return true;
}

void post_message(GstBaseTransform* transform, Streaming& s, GstBuffer* buffer, const Estimate& estimate) {
  if ((estimate.flags & flag_window_still) && s.told.still_window.first())
    GST_ELEMENT_WARNING(GST_ELEMENT(transform), STREAM, FAILED,
                        ("The training window does not change, but the picture above it does: it shows the "
                         "vehicle or a still picture. Move it onto the ground (window-bottom, window-rect)."),
                        ("window %dx%d at %d,%d", estimate.window.width, estimate.window.height,
                         estimate.window.x, estimate.window.y));
  if (!s.settings.values().post_messages) {
    s.announcer = {};
    return;
  }
  if (const auto news = s.announcer.consider(estimate, GST_BUFFER_PTS(buffer)))
    gst_element_post_message(
        GST_ELEMENT(transform),
        gst_message_new_element(GST_OBJECT(transform), structure_of(*news, transform->segment, buffer)));
}

/// Attaches the boundary in metres where there are any, and the wall clock where start-time gives it.
void attach_metres(GstBaseTransform* transform, Streaming& s, GstBuffer* buffer,
                   const MetricEstimate* metric) {
  const char* name = shared_of(transform).instance.c_str();
  if (s.start_utc)
    stamp_utc(buffer, *s.start_utc);
  if (!metric) // those of a filter before this one belonged to the estimate that was replaced
    remove_metas(buffer, GST_TERRAIN_METRIC_META_NAME, name);
  else if (!s.metre_writer.attach(buffer, *metric, name))
    GST_WARNING_OBJECT(transform, "the metres could not be attached");
  if (const auto notice = s.metres.take_notice())
    GST_ELEMENT_WARNING(GST_ELEMENT(transform), STREAM, FAILED, ("%s", notice->c_str()),
                        ("%s", notice->c_str()));
}

/// Says with the first frame of a shape that the calibration is of another one, and not with its caps: in
/// front of a video that its camera marked as turned they come twice, lying and upright. False after an error
/// was posted.
bool check_shape(GstBaseTransform* transform, Streaming& s) {
  if (s.shape_flaw.empty())
    return true;
  if (s.fresh) { // what the user asked for cannot be had; later it is the stream that changed
    if (s.told.misfit.first())
      GST_ELEMENT_ERROR(GST_ELEMENT(transform), STREAM, WRONG_TYPE,
                        ("The calibration \"%s\" of property camera-info does not fit: %s.",
                         s.settings.values().camera_info.c_str(), s.shape_flaw.c_str()),
                        (nullptr));
    return false;
  }
  GST_ELEMENT_WARNING(GST_ELEMENT(transform), STREAM, WRONG_TYPE,
                      ("Ranges are disabled for this stream: %s.", s.shape_flaw.c_str()), (nullptr));
  s.shape_flaw.clear();
  return true;
}

/// Overrides GstBaseTransform and not GstVideoFilter, which maps for writing and so copies every frame that
/// is shared, as after a tee.
GstFlowReturn transform_ip(GstBaseTransform* transform, GstBuffer* buffer) {
  GST_TRACE_OBJECT(transform, "in: %" GST_PTR_FORMAT, printable(buffer));
  return guarded(transform, GST_FLOW_ERROR, [&] {
    Streaming& s = streaming_of(transform);
    if (!check_shape(transform, s))
      return GST_FLOW_ERROR;
    s.settings.update(GST_ELEMENT(transform), shared_of(transform), s.info);
    const ElementSettings& set = s.settings.values();
    if (set.reset_on == ResetOn::discont && !s.fresh && GST_BUFFER_IS_DISCONT(buffer))
      forget(transform, "a discontinuity");
    if (set.reset_on == ResetOn::per_stream && shared_of(transform).learned.recall(s.space))
      GST_INFO_OBJECT(transform, "stream \"%s\" is back, and what was learned in it", s.stream_id.c_str());
    s.fresh = false;
    if (!is_progressive(s.info, buffer)) {
      report_interlaced(transform, "interlace-mode=mixed, and this buffer holds two fields");
      return GST_FLOW_ERROR;
    }
    Outcome outcome;
    {
      const MappedFrame frame(s.info, buffer, set.overlay ? GST_MAP_READWRITE : GST_MAP_READ);
      if (!frame) {
        report_unusable(transform, buffer, frame);
        return GST_FLOW_ERROR;
      }
      if (s.colours.see(frame.frame()))
        TERRAINSEG_POST_WARNING(transform, STREAM, FORMAT, colourless_warning(s.info));
      if (!label(transform, buffer, frame, outcome))
        return GST_FLOW_ERROR;
    }
    if (!attach(buffer, outcome.estimate, outcome.mask.get(), outcome.boundary.get(),
                shared_of(transform).instance.c_str(), outcome.confidence_map.get()))
      GST_WARNING_OBJECT(transform, "the metadata could not be attached");
    attach_metres(transform, s, buffer, outcome.metric);
    post_message(transform, s, buffer, outcome.estimate);
    return GST_FLOW_OK;
  });
}

} // namespace

static void gst_terrain_seg_init(GstTerrainSeg* self) {
  self->state.make();
  auto* transform = GST_BASE_TRANSFORM(self);
  gst_base_transform_set_in_place(transform, TRUE);
  gst_base_transform_set_passthrough(transform, FALSE); // in passthrough no metadata may be attached
  gst_base_transform_set_gap_aware(transform, TRUE);
  gst_base_transform_set_qos_enabled(transform, FALSE); // frames that are dropped are not learned
}

static void gst_terrain_seg_class_init(GstTerrainSegClass* klass) {
  GST_DEBUG_CATEGORY_INIT(terrainseg_debug, "terrainseg", 0,
                          "Traversable ground from a self-supervised colour model");
  init_class<GstTerrainSeg, gst_terrain_seg_parent_class>(
      klass, {"Traversable terrain", "Filter/Analyzer/Video",
              "Learns the appearance of the ground in front of a rover and labels what is traversable"});
  auto* object_class = G_OBJECT_CLASS(klass);
  object_class->set_property = set_property;
  object_class->get_property = get_property;
  SettingsBook::install(object_class);
  install_table(object_class, SettingsBook::last_id() + 1, table);

  const auto add_action = [&](const char* name, GCallback handler, GType result, auto... arguments) {
    g_signal_new_class_handler(name, G_TYPE_FROM_CLASS(klass),
                               static_cast<GSignalFlags>(G_SIGNAL_RUN_LAST | G_SIGNAL_ACTION), handler,
                               nullptr, nullptr, nullptr, result, sizeof...(arguments), arguments...);
  };
  add_action("reset", G_CALLBACK(on_reset), G_TYPE_NONE);
  add_action("save-model", G_CALLBACK(on_save_model), G_TYPE_BOOLEAN, G_TYPE_STRING);
  add_action("load-model", G_CALLBACK(on_load_model), G_TYPE_BOOLEAN, G_TYPE_STRING);
  add_action("unset-property", G_CALLBACK(on_unset_property), G_TYPE_BOOLEAN, G_TYPE_STRING);

  add_video_pad_templates(GST_ELEMENT_CLASS(klass));
  auto* transform_class = GST_BASE_TRANSFORM_CLASS(klass);
  transform_class->start = start;
  transform_class->stop = stop;
  transform_class->set_caps = set_caps;
  transform_class->propose_allocation = propose_video_allocation<gst_terrain_seg_parent_class>;
  transform_class->sink_event = sink_event;
  transform_class->src_event = src_event;
  transform_class->before_transform = sync_controlled;
  transform_class->transform_ip = transform_ip;
}
