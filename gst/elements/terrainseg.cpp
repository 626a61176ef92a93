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
#include "elements/terrainseg/statistics.hpp"
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

using namespace terrainseg;

namespace {

/// Everything behind the instance: what any thread may touch, and what the streaming thread alone touches, or
/// others while there is none.
struct SegState {
  GstBaseTransform* element = nullptr;
  Shared shared; ///< any thread

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
using GstTerrainSeg = Instance<GstBaseTransform, SegState>;
using GstTerrainSegClass = GstBaseTransformClass;
G_DEFINE_TYPE(GstTerrainSeg, gst_terrain_seg, GST_TYPE_BASE_TRANSFORM)

// ---- properties and signals ------------------------------------------------------------------------------

GstStructure* statistics_of(gpointer object) {
  Shared& shared = GstTerrainSeg::state_of(object).shared;
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

void set_property(SegState& s, guint id, const GValue* value, GParamSpec*) {
  if (const Field<Shared>* own = field_of(id))
    return own->set(s.shared, value);
  Lock lock(s.shared.mutex);
  const SettingsBook::Ids changed = s.shared.book.set(id, value);
  lock.unlock();
  SettingsBook::notify(s.element, changed);
}

void get_property(SegState& s, guint id, GValue* value, GParamSpec*) {
  const Field<Shared>* own = field_of(id);
  if (own && own->make)
    return g_value_take_boxed(value, own->make(s.element));
  if (own)
    return own->get(s.shared, value);
  const Lock lock(s.shared.mutex);
  s.shared.book.get(id, value);
}

void on_reset(SegState& s) {
  s.shared.learned.reset();
}

bool on_save_model(SegState& s, const gchar* path) {
  if (!path)
    return false;
  const auto terrain = s.shared.learned.learned();
  if (!terrain) {
    GST_ELEMENT_WARNING(s.element, RESOURCE, WRITE,
                        ("\"%s\" was not saved: there is no learned terrain yet.", path),
                        ("save-model(\"%s\"): no learned models", path));
    return false;
  }
  const std::string error = save_terrain(path, *terrain);
  if (!error.empty())
    GST_ELEMENT_WARNING(s.element, RESOURCE, WRITE, ("The learned terrain was not saved: %s", error.c_str()),
                        ("save-model(\"%s\"): %s", path, error.c_str()));
  return error.empty();
}

bool on_load_model(SegState& s, const gchar* path) {
  if (!path)
    return false;
  TerrainResult read = load_terrain(path);
  std::string error = read.error;
  if (read.terrain) {
    const Status status = s.shared.learned.load(std::move(*read.terrain), path);
    if (status.ok())
      return true;
    error = status.message();
  }
  GST_ELEMENT_WARNING(
      s.element, RESOURCE, READ,
      ("The terrain file \"%s\" was not loaded, the current one is kept: %s", path, error.c_str()),
      ("load-model(\"%s\"): %s", path, error.c_str()));
  return false;
}

bool on_unset_property(SegState& s, const gchar* name) {
  SettingsBook::Ids changed;
  Lock lock(s.shared.mutex);
  const bool known = s.shared.book.unset(name, changed);
  lock.unlock();
  SettingsBook::notify(s.element, changed);
  return known;
}

// ---- start, stop, caps -----------------------------------------------------------------------------------

/// Reads the file of model-location, unless load-model gave another terrain since. False after an error was
/// posted.
bool read_model_location(SegState& s) {
  const std::string& path = s.settings.values().model_location;
  LearnedTerrain& learned = s.shared.learned;
  if (path.empty() || learned.was_loaded())
    return true;
  TerrainResult read = load_terrain(path);
  if (!read.terrain) {
    GST_ELEMENT_ERROR(s.element, RESOURCE, READ,
                      ("The learned terrain \"%s\" of property model-location cannot be used: %s",
                       path.c_str(), read.error.c_str()),
                      ("property model-location, value \"%s\": %s", path.c_str(), read.error.c_str()));
    return false;
  }
  learned.offer(std::move(*read.terrain), path);
  return true;
}

/// Reads camera-info, mount and start-time. False after an error was posted.
bool start_metres(SegState& s) {
  const ElementSettings& set = s.settings.values();
  auto flaw = s.metres.start(set.camera_info, set.mount);
  s.start_utc.reset();
  std::string error;
  if (!flaw && !set.start_time.empty() && !(s.start_utc = parse_start_time(set.start_time, error)))
    flaw = SettingsError{"start-time", set.start_time, error};
  if (flaw) {
    post_error(s.element, *flaw);
    return false;
  }
  if (set.camera_info.empty() != set.mount.empty())
    GST_ELEMENT_WARNING(s.element, LIBRARY, SETTINGS,
                        ("Ranges are disabled: set both camera-info and mount (%s is missing).",
                         set.mount.empty() ? "mount" : "camera-info"),
                        ("camera-info \"%s\", mount \"%s\"", set.camera_info.c_str(), set.mount.c_str()));
  return true;
}

bool start(SegState& s) {
  if (!s.settings.start(GST_ELEMENT(s.element), s.shared) || !read_model_location(s) || !start_metres(s))
    return false;
  s.fresh = true;
  s.announcer = {};
  s.told = {};
  s.colours = {};
  s.summary = {};
  const bool is_new = s.shared.learned.start(s.settings.values().core);
  const Lock lock(s.shared.mutex);
  s.shared.pose_flaw.again();
  if (is_new)
    s.shared.statistics = {};
  return true;
}

ResetOn reset_on_of(Shared& shared) {
  const Lock lock(shared.mutex);
  return shared.book.settings().reset_on;
}

bool stop(SegState& s) {
  s.masks.drop();
  s.confidence_maps.drop();
  s.boundaries.drop();
  s.metre_writer.drop();
#ifdef TERRAINSEG_ANALYTICS
  s.analytics.drop();
#endif
  const ResetOn reset_on = reset_on_of(s.shared);
  s.shared.learned.stop(reset_on, s.stream_id);
  if (reset_on != ResetOn::never) {
    s.stream_id.clear();
    s.space.reset();
  }
  return true;
}

void forget(SegState& s, const char* why) {
  GST_INFO_OBJECT(s.element, "the learned terrain is forgotten: %s", why);
  s.shared.learned.forget();
}

/// Whether the loaded terrain was learned in the video's colour space. False after an error was posted.
bool check_terrain(SegState& s, const ColorSpace& space, GstCaps* caps) {
  LearnedTerrain& learned = s.shared.learned;
  const auto foreign = learned.foreign(space);
  if (!foreign)
    return true;
  if (!s.space) { // what the user asked for cannot be had; later it is the stream that changed
    if (s.told.misfit.first())
      GST_ELEMENT_ERROR(s.element, STREAM, WRONG_TYPE,
                        ("%s Convert the video before terrainseg, or use another terrain.", foreign->c_str()),
                        ("caps %" GST_PTR_FORMAT, printable(caps)));
    return false;
  }
  GST_ELEMENT_WARNING(s.element, STREAM, WRONG_TYPE,
                      ("%s The terrain is discarded and learning starts again.", foreign->c_str()),
                      ("caps %" GST_PTR_FORMAT, printable(caps)));
  learned.discard_loaded();
  return true;
}

bool set_caps(SegState& s, GstCaps* caps, GstCaps*) {
  GstVideoInfo info;
  if (!read_video_info(info, caps)) {
    GST_ELEMENT_ERROR(s.element, STREAM, FORMAT, ("Unsupported video format."),
                      ("caps %" GST_PTR_FORMAT, printable(caps)));
    return false;
  }
  if (!may_be_progressive(info)) {
    const std::string mode = gst_video_interlace_mode_to_string(GST_VIDEO_INFO_INTERLACE_MODE(&info));
    if (s.told.misfit.first()) // upstream tries other caps, again and again
      report_interlaced(s.element, ("interlace-mode=" + mode).c_str());
    return false;
  }
  const ColorSpace space =
      learning_space(s.settings.values().core, {GST_VIDEO_INFO_IS_RGB(&info) != 0, colorimetry_of(info)});
  if (!check_terrain(s, space, caps))
    return false;
  s.shape_flaw = s.metres.fit(GST_VIDEO_INFO_WIDTH(&info), GST_VIDEO_INFO_HEIGHT(&info));
  if (s.space && *s.space != space)
    forget(s, "another colour space");
  GST_DEBUG_OBJECT(s.element, "learns in %s, caps %" GST_PTR_FORMAT, name_of(space).c_str(), printable(caps));
  s.space = space;
  s.info = info;
  s.shared.frame_width = GST_VIDEO_INFO_WIDTH(&info);
  s.shared.frame_height = GST_VIDEO_INFO_HEIGHT(&info);
  return true;
}

// ---- events ----------------------------------------------------------------------------------------------

void take_stream_start(SegState& s, GstEvent* event) {
  const gchar* id = nullptr;
  gst_event_parse_stream_start(event, &id);
  const std::string last = std::exchange(s.stream_id, id ? id : "");
  const ResetOn reset_on = reset_on_of(s.shared);
  if (last == s.stream_id)
    return;
  if (reset_on == ResetOn::per_stream)
    s.shared.learned.change_stream(last, s.stream_id);
  if (!last.empty() && reset_on != ResetOn::never)
    forget(s, "a new stream");
}

gboolean sink_event(SegState& s, GstEvent* event) {
  const bool taken = guarded(s.element, false, [&] {
    switch (GST_EVENT_TYPE(event)) {
    case GST_EVENT_STREAM_START:
      take_stream_start(s, event);
      break;
    case GST_EVENT_FLUSH_STOP: // after a seek neighbours in time are none in the picture
      s.shared.learned.reset_temporal();
      s.metres.flush();
      break;
    case GST_EVENT_CUSTOM_DOWNSTREAM:
    case GST_EVENT_CUSTOM_DOWNSTREAM_OOB:
    case GST_EVENT_CUSTOM_BOTH:
    case GST_EVENT_CUSTOM_BOTH_OOB:
      return take_custom_event(GST_ELEMENT(s.element), s.shared, s.metres, event);
    default:
      break;
    }
    return false;
  });
  return GST_BASE_TRANSFORM_CLASS(gst_terrain_seg_parent_class)->sink_event(s.element, event) || taken;
}

gboolean src_event(SegState& s, GstEvent* event) {
  if (GST_EVENT_TYPE(event) == GST_EVENT_NAVIGATION && s.shared.navigation)
    guarded(s.element, [&] { edit_regions(GST_ELEMENT(s.element), s.shared, event); });
  if (stops_qos(s.element, event)) {
    GST_LOG_OBJECT(s.element, "stopped, qos is off: %" GST_PTR_FORMAT, printable(event));
    gst_event_unref(event);
    return TRUE;
  }
  const bool taken = guarded(
      s.element, false, [&] { return take_custom_event(GST_ELEMENT(s.element), s.shared, s.metres, event); });
  return GST_BASE_TRANSFORM_CLASS(gst_terrain_seg_parent_class)->src_event(s.element, event) || taken;
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

bool fail(SegState& s, const Status& status) {
  const char* const why = status.message().c_str();
  if (status.code() == Status::Code::window_outside_frame)
    GST_ELEMENT_ERROR(s.element, LIBRARY, SETTINGS, ("%s", why), ("window outside the frame: %s", why));
  else if (status.code() == Status::Code::bad_frame)
    GST_ELEMENT_ERROR(s.element, STREAM, FORMAT, ("%s", why), ("bad frame: %s", why));
  else
    GST_ELEMENT_ERROR(s.element, LIBRARY, FAILED, ("%s", why),
                      ("status %d: %s", static_cast<int>(status.code()), why));
  return false;
}

/// Reads the pixels of the frame that metadata names; invalid ones are reported once a stream.
template <typename Reader>
auto read_pixels(SegState& s, GstBuffer* buffer, Reader& reader, Once<>& flaw, const char* what) {
  const auto pixels = reader.read(buffer, GST_VIDEO_INFO_WIDTH(&s.info), GST_VIDEO_INFO_HEIGHT(&s.info));
  if (reader.error() && flaw.first())
    GST_ELEMENT_WARNING(s.element, STREAM, FAILED, ("Invalid %s, ignored: %s.", what, reader.error()),
                        ("%s", reader.error()));
  return pixels;
}

/// Adds the frame to `stats`, and to the log: GST_DEBUG=terrainseg:5 has a line a second, :6 one a frame.
void note_times(SegState& s, const Outcome& outcome, bool supplied,
                std::chrono::steady_clock::time_point began) {
  const auto nanoseconds = [](auto duration) {
    return std::chrono::duration_cast<std::chrono::nanoseconds>(duration).count();
  };
  const auto ended = std::chrono::steady_clock::now();
  const std::int64_t took = nanoseconds(ended - began);
  const Estimate& e = outcome.estimate;
  {
    const Lock lock(s.shared.mutex);
    s.shared.statistics.add(outcome.stage_times, took, outcome.counters, e.model_generation);
  }
  if (G_LIKELY(gst_debug_category_get_threshold(GST_CAT_DEFAULT) < GST_LEVEL_DEBUG))
    return;
  const std::int64_t now = nanoseconds(ended.time_since_epoch());
  if (const auto line = s.summary.add(e, outcome.counters, supplied, now, took))
    GST_DEBUG_OBJECT(s.element, "%s", line->c_str());
  GST_LOG_OBJECT(s.element,
                 "frame %" G_GUINT64_FORMAT
                 ": flags %#x, generation %u, horizon %d, traversable %d permille, %" G_GINT64_FORMAT " us",
                 e.frame, e.flags, e.model_generation, e.horizon_row, e.traversable_permille, took / 1000);
}

/// Copies what the segmenter holds of the frame.
void keep(SegState& s, const Segmenter& segmenter, guint8* boundary, Outcome& outcome) {
  Estimate& e = outcome.estimate;
  e = segmenter.estimate();
  outcome.confidence_map = s.confidence_maps.copy_of(e.confidence_map);
  e.confidence_map = {}; // the segmenter's memory
  outcome.counters = segmenter.counters();
  outcome.stage_times = segmenter.stage_times();
  write_values(e.boundary, boundary); // a row for every column of the mask
  e.boundary = {reinterpret_cast<const std::uint16_t*>(boundary), e.boundary.size()};
}

/// Labels the frame into new buffers and draws when asked to. False after an error was posted.
bool label(SegState& s, GstBuffer* buffer, const MappedFrame& mapped, Outcome& outcome) {
  const auto began = std::chrono::steady_clock::now();
  const ElementSettings& set = s.settings.values();
  const GstClockTime running_time = running_time_of(s.element->segment, GST_BUFFER_PTS(buffer));
  Frame frame = mapped.view();
  frame.vanishing_row = s.metres.vanishing_row(running_time);
  const int width = mask_extent(frame.width, set.core.mask_level);
  const int height = mask_extent(frame.height, set.core.mask_level);
  outcome.mask = s.masks.acquire(width, height);
  outcome.boundary = s.boundaries.acquire(static_cast<gsize>(width) * 2);
  const MappedBuffer mask(outcome.mask.get(), GST_MAP_WRITE);
  const MappedBuffer boundary(outcome.boundary.get(), GST_MAP_WRITE);
  if (!mask.data() || !boundary.data()) {
    GST_ELEMENT_ERROR(s.element, RESOURCE, NO_SPACE_LEFT, ("Out of memory for the mask."),
                      ("a mask of %d x %d cannot be allocated", width, height));
    return false;
  }
  const Supervision supervision = read_pixels(s, buffer, s.training, s.told.training_flaw, "training pixels");
  s.veto.choose(set.veto_roi_types);
  const Veto veto = read_pixels(s, buffer, s.veto, s.told.veto_flaw, "veto");
  const Status status = s.shared.learned.use([&](Segmenter& segmenter) {
    s.settings.configure(segmenter, is_learnable(s.element->segment, buffer));
    Status processed = segmenter.process(frame, supervision, {{mask.data(), width}, width, height}, veto);
    if (processed.ok())
      keep(s, segmenter, boundary.data(), outcome);
    return processed;
  });
  s.training.release();
  s.veto.release();
  if (!status.ok())
    return fail(s, status);
  outcome.metric = s.metres.measure(outcome.estimate, running_time, set.range_max);
  if (set.overlay)
    s.drawing.draw(mapped.mutable_view(), outcome.estimate, outcome.metric, set.drawing.paint());
#ifdef TERRAINSEG_ANALYTICS
  if (set.analytics && !s.analytics.attach(buffer, outcome.estimate))
    GST_WARNING_OBJECT(s.element, "the GstAnalytics metadata could not be attached");
#endif
  note_times(s, outcome, !supervision.empty(), began);
  return true;
}

void post_message(SegState& s, GstBuffer* buffer, const Estimate& estimate) {
  if ((estimate.flags & flag_window_still) && s.told.still_window.first())
    GST_ELEMENT_WARNING(s.element, STREAM, FAILED,
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
        GST_ELEMENT(s.element),
        gst_message_new_element(GST_OBJECT(s.element), structure_of(*news, s.element->segment, buffer)));
}

/// Attaches the boundary in metres where there are any, and the wall clock where start-time gives it.
void attach_metres(SegState& s, GstBuffer* buffer, const MetricEstimate* metric) {
  const char* name = s.shared.instance.c_str();
  if (s.start_utc)
    stamp_utc(buffer, *s.start_utc);
  if (!metric) // those of a filter before this one belonged to the estimate that was replaced
    remove_metas(buffer, GST_TERRAIN_METRIC_META_NAME, name);
  else if (!s.metre_writer.attach(buffer, *metric, name))
    GST_WARNING_OBJECT(s.element, "the metres could not be attached");
  if (const auto notice = s.metres.take_notice())
    GST_ELEMENT_WARNING(s.element, STREAM, FAILED, ("%s", notice->c_str()), ("%s", notice->c_str()));
}

/// Says with the first frame of a shape that the calibration is of another one, and not with its caps: in
/// front of a video that its camera marked as turned they come twice, lying and upright. False after an error
/// was posted.
bool check_shape(SegState& s) {
  if (s.shape_flaw.empty())
    return true;
  if (s.fresh) { // what the user asked for cannot be had; later it is the stream that changed
    if (s.told.misfit.first())
      GST_ELEMENT_ERROR(s.element, STREAM, WRONG_TYPE,
                        ("The calibration \"%s\" of property camera-info does not fit: %s.",
                         s.settings.values().camera_info.c_str(), s.shape_flaw.c_str()),
                        (nullptr));
    return false;
  }
  GST_ELEMENT_WARNING(s.element, STREAM, WRONG_TYPE,
                      ("Ranges are disabled for this stream: %s.", s.shape_flaw.c_str()), (nullptr));
  s.shape_flaw.clear();
  return true;
}

/// Overrides GstBaseTransform and not GstVideoFilter, which maps for writing and so copies every frame that
/// is shared, as after a tee.
GstFlowReturn transform_ip(SegState& s, GstBuffer* buffer) {
  GST_TRACE_OBJECT(s.element, "in: %" GST_PTR_FORMAT, printable(buffer));
  if (!check_shape(s))
    return GST_FLOW_ERROR;
  s.settings.update(GST_ELEMENT(s.element), s.shared, s.info);
  const ElementSettings& set = s.settings.values();
  if (set.reset_on == ResetOn::discont && !s.fresh && GST_BUFFER_IS_DISCONT(buffer))
    forget(s, "a discontinuity");
  if (set.reset_on == ResetOn::per_stream && s.shared.learned.recall(s.space))
    GST_INFO_OBJECT(s.element, "stream \"%s\" is back, and what was learned in it", s.stream_id.c_str());
  s.fresh = false;
  if (!is_progressive(s.info, buffer))
    return report_interlaced(s.element, "interlace-mode=mixed, and this buffer holds two fields");
  Outcome outcome;
  {
    const MappedFrame frame(s.info, buffer, set.overlay ? GST_MAP_READWRITE : GST_MAP_READ);
    if (!frame)
      return report_unusable(s.element, buffer, frame);
    if (s.colours.see(frame.frame()))
      TERRAINSEG_POST_WARNING(s.element, STREAM, FORMAT, colourless_warning(s.info));
    if (!label(s, buffer, frame, outcome))
      return GST_FLOW_ERROR;
  }
  if (!attach(buffer, outcome.estimate, outcome.mask.get(), outcome.boundary.get(), s.shared.instance.c_str(),
              outcome.confidence_map.get()))
    GST_WARNING_OBJECT(s.element, "the metadata could not be attached");
  attach_metres(s, buffer, outcome.metric);
  post_message(s, buffer, outcome.estimate);
  return GST_FLOW_OK;
}

void gst_terrain_seg_init(GstTerrainSeg* self) {
  GstBaseTransform* transform = self->make_state().element;
  gst_base_transform_set_in_place(transform, TRUE);
  gst_base_transform_set_passthrough(transform, FALSE); // in passthrough no metadata may be attached
  gst_base_transform_set_gap_aware(transform, TRUE);
  gst_base_transform_set_qos_enabled(transform, FALSE); // frames that are dropped are not learned
}

void gst_terrain_seg_class_init(GstTerrainSegClass* klass) {
  GST_DEBUG_CATEGORY_INIT(terrainseg_debug, "terrainseg", 0,
                          "Traversable ground from a self-supervised colour model");
  init_class<GstTerrainSeg, gst_terrain_seg_parent_class>(
      klass, {"Traversable terrain", "Filter/Analyzer/Video",
              "Learns the appearance of the ground in front of a rover and labels what is traversable"});
  auto* object_class = G_OBJECT_CLASS(klass);
  object_class->set_property = GstTerrainSeg::call<set_property>;
  object_class->get_property = GstTerrainSeg::call<get_property>;
  SettingsBook::install(object_class);
  install_table(object_class, SettingsBook::last_id() + 1, table);

  const auto add_action = [&](const char* name, GCallback handler, GType result, auto... arguments) {
    g_signal_new_class_handler(name, G_TYPE_FROM_CLASS(klass),
                               static_cast<GSignalFlags>(G_SIGNAL_RUN_LAST | G_SIGNAL_ACTION), handler,
                               nullptr, nullptr, nullptr, result, sizeof...(arguments), arguments...);
  };
  using Forget = void (*)(GObject*);
  using Named = gboolean (*)(GObject*, const gchar*);
  const Forget reset = GstTerrainSeg::call<on_reset>;
  const Named save = GstTerrainSeg::call<on_save_model>, load = GstTerrainSeg::call<on_load_model>,
              unset = GstTerrainSeg::call<on_unset_property>;
  add_action("reset", G_CALLBACK(reset), G_TYPE_NONE);
  add_action("save-model", G_CALLBACK(save), G_TYPE_BOOLEAN, G_TYPE_STRING);
  add_action("load-model", G_CALLBACK(load), G_TYPE_BOOLEAN, G_TYPE_STRING);
  add_action("unset-property", G_CALLBACK(unset), G_TYPE_BOOLEAN, G_TYPE_STRING);

  add_video_pad_templates(GST_ELEMENT_CLASS(klass));
  auto* transform_class = GST_BASE_TRANSFORM_CLASS(klass);
  transform_class->start = GstTerrainSeg::call<start>;
  transform_class->stop = GstTerrainSeg::call<stop>;
  transform_class->set_caps = GstTerrainSeg::call<set_caps>;
  transform_class->propose_allocation = propose_video_allocation<gst_terrain_seg_parent_class>;
  transform_class->sink_event = GstTerrainSeg::call<sink_event>;
  transform_class->src_event = GstTerrainSeg::call<src_event>;
  transform_class->before_transform = sync_controlled;
  transform_class->transform_ip = GstTerrainSeg::call<transform_ip>;
}

} // namespace

GST_ELEMENT_REGISTER_DEFINE(terrainseg, "terrainseg", GST_RANK_NONE, gst_terrain_seg_get_type())
