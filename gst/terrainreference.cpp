// SPDX-License-Identifier: LGPL-2.1-or-later
#include "terrainreference.hpp"

#include <gst/video/video.h>

#include <algorithm>
#include <memory>
#include <stdexcept>
#include <vector>

#include "buffer_pool.hpp"
#include "estimate_meta.hpp"
#include "guarded.hpp"
#include "overlay_properties.hpp"
#include "reference/reference_engine.hpp"
#include "reference/reference_estimate.hpp"
#include "terrainseg/settings.hpp"
#include "training_meta.hpp"
#include "video_frame.hpp"

GST_DEBUG_CATEGORY_STATIC(terrainreference_debug);
#define GST_CAT_DEFAULT terrainreference_debug

namespace terrainseg {
namespace {

using reference::ReferenceEngine;
using reference::ReferenceResult;
using reference::ReferenceSettings;

struct ConverterFree {
  void operator()(GstVideoConverter* converter) const { gst_video_converter_free(converter); }
};
struct ElementSettings {
  ReferenceSettings engine;
  bool near_clear = true;
  bool overlay = false;
  OverlaySettings overlay_settings;
};

} // namespace

/// Everything behind the instance. "object lock": the GstObject's, held for copies only. "streaming": touched
/// by the streaming thread alone, or while there is none.
struct ReferenceState {
  ElementSettings settings;  // object lock
  bool reset_wanted = false; // object lock

  std::unique_ptr<ReferenceEngine> engine;                  // streaming
  GstVideoInfo info;                                        // streaming
  std::unique_ptr<GstVideoConverter, ConverterFree> to_bgr; // streaming
  GstVideoInfo bgr_info;                                    // streaming
  OwnedBuffer bgr;                                          // streaming; the frame as B G R
  TrainingReader training;                                  // streaming
  cv::Mat training_mask, training_scaled;                   // streaming
  std::vector<std::uint16_t> boundary;                      // streaming
  MaskPool masks;                                           // streaming
  SmallPool boundaries;                                     // streaming
  std::uint64_t frame = 0;                                  // streaming
  std::uint32_t generation = 0;                             // streaming
  bool warned_training = false;                             // streaming
};

} // namespace terrainseg

using namespace terrainseg;

struct GstTerrainReference {
  GstBaseTransform parent;
  ReferenceState* state;
};
struct GstTerrainReferenceClass {
  GstBaseTransformClass parent_class;
};

G_DEFINE_TYPE(GstTerrainReference, gst_terrain_reference, GST_TYPE_BASE_TRANSFORM)
GST_ELEMENT_REGISTER_DEFINE(terrainreference, "terrainreference", GST_RANK_NONE,
                            gst_terrain_reference_get_type())

namespace {

ReferenceState& state_of(gpointer object) {
  return *reinterpret_cast<GstTerrainReference*>(object)->state;
}

// ---- properties ------------------------------------------------------------------------------------------

enum Property : guint {
  property_none,
  property_window_width,
  property_window_height,
  property_window_bottom,
  property_window_x,
  property_window_sigma,
  property_training_models,
  property_learned_models,
  property_match_threshold,
  property_mass_cap,
  property_mass_share,
  property_threshold,
  property_variance_floor,
  property_dilations,
  property_erosions,
  property_connected,
  property_seed,
  property_learning,
  property_near_clear,
  property_overlay,
  property_overlay_first, // the properties of overlay_properties.hpp
};

void set_property(GObject* object, guint id, const GValue* value, GParamSpec* spec) {
  GST_OBJECT_LOCK(object);
  ElementSettings& settings = state_of(object).settings;
  ReferenceSettings& engine = settings.engine;
  switch (id) {
  case property_window_width:
    engine.window.width = g_value_get_int(value);
    break;
  case property_window_height:
    engine.window.height = g_value_get_int(value);
    break;
  case property_window_bottom:
    engine.window.bottom = g_value_get_int(value);
    break;
  case property_window_x:
    engine.window.x = g_value_get_int(value);
    break;
  case property_window_sigma:
    engine.window_sigma = g_value_get_double(value);
    break;
  case property_training_models:
    engine.training_models = g_value_get_int(value);
    break;
  case property_learned_models:
    engine.learned_models = g_value_get_int(value);
    break;
  case property_match_threshold:
    engine.match_threshold = g_value_get_double(value);
    break;
  case property_mass_cap:
    engine.mass_cap = g_value_get_int(value);
    break;
  case property_mass_share:
    engine.mass_share = g_value_get_double(value);
    break;
  case property_threshold:
    engine.threshold = g_value_get_double(value);
    break;
  case property_variance_floor:
    engine.variance_floor = g_value_get_double(value);
    break;
  case property_dilations:
    engine.dilations = g_value_get_int(value);
    break;
  case property_erosions:
    engine.erosions = g_value_get_int(value);
    break;
  case property_connected:
    engine.connected = g_value_get_boolean(value);
    break;
  case property_seed:
    engine.seed = g_value_get_uint(value);
    break;
  case property_learning:
    engine.learning = g_value_get_boolean(value);
    break;
  case property_near_clear:
    settings.near_clear = g_value_get_boolean(value);
    break;
  case property_overlay:
    settings.overlay = g_value_get_boolean(value);
    break;
  default:
    if (id < property_overlay_first || id >= property_overlay_first + overlay_property_count)
      G_OBJECT_WARN_INVALID_PROPERTY_ID(object, id, spec);
    else
      set_overlay_property(settings.overlay_settings, id - property_overlay_first, value);
  }
  GST_OBJECT_UNLOCK(object);
}

void get_property(GObject* object, guint id, GValue* value, GParamSpec* spec) {
  GST_OBJECT_LOCK(object);
  const ElementSettings& settings = state_of(object).settings;
  const ReferenceSettings& engine = settings.engine;
  switch (id) {
  case property_window_width:
    g_value_set_int(value, engine.window.width);
    break;
  case property_window_height:
    g_value_set_int(value, engine.window.height);
    break;
  case property_window_bottom:
    g_value_set_int(value, engine.window.bottom);
    break;
  case property_window_x:
    g_value_set_int(value, engine.window.x);
    break;
  case property_window_sigma:
    g_value_set_double(value, engine.window_sigma);
    break;
  case property_training_models:
    g_value_set_int(value, engine.training_models);
    break;
  case property_learned_models:
    g_value_set_int(value, engine.learned_models);
    break;
  case property_match_threshold:
    g_value_set_double(value, engine.match_threshold);
    break;
  case property_mass_cap:
    g_value_set_int(value, static_cast<int>(engine.mass_cap));
    break;
  case property_mass_share:
    g_value_set_double(value, engine.mass_share);
    break;
  case property_threshold:
    g_value_set_double(value, engine.threshold);
    break;
  case property_variance_floor:
    g_value_set_double(value, engine.variance_floor);
    break;
  case property_dilations:
    g_value_set_int(value, engine.dilations);
    break;
  case property_erosions:
    g_value_set_int(value, engine.erosions);
    break;
  case property_connected:
    g_value_set_boolean(value, engine.connected);
    break;
  case property_seed:
    g_value_set_uint(value, engine.seed);
    break;
  case property_learning:
    g_value_set_boolean(value, engine.learning);
    break;
  case property_near_clear:
    g_value_set_boolean(value, settings.near_clear);
    break;
  case property_overlay:
    g_value_set_boolean(value, settings.overlay);
    break;
  default:
    if (id < property_overlay_first || id >= property_overlay_first + overlay_property_count)
      G_OBJECT_WARN_INVALID_PROPERTY_ID(object, id, spec);
    else
      get_overlay_property(settings.overlay_settings, id - property_overlay_first, value);
  }
  GST_OBJECT_UNLOCK(object);
}

void install_properties(GObjectClass* object_class) {
  constexpr auto live = static_cast<GParamFlags>(G_PARAM_READWRITE | G_PARAM_STATIC_STRINGS |
                                                 GST_PARAM_CONTROLLABLE | GST_PARAM_MUTABLE_PLAYING);
  const ReferenceSettings d;
  const auto whole = [&](Property id, const char* name, const char* nick, const char* blurb, int low,
                         int high, int value) {
    g_object_class_install_property(object_class, id,
                                    g_param_spec_int(name, nick, blurb, low, high, value, live));
  };
  const auto real = [&](Property id, const char* name, const char* nick, const char* blurb, double low,
                        double high, double value) {
    g_object_class_install_property(object_class, id,
                                    g_param_spec_double(name, nick, blurb, low, high, value, live));
  };
  const auto flag = [&](Property id, const char* name, const char* nick, const char* blurb, bool value) {
    g_object_class_install_property(object_class, id, g_param_spec_boolean(name, nick, blurb, value, live));
  };
  constexpr int side = 32767;
  whole(
      property_window_width, "window-width", "Window width",
      "Width of the training window in pixels; 0 = the largest power of two not above a fifth of the frame's",
      0, side, d.window.width);
  whole(property_window_height, "window-height", "Window height",
        "Height of the training window in pixels; 0 = half the width of the rule for window-width", 0, side,
        d.window.height);
  whole(property_window_bottom, "window-bottom", "Window bottom",
        "Rows between the training window and the bottom edge, in pixels: lifts it off a bonnet in view", 0,
        side, d.window.bottom);
  whole(property_window_x, "window-x", "Window x", "Left edge of the training window in pixels; -1 = centred",
        -1, side, d.window.x);
  real(property_window_sigma, "window-sigma", "Window sigma",
       "Keeps the window's pixels within this many standard deviations of its mean; 0 = all of them", 0, 4,
       d.window_sigma);
  whole(property_training_models, "training-models", "Training models",
        "Clusters of a frame's training pixels (k); must be below learned-models", 1, max_models,
        d.training_models);
  whole(property_learned_models, "learned-models", "Learned models",
        "Gaussians that remember the terrain (n); must be above training-models", 1, max_models,
        d.learned_models);
  real(property_match_threshold, "match-threshold", "Match threshold",
       "Squared distance, in units of the summed covariances, up to which a cluster updates a learned model",
       0, 16, d.match_threshold);
  whole(property_mass_cap, "mass-cap", "Mass cap",
        "Limit of a model's mass, in frames of training pixels: a smaller one forgets faster", 1, 1 << 20,
        static_cast<int>(d.mass_cap));
  real(property_mass_share, "mass-share", "Mass share",
       "Only models with at least this share of the heaviest model's mass label pixels", 0, 1, d.mass_share);
  real(property_threshold, "threshold", "Threshold",
       "Mahalanobis distance in standard deviations up to which a pixel is terrain", 0, 16, d.threshold);
  real(property_variance_floor, "variance-floor", "Variance floor",
       "Added to every model's variances, in squared 8-bit steps: keeps a model of one colour invertible",
       1e-3, 1e4, d.variance_floor);
  whole(property_dilations, "dilations", "Dilations", "Dilations of the mask by a square of 3x3 pixels", 0,
        16, d.dilations);
  whole(property_erosions, "erosions", "Erosions",
        "Erosions of the mask by a square of 3x3 pixels, after the dilations", 0, 16, d.erosions);
  flag(property_connected, "connected", "Connected",
       "Keeps only terrain that is connected to the training pixels", d.connected);
  g_object_class_install_property(
      object_class, property_seed,
      g_param_spec_uint("seed", "Seed", "Seed of the random cluster centres: the same seed, the same masks",
                        0, G_MAXUINT32, d.seed, live));
  flag(property_learning, "learning", "Learning", "false: frames are labelled, nothing is learned",
       d.learning);
  flag(property_near_clear, "near-clear", "Near clear",
       "The proximity sensor: false = the window may hold an obstacle, nothing is learned", true);
  flag(property_overlay, "overlay", "Overlay", "Draws what was found onto the frame", false);
  install_overlay_properties(object_class, property_overlay_first);
}

// ---- start, caps, events ---------------------------------------------------------------------------------

gboolean start(GstBaseTransform* transform) {
  return guarded<gboolean>(transform, FALSE, [&]() -> gboolean {
    ReferenceState& s = state_of(transform);
    GST_OBJECT_LOCK(transform);
    const ReferenceSettings settings = s.settings.engine;
    s.reset_wanted = false;
    GST_OBJECT_UNLOCK(transform);
    try {
      s.engine = std::make_unique<ReferenceEngine>(settings);
    } catch (const std::invalid_argument& error) {
      GST_ELEMENT_ERROR(transform, LIBRARY, SETTINGS, ("%s", error.what()), ("settings refused at start"));
      return FALSE;
    }
    s.frame = 0;
    s.generation = 0;
    s.warned_training = false;
    return TRUE;
  });
}

gboolean stop(GstBaseTransform* transform) {
  ReferenceState& s = state_of(transform);
  s.engine.reset();
  s.to_bgr.reset();
  s.bgr.reset();
  s.masks.drop();
  s.boundaries.drop();
  return TRUE;
}

gboolean set_caps(GstBaseTransform* transform, GstCaps* caps, GstCaps*) {
  return guarded<gboolean>(transform, FALSE, [&]() -> gboolean {
    ReferenceState& s = state_of(transform);
    if (!gst_video_info_from_caps(&s.info, caps)) {
      GST_ELEMENT_ERROR(transform, STREAM, FORMAT, ("The video format cannot be understood."),
                        ("caps %" GST_PTR_FORMAT, static_cast<void*>(caps)));
      return FALSE;
    }
    if (GST_VIDEO_INFO_IS_INTERLACED(&s.info)) {
      GST_ELEMENT_ERROR(
          transform, STREAM, WRONG_TYPE,
          ("terrainreference takes progressive video only: put \"deinterlace\" in front of it."),
          ("caps %" GST_PTR_FORMAT, static_cast<void*>(caps)));
      return FALSE;
    }
    gst_video_info_set_format(&s.bgr_info, GST_VIDEO_FORMAT_BGR, static_cast<guint>(s.info.width),
                              static_cast<guint>(s.info.height));
    s.bgr_info.fps_n = s.info.fps_n; // the converter refuses to change the rate
    s.bgr_info.fps_d = s.info.fps_d;
    s.to_bgr.reset(gst_video_converter_new(&s.info, &s.bgr_info, nullptr));
    s.bgr.reset(gst_buffer_new_allocate(nullptr, s.bgr_info.size, nullptr));
    if (!s.to_bgr || !s.bgr) {
      GST_ELEMENT_ERROR(transform, STREAM, FORMAT, ("The video cannot be converted to BGR."),
                        ("caps %" GST_PTR_FORMAT, static_cast<void*>(caps)));
      return FALSE;
    }
    return TRUE;
  });
}

gboolean sink_event(GstBaseTransform* transform, GstEvent* event) {
  if (GST_EVENT_TYPE(event) == GST_EVENT_STREAM_START) {
    GST_OBJECT_LOCK(transform);
    state_of(transform).reset_wanted = true;
    GST_OBJECT_UNLOCK(transform);
  }
  return GST_BASE_TRANSFORM_CLASS(gst_terrain_reference_parent_class)->sink_event(transform, event);
}

// ---- frames ----------------------------------------------------------------------------------------------

/// The training pixels that upstream attached, as a mask of the frame's size; empty when there are none.
const cv::Mat& training_pixels(gpointer object, GstBuffer* buffer) {
  static const cv::Mat none;
  ReferenceState& s = state_of(object);
  const int width = s.info.width, height = s.info.height;
  const Supervision supervision = s.training.read(buffer, width, height);
  if (const char* error = s.training.error(); error && !s.warned_training) {
    s.warned_training = true;
    GST_ELEMENT_WARNING(GST_ELEMENT(object), STREAM, FORMAT, ("Training pixels are ignored: %s.", error),
                        ("said once a run"));
  }
  if (supervision.empty())
    return none;
  s.training_mask.create(height, width, CV_8UC1);
  s.training_mask.setTo(0);
  if (!supervision.mask.empty()) {
    const GrayView& view = supervision.mask;
    // Nearest neighbour by hand: a mask may be of any size, and rows and columns are few.
    for (int y = 0; y < height; ++y) {
      const std::uint8_t* from = view.plane.row(y * view.height / height);
      auto* to = s.training_mask.ptr<std::uint8_t>(y);
      for (int x = 0; x < width; ++x)
        to[x] = from[x * view.width / width];
    }
  }
  for (const Rectangle& r : supervision.rectangles)
    s.training_mask(cv::Rect(r.x, r.y, r.width, r.height)).setTo(255);
  s.training.release();
  return s.training_mask;
}

const ReferenceResult& look(gpointer object, GstBuffer* buffer, const GstVideoFrame& frame) {
  ReferenceState& s = state_of(object);
  const MappedFrame bgr(s.bgr_info, s.bgr.get(), GST_MAP_READWRITE);
  GstVideoFrame target = *bgr; // the converter wants a frame of its own to note its state in
  gst_video_converter_frame(s.to_bgr.get(), &frame, &target);
  const cv::Mat picture(s.info.height, s.info.width, CV_8UC3, GST_VIDEO_FRAME_PLANE_DATA(&*bgr, 0),
                        static_cast<std::size_t>(GST_VIDEO_FRAME_PLANE_STRIDE(&*bgr, 0)));
  return s.engine->process(picture, training_pixels(object, buffer));
}

struct Buffers {
  OwnedBuffer mask, boundary;
};

/// Mask and boundary in buffers that can travel; empty when there is no memory.
Buffers buffers_of(ReferenceState& s, const Estimate& estimate) {
  const GrayView& mask = estimate.mask;
  Buffers made{s.masks.acquire(mask.width, mask.height), s.boundaries.acquire(2 * estimate.boundary.size())};
  GstMapInfo map;
  if (!made.mask || !made.boundary || !gst_buffer_map(made.mask.get(), &map, GST_MAP_WRITE))
    return {};
  for (int y = 0; y < mask.height; ++y)
    std::copy_n(mask.plane.row(y), mask.width,
                map.data + static_cast<std::size_t>(y) * static_cast<std::size_t>(mask.width));
  gst_buffer_unmap(made.mask.get(), &map);
  if (!gst_buffer_map(made.boundary.get(), &map, GST_MAP_WRITE))
    return {};
  for (std::size_t x = 0; x < estimate.boundary.size(); ++x)
    GST_WRITE_UINT16_LE(map.data + 2 * x, estimate.boundary[x]);
  gst_buffer_unmap(made.boundary.get(), &map);
  return made;
}

/// Takes the settings and forgets what a new stream must not know.
void prepare(gpointer object, ReferenceState& s, ElementSettings& settings) {
  GST_OBJECT_LOCK(object);
  settings = s.settings;
  const bool reset = s.reset_wanted;
  s.reset_wanted = false;
  GST_OBJECT_UNLOCK(object);
  if (reset) {
    s.engine->reset();
    s.generation = 0;
  }
  settings.engine.learning &= settings.near_clear;
  s.engine->configure(settings.engine);
}

void before_transform(GstBaseTransform* transform, GstBuffer* buffer) {
  const GstClockTime stream_time =
      gst_segment_to_stream_time(&transform->segment, GST_FORMAT_TIME, GST_BUFFER_PTS(buffer));
  if (GST_CLOCK_TIME_IS_VALID(stream_time))
    gst_object_sync_values(GST_OBJECT(transform), stream_time);
}

GstFlowReturn transform_ip(GstBaseTransform* transform, GstBuffer* buffer) {
  if (GST_BUFFER_FLAG_IS_SET(buffer, GST_BUFFER_FLAG_GAP))
    return GST_FLOW_OK;
  return guarded(transform, GST_FLOW_ERROR, [&] {
    ReferenceState& s = state_of(transform);
    ElementSettings settings;
    prepare(transform, s, settings);
    if (const auto wrong = describe_unusable(s.info, buffer)) {
      GST_ELEMENT_ERROR(transform, STREAM, FORMAT, ("A buffer does not hold a frame: %s.", wrong->c_str()),
                        ("%s", wrong->c_str()));
      return GST_FLOW_ERROR;
    }
    Estimate estimate;
    Buffers buffers;
    {
      const MappedFrame frame(s.info, buffer, settings.overlay ? GST_MAP_READWRITE : GST_MAP_READ);
      if (!frame) {
        GST_ELEMENT_ERROR(transform, RESOURCE, READ, ("A frame's memory cannot be accessed."),
                          ("it cannot be mapped as one piece a plane"));
        return GST_FLOW_ERROR;
      }
      const ReferenceResult& result = look(transform, buffer, *frame);
      s.generation += result.learned;
      estimate = reference::describe(result, s.frame++, s.generation, Settings{}.blocked_below, s.boundary);
      if (!settings.engine.learning)
        estimate.flags |= flag_frozen;
      buffers = buffers_of(s, estimate);
      if (!buffers.mask) {
        GST_ELEMENT_ERROR(transform, RESOURCE, NO_SPACE_LEFT, ("There is no memory for a mask."), (nullptr));
        return GST_FLOW_ERROR;
      }
      if (settings.overlay)
        paint(mutable_view_of(*frame), estimate, settings.overlay_settings.paint());
    }
    if (!attach(buffer, estimate, buffers.mask.get(), buffers.boundary.get()))
      GST_WARNING_OBJECT(transform, "the metadata could not be attached");
    return GST_FLOW_OK;
  });
}

void finalize(GObject* object) {
  delete reinterpret_cast<GstTerrainReference*>(object)->state;
  G_OBJECT_CLASS(gst_terrain_reference_parent_class)->finalize(object);
}

} // namespace

static void gst_terrain_reference_init(GstTerrainReference* self) {
  self->state = new ReferenceState();
  gst_video_info_init(&self->state->info);
  gst_video_info_init(&self->state->bgr_info);
  auto* transform = GST_BASE_TRANSFORM(self);
  gst_base_transform_set_in_place(transform, TRUE);
  gst_base_transform_set_qos_enabled(transform, FALSE); // a dropped frame would not be learned from
}

static void gst_terrain_reference_class_init(GstTerrainReferenceClass* klass) {
  auto* object_class = G_OBJECT_CLASS(klass);
  auto* element_class = GST_ELEMENT_CLASS(klass);
  auto* transform_class = GST_BASE_TRANSFORM_CLASS(klass);
  object_class->set_property = set_property;
  object_class->get_property = get_property;
  object_class->finalize = finalize;
  install_properties(object_class);
  add_video_pad_templates(element_class);
  gst_element_class_set_static_metadata(element_class, "Terrain learning, unmodified algorithm",
                                        "Filter/Analyzer/Video",
                                        "Labels traversable ground as Dahlkamp et al. 2006 did: full "
                                        "resolution, full covariances, floating point",
                                        "The terrainseg developers");
  transform_class->start = start;
  transform_class->stop = stop;
  transform_class->set_caps = set_caps;
  transform_class->sink_event = sink_event;
  transform_class->before_transform = before_transform;
  transform_class->transform_ip = transform_ip;
  GST_DEBUG_CATEGORY_INIT(terrainreference_debug, "terrainreference", 0, "unmodified terrain learning");
}
