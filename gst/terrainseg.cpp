// SPDX-License-Identifier: LGPL-2.1-or-later
#include "terrainseg.hpp"

#include <gst/terrainseg/terrainsegmeta.h>

#include <algorithm>
#include <chrono>
#include <memory>
#include <optional>
#include <string>

#include "analytics.hpp"
#include "buffer_pool.hpp"
#include "estimate_meta.hpp"
#include "exchange/model_file.hpp"
#include "guarded.hpp"
#include "statistics.hpp"
#include "terrainseg/segmenter.hpp"
#include "terrainseg_settings.hpp"
#include "training_meta.hpp"
#include "video_frame.hpp"

GST_DEBUG_CATEGORY_STATIC(terrainseg_debug);
#define GST_CAT_DEFAULT terrainseg_debug

namespace terrainseg {
namespace {

/// What post-messages tells.
struct Told {
  int traversable_permille, horizon_row;
  bool blocked;
  bool operator==(const Told&) const = default;
};

} // namespace

/// Everything behind the instance. "object lock": the GstObject's; held for copies only, never while a frame
/// is processed. "streaming": touched by the streaming thread alone, or while there is none.
struct ElementState {
  SettingsBook book;     // object lock
  Statistics statistics; // object lock
  std::unique_ptr<Segmenter>
      segmenter;                  // object lock, except while `processing`, when it is the streaming thread's
  bool processing = false;        // object lock
  GCond processed;                // object lock; signalled when `processing` ends
  std::optional<Terrain> initial; // object lock; what a new stream starts from
  std::string initial_name;       // object lock; where it came from

  ElementSettings settings;              // streaming; the snapshot
  std::uint64_t sequence = 0;            // streaming; of the snapshot
  std::uint64_t configured_sequence = 0; // streaming; of the settings that the segmenter has
  bool configured_learnable = true;      // streaming; whether they let it learn
  GstVideoInfo info;                     // streaming
  std::optional<ColorSpace> space;       // streaming; of the caps before
  std::string stream_id;                 // streaming
  bool fresh = true;                     // streaming; no frame since start
  std::optional<Told> told;              // streaming
  bool warned_training = false;          // streaming
  TrainingReader training;               // streaming
  MaskPool masks;                        // streaming
  SmallPool boundaries;                  // streaming
#ifdef TERRAINSEG_ANALYTICS
  AnalyticsWriter analytics; // streaming
#endif

  ElementState() {
    g_cond_init(&processed);
    gst_video_info_init(&info);
  }
  ~ElementState() {
    g_cond_clear(&processed);
  }
};

namespace {

class ObjectLock {
 public:
  explicit ObjectLock(gpointer object) : object_(GST_OBJECT(object)) { GST_OBJECT_LOCK(object_); }
  ~ObjectLock() { GST_OBJECT_UNLOCK(object_); }
  ObjectLock(const ObjectLock&) = delete;
  ObjectLock& operator=(const ObjectLock&) = delete;

 private:
  GstObject* object_;
};

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

struct GstTerrainSeg {
  GstBaseTransform parent;
  ElementState* state;
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

/// For GST_PTR_FORMAT, which the compiler takes for %p.
void* printable(void* object) {
  return object;
}

// ---- properties and signals ------------------------------------------------------------------------------

enum Signal { signal_reset, signal_save_model, signal_load_model, signal_count };
guint signals[signal_count];

guint stats_id() {
  return SettingsBook::last_id() + 1;
}

void set_property(GObject* object, guint id, const GValue* value, GParamSpec* spec) {
  guarded(object, false, [&] {
    ObjectLock lock(object);
    if (!state_of(object).book.set(id, value))
      G_OBJECT_WARN_INVALID_PROPERTY_ID(object, id, spec);
    return true;
  });
}

void get_property(GObject* object, guint id, GValue* value, GParamSpec* spec) {
  guarded(object, false, [&] {
    ElementState& state = state_of(object);
    if (id == stats_id()) {
      GST_OBJECT_LOCK(object);
      const auto copy = std::make_unique<Statistics>(state.statistics);
      GST_OBJECT_UNLOCK(object);
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

// ---- start, stop, caps -----------------------------------------------------------------------------------

void report_settings(gpointer object, const SettingsError& error) {
  GST_ELEMENT_ERROR(
      GST_ELEMENT(object), LIBRARY, SETTINGS,
      ("Property %s cannot be %s: %s.", error.property.c_str(), error.value.c_str(), error.reason.c_str()),
      ("property %s, value %s, rule: %s", error.property.c_str(), error.value.c_str(), error.reason.c_str()));
}

gboolean start(GstBaseTransform* transform) {
  return guarded<gboolean>(transform, FALSE, [&]() -> gboolean {
    ElementState& s = state_of(transform);
    std::optional<SettingsError> error;
    {
      ObjectLock lock(transform);
      error = s.book.error();
      s.settings = s.book.settings();
      s.sequence = s.book.sequence();
    }
    if (error) {
      report_settings(transform, *error);
      return FALSE;
    }
    TerrainResult read;
    const std::string& path = s.settings.model_location;
    if (!path.empty() && !(read = load_terrain(path)).terrain) {
      GST_ELEMENT_ERROR(GST_ELEMENT(transform), RESOURCE, READ,
                        ("The learned terrain \"%s\" of property model-location cannot be used: %s",
                         path.c_str(), read.error.c_str()),
                        ("property model-location, value \"%s\": %s", path.c_str(), read.error.c_str()));
      return FALSE;
    }
    s.configured_sequence = s.sequence;
    s.configured_learnable = true;
    s.fresh = true;
    s.told.reset();
    s.warned_training = false;
    ObjectLock lock(transform);
    if (s.segmenter) // reset-on=never keeps it through READY
      s.segmenter->configure(s.settings.core);
    else {
      s.segmenter = std::make_unique<Segmenter>(s.settings.core);
      s.statistics = {};
    }
    if (read.terrain) {
      s.initial = std::move(read.terrain);
      s.initial_name = path;
    }
    if (s.initial)
      (void)s.segmenter->adopt(*s.initial); // before a frame there is no colour space that it could miss
    return TRUE;
  });
}

gboolean stop(GstBaseTransform* transform) {
  return guarded<gboolean>(transform, FALSE, [&]() -> gboolean {
    ElementState& s = state_of(transform);
    s.masks.drop();
    s.boundaries.drop();
#ifdef TERRAINSEG_ANALYTICS
    s.analytics.drop();
#endif
    ObjectLock lock(transform);
    if (s.book.settings().reset_on != ResetOn::never) {
      s.segmenter.reset();
      s.initial.reset();
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
    if (GST_VIDEO_INFO_IS_INTERLACED(&info)) {
      GST_ELEMENT_ERROR(GST_ELEMENT(transform), STREAM, WRONG_TYPE,
                        ("terrainseg takes progressive video only: put \"deinterlace\" in front of it."),
                        ("interlace-mode=%s in caps %" GST_PTR_FORMAT,
                         gst_video_interlace_mode_to_string(GST_VIDEO_INFO_INTERLACE_MODE(&info)),
                         printable(caps)));
      return FALSE;
    }
    const ColorSpace space = learning_space(s.settings.core, space_of(info));
    if (const auto foreign = foreign_terrain(transform, space)) {
      if (!s.space) { // what the user asked for cannot be had; later it is the stream that changed
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
    }
    if (s.space && *s.space != space)
      forget(transform, "another colour space");
    s.space = space;
    s.info = info;
    return TRUE;
  });
}

gboolean propose_allocation(GstBaseTransform* transform, GstQuery* decide_query, GstQuery* query) {
  if (!GST_BASE_TRANSFORM_CLASS(gst_terrain_seg_parent_class)
           ->propose_allocation(transform, decide_query, query))
    return FALSE;
  if (!gst_query_find_allocation_meta(query, GST_VIDEO_META_API_TYPE, nullptr))
    gst_query_add_allocation_meta(query, GST_VIDEO_META_API_TYPE, nullptr); // any stride and offset will do
  return TRUE;
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

void take_stream_start(gpointer object, GstEvent* event) {
  ElementState& s = state_of(object);
  const gchar* id = nullptr;
  gst_event_parse_stream_start(event, &id);
  const std::string next = id ? id : "";
  const bool changed = !s.stream_id.empty() && s.stream_id != next;
  s.stream_id = next;
  ResetOn reset_on;
  {
    ObjectLock lock(object);
    reset_on = s.book.settings().reset_on;
  }
  if (changed && reset_on != ResetOn::never)
    forget(object, "a new stream");
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
      break;
    case GST_EVENT_CUSTOM_DOWNSTREAM:
    case GST_EVENT_CUSTOM_DOWNSTREAM_OOB:
    case GST_EVENT_CUSTOM_BOTH:
    case GST_EVENT_CUSTOM_BOTH_OOB:
      return take_near_event(transform, event);
    default:
      break;
    }
    return false;
  });
  return GST_BASE_TRANSFORM_CLASS(gst_terrain_seg_parent_class)->sink_event(transform, event) || taken;
}

gboolean src_event(GstBaseTransform* transform, GstEvent* event) {
  const bool taken = guarded(transform, false, [&] { return take_near_event(transform, event); });
  return GST_BASE_TRANSFORM_CLASS(gst_terrain_seg_parent_class)->src_event(transform, event) || taken;
}

// ---- frames ----------------------------------------------------------------------------------------------

void before_transform(GstBaseTransform* transform, GstBuffer* buffer) {
  const GstClockTime time =
      gst_segment_to_stream_time(&transform->segment, GST_FORMAT_TIME, GST_BUFFER_TIMESTAMP(buffer));
  if (GST_CLOCK_TIME_IS_VALID(time))
    gst_object_sync_values(GST_OBJECT(transform), time);
}

/// Takes over properties that changed since the frame before. Values that contradict each other are reported
/// and the ones before stay in force.
void refresh_settings(gpointer object, ElementState& s) {
  std::optional<SettingsError> error;
  {
    ObjectLock lock(object);
    if (s.sequence == s.book.sequence())
      return;
    s.sequence = s.book.sequence();
    error = s.book.error();
    if (!error)
      s.settings = s.book.settings();
  }
  if (error)
    GST_ELEMENT_WARNING(GST_ELEMENT(object), LIBRARY, SETTINGS,
                        ("Property %s cannot be %s: %s. The values before stay in force.",
                         error->property.c_str(), error->value.c_str(), error->reason.c_str()),
                        ("property %s, value %s, rule: %s", error->property.c_str(), error->value.c_str(),
                         error->reason.c_str()));
}

/// Gives the segmenter its settings when they changed. Repeated frames (GAP) and frames in reverse order are
/// scored and not learned.
void configure(GstBaseTransform* transform, ElementState& s, GstBuffer* buffer) {
  const bool learnable = !GST_BUFFER_FLAG_IS_SET(buffer, GST_BUFFER_FLAG_GAP) && transform->segment.rate > 0;
  if (s.configured_sequence == s.sequence && s.configured_learnable == learnable)
    return;
  Settings wanted = s.settings.core;
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
  Estimate estimate;
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

void write_boundary(guint8* data, const Estimate& estimate, int columns) {
  for (int column = 0; column < columns; ++column) {
    const bool given = static_cast<std::size_t>(column) < estimate.boundary.size();
    const int row = given ? estimate.boundary[column] : estimate.frame_height;
    GST_WRITE_UINT16_LE(data + 2 * static_cast<std::ptrdiff_t>(column), static_cast<guint16>(row));
  }
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

/// Labels the frame into new buffers and draws when asked to. False after an error was posted.
bool label(GstBaseTransform* transform, ElementState& s, GstBuffer* buffer, const GstVideoFrame& frame,
           Outcome& outcome) {
  const auto began = std::chrono::steady_clock::now();
  const int width = mask_extent(GST_VIDEO_FRAME_WIDTH(&frame), s.settings.core.mask_level);
  const int height = mask_extent(GST_VIDEO_FRAME_HEIGHT(&frame), s.settings.core.mask_level);
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
    status = s.segmenter->process(view_of(frame), supervision, target);
    if (status.ok()) {
      outcome.estimate = s.segmenter->estimate();
      write_boundary(boundary.data(), outcome.estimate, width);
    }
  }
  s.training.release();
  if (!status.ok())
    return fail(transform, status);
  outcome.estimate.boundary = {reinterpret_cast<const std::uint16_t*>(boundary.data()),
                               static_cast<std::size_t>(width)};
  if (s.settings.overlay)
    paint(mutable_view_of(frame), outcome.estimate, s.settings.drawing.paint());
#ifdef TERRAINSEG_ANALYTICS
  if (s.settings.analytics && !s.analytics.attach(buffer, outcome.estimate))
    GST_WARNING_OBJECT(transform, "the GstAnalytics metadata could not be attached");
#endif
  const auto took = std::chrono::steady_clock::now() - began;
  ObjectLock lock(transform);
  if (s.segmenter)
    s.statistics.add(s.segmenter->stage_times(),
                     std::chrono::duration_cast<std::chrono::nanoseconds>(took).count(),
                     s.segmenter->counters(), outcome.estimate.model_generation);
  return true;
}

void post_message(GstBaseTransform* transform, ElementState& s, GstBuffer* buffer, const Estimate& estimate) {
  if (!s.settings.post_messages) {
    s.told.reset();
    return;
  }
  const Told news{estimate.traversable_permille, estimate.horizon_row, (estimate.flags & flag_blocked) != 0};
  if (s.told == news)
    return;
  s.told = news;
  const GstSegment& segment = transform->segment;
  const GstClockTime timestamp = GST_BUFFER_PTS(buffer);
  gst_element_post_message(
      GST_ELEMENT(transform),
      gst_message_new_element(
          GST_OBJECT(transform),
          gst_structure_new(
              GST_TERRAIN_SEG_MESSAGE, "timestamp", G_TYPE_UINT64, timestamp, "stream-time", G_TYPE_UINT64,
              gst_segment_to_stream_time(&segment, GST_FORMAT_TIME, timestamp), "running-time", G_TYPE_UINT64,
              gst_segment_to_running_time(&segment, GST_FORMAT_TIME, timestamp), "duration", G_TYPE_UINT64,
              GST_BUFFER_DURATION(buffer), "traversable-permille", G_TYPE_UINT,
              static_cast<guint>(news.traversable_permille), "horizon-row", G_TYPE_INT, news.horizon_row,
              "blocked", G_TYPE_BOOLEAN, static_cast<gboolean>(news.blocked), nullptr)));
}

/// Overrides GstBaseTransform and not GstVideoFilter, which would map for writing and so copy every frame
/// that somebody else holds too.
GstFlowReturn transform_ip(GstBaseTransform* transform, GstBuffer* buffer) {
  return guarded(transform, GST_FLOW_ERROR, [&] {
    ElementState& s = state_of(transform);
    refresh_settings(transform, s);
    if (s.settings.reset_on == ResetOn::discont && !s.fresh && GST_BUFFER_IS_DISCONT(buffer))
      forget(transform, "a discontinuity");
    s.fresh = false;
    if (const auto wrong = describe_unusable(s.info, buffer)) {
      GST_ELEMENT_ERROR(GST_ELEMENT(transform), STREAM, FORMAT,
                        ("A buffer does not hold a frame: %s.", wrong->c_str()),
                        ("buffer %" GST_PTR_FORMAT ": %s", printable(buffer), wrong->c_str()));
      return GST_FLOW_ERROR;
    }
    Outcome outcome;
    {
      const MappedFrame frame(s.info, buffer, s.settings.overlay ? GST_MAP_READWRITE : GST_MAP_READ);
      if (!frame) {
        GST_ELEMENT_ERROR(
            GST_ELEMENT(transform), RESOURCE, READ, ("A frame's memory cannot be accessed."),
            ("buffer %" GST_PTR_FORMAT " cannot be mapped as one piece a plane", printable(buffer)));
        return GST_FLOW_ERROR;
      }
      if (!label(transform, s, buffer, *frame, outcome))
        return GST_FLOW_ERROR;
    }
    if (!attach(buffer, outcome.estimate, outcome.mask.get(), outcome.boundary.get()))
      GST_WARNING_OBJECT(transform, "the metadata could not be attached");
    post_message(transform, s, buffer, outcome.estimate);
    return GST_FLOW_OK;
  });
}

void finalize(GObject* object) {
  delete self_of(object)->state;
  G_OBJECT_CLASS(gst_terrain_seg_parent_class)->finalize(object);
}

} // namespace

static void gst_terrain_seg_init(GstTerrainSeg* self) {
  self->state = new ElementState;
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
  object_class->finalize = finalize;
  SettingsBook::install(object_class);
  g_object_class_install_property(
      object_class, stats_id(),
      g_param_spec_boxed(
          "stats", "Statistics",
          "Counts of frames and of skipped updates by cause, and the median and 99th percentile of each "
          "stage in microseconds",
          GST_TYPE_STRUCTURE, static_cast<GParamFlags>(G_PARAM_READABLE | G_PARAM_STATIC_STRINGS)));

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
