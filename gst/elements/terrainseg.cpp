// SPDX-License-Identifier: LGPL-2.1-or-later
#include "elements/terrainseg.hpp"

#include <gst/terrainseg/terrainsegmeta.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "elements/terrainseg/analytics.hpp"
#include "elements/terrainseg/announcer.hpp"
#include "elements/terrainseg/metric_stage.hpp"
#include "elements/terrainseg/region_drawer.hpp"
#include "elements/terrainseg/settings_book.hpp"
#include "elements/terrainseg/statistics.hpp"
#include "elements/terrainseg/summary.hpp"
#include "elements/terrainseg/terrain_memory.hpp"
#include "exchange/model_file.hpp"
#include "support/buffer_pool.hpp"
#include "support/colour_watch.hpp"
#include "support/estimate_meta.hpp"
#include "support/guarded.hpp"
#include "support/instance_state.hpp"
#include "support/meta.hpp"
#include "support/metric_drawing.hpp"
#include "support/metric_meta.hpp"
#include "support/name_property.hpp"
#include "support/object.hpp"
#include "support/plugin_api.hpp"
#include "support/training_meta.hpp"
#include "support/transform.hpp"
#include "support/video_frame.hpp"
#include "support/wall_clock.hpp"
#include "support/window_request.hpp"
#include "terrainseg/segmenter.hpp"

GST_DEBUG_CATEGORY_STATIC(terrainseg_debug);
#define GST_CAT_DEFAULT terrainseg_debug

namespace terrainseg {
namespace {

/// The settings that the segmenter gets: with a window that fits the frame.
struct FittedWindow {
  Settings core;
  std::uint64_t sequence = 0;          ///< of the settings that it was made from
  std::optional<WindowRequest> made;   ///< from what window and for what frame
  std::optional<WindowRequest> warned; ///< that it does not fit
};

} // namespace

/// Everything behind the instance. "object lock": the GstObject's; held for copies only, never while a frame
/// is processed. "streaming": touched by the streaming thread alone, or while there is none.
struct ElementState {
  NameProperty instance;
  std::atomic<bool> navigation = false;
  std::atomic<int> frame_width = 0, frame_height = 0; // of the caps, for events from other threads
  RegionDrawer drawer;                                // object lock
  SettingsBook book;                                  // object lock
  Statistics statistics;                              // object lock
  std::unique_ptr<Segmenter>
      segmenter;                  // object lock, except while `processing`, when it is the streaming thread's
  bool processing = false;        // object lock
  GCond processed;                // object lock; signalled when `processing` ends
  std::optional<Terrain> initial; // object lock; what a new stream starts from
  std::string initial_name;       // object lock; where it came from
  bool initial_by_signal = false; // object lock; by load-model, which stands above model-location
  TerrainMemory memory;           // object lock; of other streams, with reset-on=per-stream
  std::optional<Terrain> recalled; // object lock; of this stream, which came back; waits for its first frame

  ElementSettings settings; // streaming; the snapshot
  FittedWindow fitted;      // streaming
  std::optional<std::pair<int, int>>
      line_warned;                       // streaming; row and height of a vanishing line below the frame
  std::uint64_t sequence = 0;            // streaming; of the snapshot
  std::uint64_t configured_sequence = 0; // streaming; of the settings that the segmenter has
  bool configured_learnable = true;      // streaming; whether they let it learn
  GstVideoInfo info;                     // streaming
  std::optional<ColorSpace> space;       // streaming; of the caps before
  bool misfit_told = false;        // streaming; video, terrain or calibration that does not fit, once a start
  std::string stream_id;           // streaming
  bool fresh = true;               // streaming; no frame since start
  Announcer announcer;             // streaming
  bool warned_training = false;    // streaming
  ColourWatch colours;             // streaming
  Summary summary;                 // streaming; only while somebody reads it
  TrainingReader training;         // streaming
  MaskPool masks, confidence_maps; // streaming
  SmallPool boundaries;            // streaming
  MetricStage metres;              // streaming; poses come from any thread
  std::string shape_flaw; // streaming; of the calibration, for the frames of these caps; waits for the first
  MetricWriter metre_writer;             // streaming
  MetricDrawing metre_drawing;           // streaming
  std::optional<GstClockTime> start_utc; // streaming; of start-time
  std::atomic<bool> warned_pose = false; // of this start
#ifdef TERRAINSEG_ANALYTICS
  AnalyticsWriter analytics; // streaming
#endif

  ElementState() noexcept {
    g_cond_init(&processed);
    gst_video_info_init(&info);
  }
  ~ElementState() {
    g_cond_clear(&processed);
  }
};

namespace {

/// The streaming thread's turn with the segmenter: without the lock, but others wait for its end.
class Turn {
 public:
  Turn(gpointer object, ElementState& state) : object_(object), state_(state) {
    ObjectLock lock(object_);
    state_.processing = true;
  }
  ~Turn() {
    ObjectLock lock(object_);
    state_.processing = false;
    g_cond_broadcast(&state_.processed);
  }
  Turn(const Turn&) = delete;
  Turn& operator=(const Turn&) = delete;

 private:
  gpointer object_;
  ElementState& state_;
};

/// Calls `use` with the segmenter (nullptr before start) under the object lock, between two frames.
template <class Use> auto between_frames(gpointer object, ElementState& state, Use use) {
  ObjectLock lock(object);
  while (state.processing)
    g_cond_wait(&state.processed, GST_OBJECT_GET_LOCK(object));
  return use(state.segmenter.get());
}

ColorSpace space_of(const GstVideoInfo& info) {
  return {GST_VIDEO_INFO_IS_RGB(&info) != 0, colorimetry_of(info)};
}

std::string name_of(const ColorSpace& space) {
  const char* range = space.colorimetry.range == ColorRange::full ? " full range" : " limited range";
  if (space.rgb)
    return std::string("RGB") + range;
  const char* matrix = space.colorimetry.matrix == ColorMatrix::bt709    ? "BT.709"
                       : space.colorimetry.matrix == ColorMatrix::bt2020 ? "BT.2020"
                                                                         : "BT.601";
  return std::string("YUV ") + matrix + range;
}

} // namespace
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
struct GstTerrainSeg {
  GstBaseTransform parent;
  InstanceState<ElementState> state;
};
struct GstTerrainSegClass {
  GstBaseTransformClass parent_class;
};

G_DEFINE_TYPE(GstTerrainSeg, gst_terrain_seg, GST_TYPE_BASE_TRANSFORM)
GST_ELEMENT_REGISTER_DEFINE(terrainseg, "terrainseg", GST_RANK_NONE, gst_terrain_seg_get_type())

namespace {

GstTerrainSeg* self_of(gpointer object) {
  return reinterpret_cast<GstTerrainSeg*>(object);
}
ElementState& state_of(gpointer object) {
  return *self_of(object)->state;
}

// ---- properties and signals ------------------------------------------------------------------------------

enum Signal { signal_reset, signal_save_model, signal_load_model, signal_unset_property, signal_count };
guint signals[signal_count];

/// Properties that are no settings of the filter; their ids follow.
guint stats_id() {
  return SettingsBook::last_id() + 1;
}
guint instance_id() {
  return stats_id() + 1;
}
guint navigation_id() {
  return stats_id() + 2;
}

void set_property(GObject* object, guint id, const GValue* value, GParamSpec* spec) {
  guarded(object, false, [&] {
    if (id == instance_id()) {
      state_of(object).instance.set(value);
      return true;
    }
    if (id == navigation_id()) {
      state_of(object).navigation = g_value_get_boolean(value);
      return true;
    }
    SettingsBook::Ids changed;
    {
      ObjectLock lock(object);
      if (!state_of(object).book.set(id, value, changed))
        G_OBJECT_WARN_INVALID_PROPERTY_ID(object, id, spec);
    }
    SettingsBook::notify(object, changed);
    return true;
  });
}

void get_property(GObject* object, guint id, GValue* value, GParamSpec* spec) {
  guarded(object, false, [&] {
    ElementState& state = state_of(object);
    if (id == instance_id()) {
      state.instance.get(value);
      return true;
    }
    if (id == navigation_id()) {
      g_value_set_boolean(value, state.navigation);
      return true;
    }
    if (id == stats_id()) {
      const auto copy = std::make_unique<Statistics>(); // may fail, and not under the lock
      {
        ObjectLock lock(object);
        *copy = state.statistics;
      }
      g_value_take_boxed(value, copy->structure());
      return true;
    }
    ObjectLock lock(object);
    if (!state.book.get(id, value))
      G_OBJECT_WARN_INVALID_PROPERTY_ID(object, id, spec);
    return true;
  });
}

void on_reset(GstTerrainSeg* self) {
  guarded(self, false, [&] {
    return between_frames(self, *self->state, [&](Segmenter* segmenter) {
      self->state->initial.reset();
      self->state->initial_by_signal = false;
      self->state->memory.clear();
      self->state->recalled.reset();
      if (segmenter)
        segmenter->reset();
      return true;
    });
  });
}

bool holds_anything(const Terrain& terrain) {
  return std::any_of(terrain.models.begin(), terrain.models.end(),
                     [](const TerrainModel& model) { return model.mass > 0; });
}

gboolean on_save_model(GstTerrainSeg* self, const gchar* path) {
  return guarded<gboolean>(self, FALSE, [&]() -> gboolean {
    if (!path)
      return FALSE;
    const auto terrain = between_frames(self, *self->state, [](Segmenter* segmenter) {
      return segmenter ? std::optional(segmenter->terrain()) : std::nullopt;
    });
    if (!terrain || !holds_anything(*terrain)) {
      GST_ELEMENT_WARNING(self, RESOURCE, WRITE,
                          ("Nothing is learned yet that could be saved as \"%s\".", path),
                          ("save-model(\"%s\"): no learned models", path));
      return FALSE;
    }
    const std::string error = save_terrain(path, *terrain);
    if (!error.empty()) {
      GST_ELEMENT_WARNING(self, RESOURCE, WRITE, ("The learned terrain was not saved: %s", error.c_str()),
                          ("save-model(\"%s\"): %s", path, error.c_str()));
      return FALSE;
    }
    return TRUE;
  });
}

gboolean on_load_model(GstTerrainSeg* self, const gchar* path) {
  return guarded<gboolean>(self, FALSE, [&]() -> gboolean {
    if (!path)
      return FALSE;
    TerrainResult read = load_terrain(path);
    std::string error = read.error;
    if (read.terrain) {
      const Status status = between_frames(self, *self->state, [&](Segmenter* segmenter) {
        Status adopted = segmenter ? segmenter->adopt(*read.terrain) : Status();
        if (adopted.ok()) {
          self->state->initial = std::move(read.terrain);
          self->state->initial_name = path;
          self->state->initial_by_signal = true;
          self->state->memory.clear(); // every stream begins from this one
          self->state->recalled.reset();
        }
        return adopted;
      });
      error = status.message();
      if (status.ok())
        return TRUE;
    }
    GST_ELEMENT_WARNING(
        self, RESOURCE, READ,
        ("The learned terrain \"%s\" was not loaded, the running one stays: %s", path, error.c_str()),
        ("load-model(\"%s\"): %s", path, error.c_str()));
    return FALSE;
  });
}

gboolean on_unset_property(GstTerrainSeg* self, const gchar* name) {
  return guarded<gboolean>(self, FALSE, [&]() -> gboolean {
    SettingsBook::Ids changed;
    bool known = false;
    {
      ObjectLock lock(self);
      known = self->state->book.unset(name, changed);
    }
    SettingsBook::notify(self, changed);
    return known;
  });
}

// ---- start, stop, caps -----------------------------------------------------------------------------------

void report_settings(gpointer object, const SettingsError& error) {
  GST_ELEMENT_ERROR(
      GST_ELEMENT(object), LIBRARY, SETTINGS,
      ("Property %s cannot be %s: %s.", error.property.c_str(), error.value.c_str(), error.reason.c_str()),
      ("property %s, value %s, rule: %s", error.property.c_str(), error.value.c_str(), error.reason.c_str()));
}

/// Reads the file of model-location, unless load-model gave another terrain since. False after an error was
/// posted.
bool read_model_location(gpointer object, ElementState& s) {
  const std::string& path = s.settings.model_location;
  {
    ObjectLock lock(object);
    if (path.empty() || s.initial_by_signal)
      return true;
  }
  TerrainResult read = load_terrain(path);
  if (!read.terrain) {
    GST_ELEMENT_ERROR(GST_ELEMENT(object), RESOURCE, READ,
                      ("The learned terrain \"%s\" of property model-location cannot be used: %s",
                       path.c_str(), read.error.c_str()),
                      ("property model-location, value \"%s\": %s", path.c_str(), read.error.c_str()));
    return false;
  }
  ObjectLock lock(object);
  s.initial = std::move(read.terrain);
  s.initial_name = path;
  return true;
}

/// Reads the file of settings-location. False after an error was posted.
bool read_settings_file(gpointer object, ElementState& s) {
  SettingsFile file;
  {
    ObjectLock lock(object);
    file.path = s.book.settings().settings_location;
  }
  if (!file.path.empty())
    file = terrainseg::read_settings_file(file.path);
  std::optional<SettingsError> wrong;
  SettingsBook::Ids changed;
  if (file.error.empty()) {
    ObjectLock lock(object);
    wrong = s.book.take_file(file, changed);
  }
  SettingsBook::notify(object, changed);
  const std::string reason = wrong ? "key " + wrong->message() : file.error;
  if (!reason.empty())
    GST_ELEMENT_ERROR(GST_ELEMENT(object), RESOURCE, SETTINGS,
                      ("The settings file \"%s\" of property settings-location cannot be used: %s.",
                       file.path.c_str(), reason.c_str()),
                      ("property settings-location, value \"%s\": %s", file.path.c_str(), reason.c_str()));
  return reason.empty();
}

/// Reads camera-info, mount and start-time. False after an error was posted.
bool start_metres(gpointer object, ElementState& s) {
  const ElementSettings& set = s.settings;
  auto flaw = s.metres.start(set.camera_info, set.mount);
  s.start_utc.reset();
  s.warned_pose = false;
  std::string error;
  if (!flaw && !set.start_time.empty() && !(s.start_utc = parse_start_time(set.start_time, error)))
    flaw = SettingFlaw{"start-time", set.start_time, error};
  if (flaw) {
    post_error(GST_ELEMENT(object), *flaw);
    return false;
  }
  if (set.camera_info.empty() != set.mount.empty())
    GST_ELEMENT_WARNING(GST_ELEMENT(object), LIBRARY, SETTINGS,
                        ("There are no metres: they need camera-info and mount, and %s is not set.",
                         set.mount.empty() ? "mount" : "camera-info"),
                        ("camera-info \"%s\", mount \"%s\"", set.camera_info.c_str(), set.mount.c_str()));
  return true;
}

/// Scripts that set what the running pipeline does not use go on, and are told.
void warn_unused(gpointer object, const std::string& names, bool free_space) {
  if (!names.empty())
    GST_ELEMENT_WARNING(GST_ELEMENT(object), LIBRARY, SETTINGS,
                        ("Set without effect: %s. The pipeline that runs (free-space=%s) does not use it.",
                         names.c_str(), free_space ? "true" : "false"),
                        ("properties %s", names.c_str()));
}

gboolean start(GstBaseTransform* transform) {
  return guarded<gboolean>(transform, FALSE, [&]() -> gboolean {
    ElementState& s = state_of(transform);
    if (!read_settings_file(transform, s))
      return FALSE;
    std::optional<SettingsError> error;
    std::string unused;
    {
      ObjectLock lock(transform);
      s.book.forget_told();
      error = s.book.error();
      unused = s.book.take_unused();
      s.settings = s.book.settings();
      s.sequence = s.book.sequence();
    }
    if (error) {
      report_settings(transform, *error);
      return FALSE;
    }
    warn_unused(transform, unused, s.settings.core.free_space);
    if (!read_model_location(transform, s) || !start_metres(transform, s))
      return FALSE;
    s.configured_sequence = s.sequence;
    s.configured_learnable = true;
    s.fresh = true;
    s.announcer.reset();
    s.warned_training = false;
    s.colours = {};
    s.fitted.sequence = 0;
    s.fitted.warned.reset();
    s.line_warned.reset();
    s.summary = {};
    s.misfit_told = false;
    ObjectLock lock(transform);
    if (s.segmenter) { // reset-on=never keeps it through READY, with what it learned since it was loaded
      s.segmenter->configure(s.settings.core);
      return TRUE;
    }
    s.segmenter = std::make_unique<Segmenter>(s.settings.core);
    s.statistics = {};
    if (s.initial)
      (void)s.segmenter->adopt(*s.initial); // before a frame there is no colour space that it could miss
    return TRUE;
  });
}

/// Puts by what was learned in the stream that ends, for when it comes back. Between two frames.
void keep_for_later(ElementState& s, const Segmenter* segmenter) {
  if (s.stream_id.empty() || !segmenter)
    return;
  Terrain terrain = s.recalled ? std::move(*s.recalled) : segmenter->terrain();
  s.recalled.reset();
  if (holds_anything(terrain))
    s.memory.keep(s.stream_id, std::move(terrain));
}

gboolean stop(GstBaseTransform* transform) {
  return guarded<gboolean>(transform, FALSE, [&]() -> gboolean {
    ElementState& s = state_of(transform);
    s.masks.drop();
    s.confidence_maps.drop();
    s.boundaries.drop();
    s.metre_writer.drop();
#ifdef TERRAINSEG_ANALYTICS
    s.analytics.drop();
#endif
    ObjectLock lock(transform);
    if (s.book.settings().reset_on == ResetOn::per_stream)
      keep_for_later(s, s.segmenter.get());
    if (s.book.settings().reset_on != ResetOn::never) {
      s.segmenter.reset();
      if (!s.initial_by_signal)
        s.initial.reset(); // read again at the next start
      s.stream_id.clear();
      s.space.reset();
    }
    return TRUE;
  });
}

/// Forgets what was learned; a loaded terrain is what a new stream starts from.
void forget(gpointer object, const char* why) {
  ElementState& s = state_of(object);
  GST_INFO_OBJECT(object, "the learned terrain is forgotten: %s", why);
  between_frames(object, s, [&](Segmenter* segmenter) {
    if (!segmenter)
      return;
    segmenter->reset();
    if (s.initial)
      (void)segmenter->adopt(*s.initial);
  });
}

/// What is wrong when a loaded terrain was learned in another colour space than `space`.
std::optional<std::string> foreign_terrain(gpointer object, const ColorSpace& space) {
  ElementState& s = state_of(object);
  ObjectLock lock(object);
  if (!s.initial || s.initial->space == space)
    return std::nullopt;
  return "The learned terrain \"" + s.initial_name + "\" was learned in " + name_of(s.initial->space) +
         " and the video is " + name_of(space) + ".";
}

gboolean set_caps(GstBaseTransform* transform, GstCaps* caps, GstCaps*) {
  return guarded<gboolean>(transform, FALSE, [&]() -> gboolean {
    ElementState& s = state_of(transform);
    GstVideoInfo info;
    if (!gst_video_info_from_caps(&info, caps)) {
      GST_ELEMENT_ERROR(GST_ELEMENT(transform), STREAM, FORMAT, ("The video format cannot be understood."),
                        ("caps %" GST_PTR_FORMAT, printable(caps)));
      return FALSE;
    }
    if (!may_be_progressive(info)) {
      const std::string mode = gst_video_interlace_mode_to_string(GST_VIDEO_INFO_INTERLACE_MODE(&info));
      // Upstream tries other caps, and this again and again: one error is enough.
      if (!std::exchange(s.misfit_told, true))
        report_interlaced(transform, ("interlace-mode=" + mode).c_str());
      return FALSE;
    }
    const ColorSpace space = learning_space(s.settings.core, space_of(info));
    if (const auto foreign = foreign_terrain(transform, space)) {
      if (!s.space) { // what the user asked for cannot be had; later it is the stream that changed
        if (!std::exchange(s.misfit_told, true)) // as above
          GST_ELEMENT_ERROR(GST_ELEMENT(transform), STREAM, WRONG_TYPE,
                            ("%s Convert the video in front of terrainseg, or learn anew.", foreign->c_str()),
                            ("caps %" GST_PTR_FORMAT, printable(caps)));
        return FALSE;
      }
      GST_ELEMENT_WARNING(GST_ELEMENT(transform), STREAM, WRONG_TYPE,
                          ("%s It is learned anew.", foreign->c_str()),
                          ("caps %" GST_PTR_FORMAT, printable(caps)));
      ObjectLock lock(transform);
      s.initial.reset();
      s.initial_by_signal = false;
    }
    s.shape_flaw = s.metres.fit(GST_VIDEO_INFO_WIDTH(&info), GST_VIDEO_INFO_HEIGHT(&info));
    if (s.space && *s.space != space)
      forget(transform, "another colour space");
    GST_DEBUG_OBJECT(transform, "learns in %s, caps %" GST_PTR_FORMAT, name_of(space).c_str(),
                     printable(caps));
    s.space = space;
    s.info = info;
    s.frame_width = GST_VIDEO_INFO_WIDTH(&info);
    s.frame_height = GST_VIDEO_INFO_HEIGHT(&info);
    return TRUE;
  });
}

gboolean propose_allocation(GstBaseTransform* transform, GstQuery* decide_query, GstQuery* query) {
  return propose_video_allocation(gst_terrain_seg_parent_class, transform, decide_query, query);
}

// ---- events ----------------------------------------------------------------------------------------------

/// True when the event was one for this element. It travels on all the same.
bool take_near_event(gpointer object, GstEvent* event) {
  const GstStructure* fields = gst_event_get_structure(event);
  if (!fields || !gst_structure_has_name(fields, GST_TERRAIN_SEG_NEAR_EVENT))
    return false;
  gboolean clear = FALSE;
  if (!gst_structure_get_boolean(fields, "clear", &clear)) {
    GST_ELEMENT_WARNING(
        GST_ELEMENT(object), STREAM, FAILED,
        ("An event %s without the boolean field \"clear\" was ignored.", GST_TERRAIN_SEG_NEAR_EVENT),
        ("event %" GST_PTR_FORMAT, printable(event)));
    return false;
  }
  {
    ObjectLock lock(object);
    state_of(object).book.set_near_clear(clear);
  }
  g_object_notify(G_OBJECT(object), "near-clear");
  return true;
}

/// As take_near_event().
bool take_pose_event(gpointer object, GstEvent* event) {
  const GstStructure* fields = gst_event_get_structure(event);
  if (!fields || !gst_structure_has_name(fields, GST_TERRAIN_SEG_POSE_EVENT))
    return false;
  const char* flaw = state_of(object).metres.take_pose(fields);
  if (flaw && !state_of(object).warned_pose.exchange(true)) // they come a hundred times a second
    GST_ELEMENT_WARNING(GST_ELEMENT(object), STREAM, FAILED,
                        ("An event %s was ignored: %s.", GST_TERRAIN_SEG_POSE_EVENT, flaw),
                        ("event %" GST_PTR_FORMAT, printable(event)));
  return !flaw;
}

bool take_custom_event(gpointer object, GstEvent* event) {
  return take_near_event(object, event) || take_pose_event(object, event);
}

void take_stream_start(gpointer object, GstEvent* event) {
  ElementState& s = state_of(object);
  const gchar* id = nullptr;
  gst_event_parse_stream_start(event, &id);
  const std::string next = id ? id : "";
  const bool other = s.stream_id != next, changed = other && !s.stream_id.empty();
  ResetOn reset_on;
  {
    ObjectLock lock(object);
    reset_on = s.book.settings().reset_on;
  }
  if (other && reset_on == ResetOn::per_stream)
    between_frames(object, s, [&](Segmenter* segmenter) {
      auto known = s.memory.take(next); // before the one that is left pushes it out
      keep_for_later(s, segmenter);
      s.recalled = std::move(known);
    });
  s.stream_id = next;
  if (changed && reset_on != ResetOn::never)
    forget(object, "a new stream");
}

/// Goes on from what the stream learned when it was here before. With its first frame, because its colour
/// space is known only then.
void recall_stream(gpointer object, ElementState& s) {
  between_frames(object, s, [&](Segmenter* segmenter) {
    const auto terrain = std::exchange(s.recalled, std::nullopt);
    if (segmenter && terrain && terrain->space == s.space && segmenter->adopt(*terrain).ok())
      GST_INFO_OBJECT(object, "stream \"%s\" is back, and what was learned in it", s.stream_id.c_str());
  });
}

gboolean sink_event(GstBaseTransform* transform, GstEvent* event) {
  const bool taken = guarded(transform, false, [&] {
    switch (GST_EVENT_TYPE(event)) {
    case GST_EVENT_STREAM_START:
      take_stream_start(transform, event);
      break;
    case GST_EVENT_FLUSH_STOP: // after a seek neighbours in time are none in the picture
      between_frames(transform, state_of(transform), [](Segmenter* segmenter) {
        if (segmenter)
          segmenter->reset_temporal();
      });
      state_of(transform).metres.flush();
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

// ---- rectangles drawn with a pointer ---------------------------------------------------------------------

/// Sets a property in the book. The object lock is held, so that a frame sees all of several or none; the
/// caller notifies without it.
void set_in_book(gpointer object, const char* name, const GValue* value) {
  const GParamSpec* spec = g_object_class_find_property(G_OBJECT_GET_CLASS(object), name);
  SettingsBook::Ids changed; // the caller notifies, of what it set
  state_of(object).book.set(spec->param_id, value, changed);
}

void set_in_book(gpointer object, const char* name, int number) {
  GValue value = G_VALUE_INIT;
  g_value_init(&value, G_TYPE_INT);
  g_value_set_int(&value, number);
  set_in_book(object, name, &value);
}

void post_region(gpointer object, const char* kind, const Rectangle& r, bool removed) {
  gst_element_post_message(
      GST_ELEMENT(object),
      gst_message_new_element(
          GST_OBJECT(object),
          gst_structure_new(GST_TERRAIN_SEG_REGION_MESSAGE, "kind", G_TYPE_STRING, kind, "x", G_TYPE_INT, r.x,
                            "y", G_TYPE_INT, r.y, "width", G_TYPE_INT, r.width, "height", G_TYPE_INT,
                            r.height, "removed", G_TYPE_BOOLEAN, static_cast<gboolean>(removed), nullptr)));
}

/// Places the training window.
void place_window(gpointer object, const Rectangle& window, int frame_height) {
  {
    ObjectLock lock(object);
    set_in_book(object, "window-x", window.x);
    set_in_book(object, "window-width", window.width);
    set_in_book(object, "window-height", window.height);
    set_in_book(object, "window-bottom", frame_height - window.y - window.height);
    GValue none = G_VALUE_INIT; // fractions would stand above the pixels
    g_value_init(&none, G_TYPE_STRING);
    g_value_set_static_string(&none, "");
    set_in_book(object, "window-rect", &none);
    g_value_unset(&none);
  }
  for (const char* name : {"window-x", "window-width", "window-height", "window-bottom", "window-rect"})
    g_object_notify(G_OBJECT(object), name);
  post_region(object, "window", window, false);
}

/// The window that is in force, its middle moved to a point as far as the frame lets; empty before a frame.
Rectangle moved_window(gpointer object, ElementState& s, int x, int y, int frame_width, int frame_height) {
  Rectangle window = between_frames(
      object, s, [](Segmenter* segmenter) { return segmenter ? segmenter->estimate().window : Rectangle{}; });
  window.x = std::clamp(x - window.width / 2, 0, std::max(0, frame_width - window.width));
  window.y = std::clamp(y - window.height / 2, 0, std::max(0, frame_height - window.height));
  return window;
}

void set_ignored(gpointer object, const std::vector<Rectangle>& regions) {
  GValue array = G_VALUE_INIT;
  g_value_init(&array, GST_TYPE_ARRAY);
  put_regions(regions, &array);
  set_in_book(object, "ignore-regions", &array);
  g_value_unset(&array);
}

/// Adds a region that is ignored; a click takes away those under it.
void change_ignored(gpointer object, ElementState& s, const RegionDrawer::Drawn& drawn) {
  std::vector<Rectangle> removed;
  {
    ObjectLock lock(object);
    std::vector<Rectangle> regions = s.book.settings().core.ignore_regions;
    if (!drawn.region.empty())
      regions.push_back(drawn.region);
    else
      std::erase_if(regions, [&](const Rectangle& r) {
        const bool hit =
            drawn.x >= r.x && drawn.y >= r.y && drawn.x < r.x + r.width && drawn.y < r.y + r.height;
        if (hit)
          removed.push_back(r);
        return hit;
      });
    if (drawn.region.empty() && removed.empty())
      return;
    set_ignored(object, regions);
  }
  g_object_notify(G_OBJECT(object), "ignore-regions");
  if (!drawn.region.empty())
    post_region(object, "ignore", drawn.region, false);
  for (const Rectangle& r : removed)
    post_region(object, "ignore", r, true);
}

/// A pointer event in pixels of this element's frames: what scales behind it has rewritten it. It travels on.
void take_navigation(gpointer object, GstEvent* event) {
  ElementState& s = state_of(object);
  const int width = s.frame_width, height = s.frame_height;
  std::optional<RegionDrawer::Drawn> drawn;
  {
    ObjectLock lock(object);
    drawn = s.drawer.take(event, width, height);
  }
  if (!drawn)
    return;
  if (drawn->button == RegionDrawer::ignore_button)
    return change_ignored(object, s, *drawn);
  const Rectangle window =
      drawn->region.empty() ? moved_window(object, s, drawn->x, drawn->y, width, height) : drawn->region;
  if (!window.empty())
    place_window(object, window, height);
}

gboolean src_event(GstBaseTransform* transform, GstEvent* event) {
  if (GST_EVENT_TYPE(event) == GST_EVENT_NAVIGATION && state_of(transform).navigation)
    guarded(transform, false, [&] {
      take_navigation(transform, event);
      return true;
    });
  if (stops_qos(transform, event)) {
    GST_LOG_OBJECT(transform, "stopped, qos is off: %" GST_PTR_FORMAT, printable(event));
    gst_event_unref(event);
    return TRUE;
  }
  const bool taken = guarded(transform, false, [&] { return take_custom_event(transform, event); });
  return GST_BASE_TRANSFORM_CLASS(gst_terrain_seg_parent_class)->src_event(transform, event) || taken;
}

// ---- frames ----------------------------------------------------------------------------------------------

void before_transform(GstBaseTransform* transform, GstBuffer* buffer) {
  sync_controlled(transform, buffer);
}

/// Takes over properties that changed since the frame before. Values that contradict each other are reported
/// and the ones before stay in force.
void refresh_settings(gpointer object, ElementState& s) {
  std::optional<SettingsError> error;
  std::string unused;
  {
    ObjectLock lock(object);
    if (s.sequence == s.book.sequence())
      return;
    s.sequence = s.book.sequence();
    error = s.book.error();
    if (!error) {
      s.settings = s.book.settings();
      unused = s.book.take_unused();
    }
  }
  warn_unused(object, unused, s.settings.core.free_space);
  if (error)
    GST_ELEMENT_WARNING(GST_ELEMENT(object), LIBRARY, SETTINGS,
                        ("Property %s cannot be %s: %s. The values before stay in force.",
                         error->property.c_str(), error->value.c_str(), error->reason.c_str()),
                        ("property %s, value %s, rule: %s", error->property.c_str(), error->value.c_str(),
                         error->reason.c_str()));
}

/// Moves and cuts a window that does not fit the frame, as a stream may shrink at any time; says so once for
/// each window and frame size.
void fit_window(gpointer object, ElementState& s) {
  const int width = GST_VIDEO_INFO_WIDTH(&s.info), height = GST_VIDEO_INFO_HEIGHT(&s.info);
  const Settings& set = s.settings.core;
  const WindowRequest request{
      set.window_width, set.window_height, set.window_bottom, set.window_x, width, height};
  if (s.fitted.sequence == s.sequence && s.fitted.made == request)
    return;
  s.fitted.sequence = s.sequence;
  s.fitted.made = request;
  s.configured_sequence = 0; // the segmenter has older ones
  s.fitted.core = with_fitting_window(set, width, height);
  if (s.fitted.core == set || s.fitted.warned == request)
    return;
  s.fitted.warned = request;
  TERRAINSEG_POST_WARNING(
      GST_ELEMENT(object), LIBRARY, SETTINGS,
      window_warning(request, s.fitted.core,
                     " Set window-rect for a window that follows the size of the frame."));
}

/// Says once for each row and frame size that a vanishing line below the frame is none.
void check_line(gpointer object, ElementState& s) {
  const std::pair line{s.settings.core.vanishing_row, GST_VIDEO_INFO_HEIGHT(&s.info)};
  if (line.first < line.second || s.line_warned == line)
    return;
  s.line_warned = line;
  GST_ELEMENT_WARNING(
      GST_ELEMENT(object), LIBRARY, SETTINGS,
      ("vanishing-row = %d lies below a frame of %d rows and is not used: it is the row of the "
       "frame in which level ground would end.",
       line.first, line.second),
      ("property vanishing-row, value %d", line.first));
}

/// Gives the segmenter its settings when they changed. A frame that is not learnable is scored all the same.
void configure(GstBaseTransform* transform, ElementState& s, GstBuffer* buffer) {
  const bool learnable = is_learnable(transform->segment, buffer);
  if (s.configured_sequence == s.sequence && s.configured_learnable == learnable)
    return;
  Settings wanted = s.fitted.core;
  wanted.learning = wanted.learning && learnable;
  s.segmenter->configure(wanted);
  s.configured_sequence = s.sequence;
  s.configured_learnable = learnable;
}

class WritableMap {
 public:
  explicit WritableMap(GstBuffer* buffer) : buffer_(buffer) {
    mapped_ = buffer && gst_buffer_map(buffer, &map_, GST_MAP_WRITE);
  }
  ~WritableMap() {
    if (mapped_)
      gst_buffer_unmap(buffer_, &map_);
  }
  WritableMap(const WritableMap&) = delete;
  WritableMap& operator=(const WritableMap&) = delete;
  guint8* data() const { return mapped_ ? map_.data : nullptr; }

 private:
  GstBuffer* buffer_;
  GstMapInfo map_{};
  bool mapped_ = false;
};

/// What one frame gave. The buffers go with the frame; the estimate's mask points into the first.
struct Outcome {
  OwnedBuffer mask, boundary;
  OwnedBuffer confidence_map; ///< none where the pipeline makes none
  Estimate estimate;
  const MetricEstimate* metric = nullptr; ///< in memory of the metric stage
};

bool fail(gpointer object, const Status& status) {
  switch (status.code()) {
  case Status::Code::window_outside_frame:
    GST_ELEMENT_ERROR(GST_ELEMENT(object), LIBRARY, SETTINGS, ("%s", status.message().c_str()),
                      ("window outside the frame: %s", status.message().c_str()));
    break;
  case Status::Code::bad_frame:
    GST_ELEMENT_ERROR(GST_ELEMENT(object), STREAM, FORMAT, ("%s", status.message().c_str()),
                      ("bad frame: %s", status.message().c_str()));
    break;
  default:
    GST_ELEMENT_ERROR(GST_ELEMENT(object), LIBRARY, FAILED, ("%s", status.message().c_str()),
                      ("status %d: %s", static_cast<int>(status.code()), status.message().c_str()));
    break;
  }
  return false;
}

/// The confidence map in memory that can travel; nullptr where there is none, or no memory for it.
OwnedBuffer copy_confidence_map(ElementState& s, const GrayView& map) {
  if (map.empty())
    return nullptr;
  OwnedBuffer buffer = s.confidence_maps.acquire(map.width, map.height);
  const WritableMap out(buffer.get());
  if (!out.data())
    return nullptr;
  for (int y = 0; y < map.height; ++y)
    std::copy_n(map.plane.row(y), map.width, out.data() + static_cast<std::ptrdiff_t>(y) * map.width);
  return buffer;
}

/// Training pixels of the frame; what is wrong with them is told once a stream.
Supervision read_training(gpointer object, ElementState& s, GstBuffer* buffer) {
  const Supervision supervision =
      s.training.read(buffer, GST_VIDEO_INFO_WIDTH(&s.info), GST_VIDEO_INFO_HEIGHT(&s.info));
  if (s.training.error() && !s.warned_training) {
    s.warned_training = true;
    GST_ELEMENT_WARNING(GST_ELEMENT(object), STREAM, FAILED,
                        ("Training pixels were ignored: %s.", s.training.error()),
                        ("%s", s.training.error()));
  }
  return supervision;
}

/// GST_DEBUG=terrainseg:5 tells once a second how it goes, :6 each frame.
void log_frame(gpointer object, ElementState& s, const Estimate& e, const Counters& counters, bool supplied,
               std::int64_t now, std::int64_t took) {
  const GstDebugLevel level = gst_debug_category_get_threshold(GST_CAT_DEFAULT);
  if (G_LIKELY(level < GST_LEVEL_DEBUG))
    return;
  if (const auto line = s.summary.add(e, counters, supplied, now, took))
    GST_DEBUG_OBJECT(object, "%s", line->c_str());
  GST_LOG_OBJECT(object,
                 "frame %" G_GUINT64_FORMAT
                 ": flags %#x, generation %u, horizon %d, traversable %d permille, "
                 "%" G_GINT64_FORMAT " us",
                 e.frame, e.flags, e.model_generation, e.horizon_row, e.traversable_permille, took / 1000);
}

void draw(const MappedFrame& mapped, ElementState& s, const Outcome& outcome) {
  const PaintStyle style = s.settings.drawing.paint();
  const MutableFrame frame = mapped.mutable_view();
  paint(frame, outcome.estimate, style);
  if (outcome.metric)
    paint_metres(
        frame,
        s.metre_drawing.make(outcome.estimate, *outcome.metric, style.style, frame.width, frame.height),
        style);
}

/// Labels the frame into new buffers and draws when asked to. False after an error was posted.
bool label(GstBaseTransform* transform, ElementState& s, GstBuffer* buffer, const MappedFrame& mapped,
           Outcome& outcome) {
  const auto began = std::chrono::steady_clock::now();
  const GstClockTime running_time = running_time_of(transform->segment, GST_BUFFER_PTS(buffer));
  Frame frame = mapped.view();
  frame.vanishing_row = s.metres.vanishing_row(running_time);
  const int width = mask_extent(frame.width, s.settings.core.mask_level);
  const int height = mask_extent(frame.height, s.settings.core.mask_level);
  outcome.mask = s.masks.acquire(width, height);
  outcome.boundary = s.boundaries.acquire(static_cast<gsize>(width) * 2);
  const WritableMap mask(outcome.mask.get()), boundary(outcome.boundary.get());
  if (!mask.data() || !boundary.data()) {
    GST_ELEMENT_ERROR(GST_ELEMENT(transform), RESOURCE, NO_SPACE_LEFT, ("There is no memory for the mask."),
                      ("a mask of %d x %d cannot be allocated", width, height));
    return false;
  }
  const Supervision supervision = read_training(transform, s, buffer);
  const MaskTarget target{{mask.data(), width}, width, height};
  Status status;
  {
    Turn turn(transform, s);
    configure(transform, s, buffer);
    status = s.segmenter->process(frame, supervision, target);
    if (status.ok()) {
      outcome.estimate = s.segmenter->estimate();
      write_boundary(outcome.estimate.boundary, boundary.data()); // a row for every column of the mask
      outcome.confidence_map = copy_confidence_map(s, outcome.estimate.confidence_map);
      outcome.estimate.confidence_map = {}; // the segmenter's memory
    }
  }
  s.training.release();
  if (!status.ok())
    return fail(transform, status);
  outcome.estimate.boundary = {reinterpret_cast<const std::uint16_t*>(boundary.data()),
                               static_cast<std::size_t>(width)};
  outcome.metric = s.metres.measure(outcome.estimate, running_time, s.settings.range_max);
  if (s.settings.overlay)
    draw(mapped, s, outcome);
#ifdef TERRAINSEG_ANALYTICS
  if (s.settings.analytics && !s.analytics.attach(buffer, outcome.estimate))
    GST_WARNING_OBJECT(transform, "the GstAnalytics metadata could not be attached");
#endif
  const auto ended = std::chrono::steady_clock::now();
  const auto nanoseconds = [](auto duration) {
    return std::chrono::duration_cast<std::chrono::nanoseconds>(duration).count();
  };
  const std::int64_t took = nanoseconds(ended - began);
  Counters counters;
  {
    ObjectLock lock(transform);
    if (!s.segmenter)
      return true;
    counters = s.segmenter->counters();
    s.statistics.add(s.segmenter->stage_times(), took, counters, outcome.estimate.model_generation);
  }
  log_frame(transform, s, outcome.estimate, counters, !supervision.empty(),
            nanoseconds(ended.time_since_epoch()), took);
  return true;
}

void post_message(GstBaseTransform* transform, ElementState& s, GstBuffer* buffer, const Estimate& estimate) {
  if (!s.settings.post_messages) {
    s.announcer.reset();
    return;
  }
  const GstSegment& segment = transform->segment;
  const GstClockTime timestamp = GST_BUFFER_PTS(buffer);
  const auto news = s.announcer.consider(estimate, timestamp);
  if (!news)
    return;
  gst_element_post_message(
      GST_ELEMENT(transform),
      gst_message_new_element(
          GST_OBJECT(transform),
          gst_structure_new(GST_TERRAIN_SEG_MESSAGE, "timestamp", G_TYPE_UINT64, timestamp, "stream-time",
                            G_TYPE_UINT64, stream_time_of(segment, timestamp), "running-time", G_TYPE_UINT64,
                            running_time_of(segment, timestamp), "duration", G_TYPE_UINT64,
                            GST_BUFFER_DURATION(buffer), "traversable-permille", G_TYPE_UINT,
                            static_cast<guint>(news->traversable_permille), "horizon-row", G_TYPE_INT,
                            news->horizon_row, "blocked", G_TYPE_BOOLEAN,
                            static_cast<gboolean>(news->blocked), nullptr)));
}

/// Attaches the boundary in metres where there are any, and the wall clock where start-time gives it.
void attach_metres(GstBaseTransform* transform, ElementState& s, GstBuffer* buffer,
                   const MetricEstimate* metric) {
  if (s.start_utc)
    stamp_utc(buffer, *s.start_utc);
  if (!metric) // those of a filter before this one belonged to the estimate that was replaced
    remove_metas(buffer, GST_TERRAIN_METRIC_META_NAME, s.instance.name());
  else if (!s.metre_writer.attach(buffer, *metric, s.instance.name()))
    GST_WARNING_OBJECT(transform, "the metres could not be attached");
  if (const auto notice = s.metres.take_notice())
    GST_ELEMENT_WARNING(GST_ELEMENT(transform), STREAM, FAILED, ("%s", notice->c_str()),
                        ("%s", notice->c_str()));
}

/// Says with the first frame of a shape that the calibration is of another one, and not with its caps: in
/// front of a video that its camera marked as turned they come twice, lying and upright. False after an error
/// was posted.
bool check_shape(GstBaseTransform* transform, ElementState& s) {
  if (s.shape_flaw.empty())
    return true;
  if (s.fresh) { // what the user asked for cannot be had; later it is the stream that changed
    if (!std::exchange(s.misfit_told, true))
      GST_ELEMENT_ERROR(GST_ELEMENT(transform), STREAM, WRONG_TYPE,
                        ("The calibration \"%s\" of property camera-info does not fit: %s.",
                         s.settings.camera_info.c_str(), s.shape_flaw.c_str()),
                        (nullptr));
    return false;
  }
  GST_ELEMENT_WARNING(GST_ELEMENT(transform), STREAM, WRONG_TYPE,
                      ("There are no metres of this stream: %s.", s.shape_flaw.c_str()), (nullptr));
  s.shape_flaw.clear();
  return true;
}

/// Overrides GstBaseTransform and not GstVideoFilter, which would map for writing and so copy every frame
/// that somebody else holds too.
GstFlowReturn transform_ip(GstBaseTransform* transform, GstBuffer* buffer) {
  GST_TRACE_OBJECT(transform, "in: %" GST_PTR_FORMAT, printable(buffer));
  return guarded(transform, GST_FLOW_ERROR, [&] {
    ElementState& s = state_of(transform);
    if (!check_shape(transform, s))
      return GST_FLOW_ERROR;
    refresh_settings(transform, s);
    fit_window(transform, s);
    check_line(transform, s);
    if (s.settings.reset_on == ResetOn::discont && !s.fresh && GST_BUFFER_IS_DISCONT(buffer))
      forget(transform, "a discontinuity");
    if (s.settings.reset_on == ResetOn::per_stream)
      recall_stream(transform, s);
    s.fresh = false;
    if (!is_progressive(s.info, buffer)) {
      report_interlaced(transform, "interlace-mode=mixed, and this buffer holds two fields");
      return GST_FLOW_ERROR;
    }
    Outcome outcome;
    {
      const MappedFrame frame(s.info, buffer, s.settings.overlay ? GST_MAP_READWRITE : GST_MAP_READ);
      if (!frame) {
        report_unusable(transform, buffer, frame);
        return GST_FLOW_ERROR;
      }
      if (s.colours.see(frame.frame()))
        TERRAINSEG_POST_WARNING(transform, STREAM, FORMAT, colourless_warning(s.info));
      if (!label(transform, s, buffer, frame, outcome))
        return GST_FLOW_ERROR;
    }
    if (!attach(buffer, outcome.estimate, outcome.mask.get(), outcome.boundary.get(), s.instance.name(),
                outcome.confidence_map.get()))
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
  gst_base_transform_set_qos_enabled(transform,
                                     FALSE); // a frame that is dropped is a frame that is not learned
}

static void gst_terrain_seg_class_init(GstTerrainSegClass* klass) {
  GST_DEBUG_CATEGORY_INIT(terrainseg_debug, "terrainseg", 0,
                          "Traversable ground from a self-supervised colour model");
  auto* object_class = G_OBJECT_CLASS(klass);
  auto* element_class = GST_ELEMENT_CLASS(klass);
  auto* transform_class = GST_BASE_TRANSFORM_CLASS(klass);

  object_class->set_property = set_property;
  object_class->get_property = get_property;
  object_class->finalize = finalize_state<GstTerrainSeg, gst_terrain_seg_parent_class>;
  SettingsBook::install(object_class);
  g_object_class_install_property(
      object_class, stats_id(),
      g_param_spec_boxed(
          "stats", "Statistics",
          "Counts of frames and of skipped updates by cause, and the median and 99th percentile of each "
          "stage in microseconds",
          GST_TYPE_STRUCTURE, static_cast<GParamFlags>(G_PARAM_READABLE | G_PARAM_STATIC_STRINGS)));

  NameProperty::install(
      object_class, instance_id(), "instance", "Instance",
      "Name that goes with the metadata, so that several terrainseg in one chain keep theirs "
      "apart, none = replaces other metadata without a name");
  g_object_class_install_property(
      object_class, navigation_id(),
      g_param_spec_boolean(
          "navigation", "Navigation",
          "Whether the pointer in a video window behind draws: the left button the training "
          "window, the right one regions that are ignored",
          FALSE,
          static_cast<GParamFlags>(G_PARAM_READWRITE | G_PARAM_STATIC_STRINGS | GST_PARAM_MUTABLE_PLAYING)));

  mark_enums_as_plugin_api(object_class);

  const auto action = static_cast<GSignalFlags>(G_SIGNAL_RUN_LAST | G_SIGNAL_ACTION);
  const GType type = G_TYPE_FROM_CLASS(klass);
  signals[signal_reset] = g_signal_new_class_handler("reset", type, action, G_CALLBACK(on_reset), nullptr,
                                                     nullptr, nullptr, G_TYPE_NONE, 0);
  signals[signal_save_model] =
      g_signal_new_class_handler("save-model", type, action, G_CALLBACK(on_save_model), nullptr, nullptr,
                                 nullptr, G_TYPE_BOOLEAN, 1, G_TYPE_STRING);
  signals[signal_load_model] =
      g_signal_new_class_handler("load-model", type, action, G_CALLBACK(on_load_model), nullptr, nullptr,
                                 nullptr, G_TYPE_BOOLEAN, 1, G_TYPE_STRING);

  signals[signal_unset_property] =
      g_signal_new_class_handler("unset-property", type, action, G_CALLBACK(on_unset_property), nullptr,
                                 nullptr, nullptr, G_TYPE_BOOLEAN, 1, G_TYPE_STRING);

  gst_element_class_set_static_metadata(
      element_class, "Traversable terrain", "Filter/Analyzer/Video",
      "Learns the appearance of the ground in front of a rover and labels what is traversable",
      "The terrainseg developers");
  add_video_pad_templates(element_class);

  transform_class->start = start;
  transform_class->stop = stop;
  transform_class->set_caps = set_caps;
  transform_class->propose_allocation = propose_allocation;
  transform_class->sink_event = sink_event;
  transform_class->src_event = src_event;
  transform_class->before_transform = before_transform;
  transform_class->transform_ip = transform_ip;
}
