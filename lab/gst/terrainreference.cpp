// SPDX-License-Identifier: LGPL-2.1-or-later
#include "lab/gst/terrainreference.hpp"

#include <gst/video/video.h>

#include <algorithm>
#include <iterator>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "lab/reference/reference_engine.hpp"
#include "lab/reference/reference_estimate.hpp"
#include "support/buffers.hpp"
#include "support/colour_watch.hpp"
#include "support/element.hpp"
#include "support/estimate_meta.hpp"
#include "support/overlay_properties.hpp"
#include "support/pixel_metas.hpp"
#include "support/transform.hpp"
#include "support/video_frame.hpp"
#include "support/warnings.hpp"
#include "terrainseg/settings.hpp"

GST_DEBUG_CATEGORY_STATIC(terrainreference_debug);
#define GST_CAT_DEFAULT terrainreference_debug

namespace terrainseg {
namespace {

using reference::ReferenceEngine;
using reference::ReferenceResult;
using reference::ReferenceSettings;
using reference::WindowPlace;

struct ConverterFree {
  void operator()(GstVideoConverter* converter) const { gst_video_converter_free(converter); }
};
struct ElementSettings {
  ReferenceSettings engine;
  bool near_clear = true;
  bool overlay = false;
  OverlaySettings drawing;
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
  Once<> training_flaw, interlaced;                         // streaming
  Once<WindowRequest> misfit;                               // streaming
  ColourWatch colours;                                      // streaming
  ReferenceSettings in_force;                               // streaming; the last that were accepted
  std::string refused;                                      // streaming; why later ones are not

  ReferenceState() noexcept {
    gst_video_info_init(&info);
    gst_video_info_init(&bgr_info);
  }
};

} // namespace terrainseg

using namespace terrainseg;

/**
 * SECTION:element-terrainreference
 * @title: terrainreference
 * @short_description: the unmodified algorithm, to compare with
 *
 * Labels traversable ground as Dahlkamp et al. 2006 did: full resolution, full covariances, floating point.
 *
 * ## Example launch line
 * |[
 * gst-launch-1.0 terrainscenesrc num-buffers=20 ! terrainreference overlay=true ! videoconvert !
 * autovideosink
 * ]|
 *
 * Since: 0.1
 */
using GstTerrainReference = Instance<GstBaseTransform, ReferenceState>;
using GstTerrainReferenceClass = GstBaseTransformClass;

G_DEFINE_TYPE(GstTerrainReference, gst_terrain_reference, GST_TYPE_BASE_TRANSFORM)
GST_ELEMENT_REGISTER_DEFINE(terrainreference, "terrainreference", GST_RANK_NONE,
                            gst_terrain_reference_get_type())

namespace {

ReferenceState& state_of(gpointer object) {
  return *reinterpret_cast<GstTerrainReference*>(object)->state;
}

// ---- properties ------------------------------------------------------------------------------------------

#define FIELD(NAME) field<&ElementSettings::engine, &ReferenceSettings::NAME>
#define WINDOW_FIELD(NAME) field<&ElementSettings::engine, &ReferenceSettings::window, &WindowPlace::NAME>

constexpr int side = 32767;
constexpr auto drawing = overlay_rows<&ElementSettings::drawing>();
const Property<ElementSettings> table[] = {
    {"window-width", "Window width",
     "Width of the training window in pixels, 0 = the largest power of two up to a fifth of the frame width",
     property_controllable, WINDOW_FIELD(width)(0, side)},
    {"window-height", "Window height",
     "Height of the training window in pixels, 0 = half the width that window-width=0 gives",
     property_controllable, WINDOW_FIELD(height)(0, side)},
    {"window-bottom", "Window bottom",
     "Distance in pixels from the bottom edge of the frame to the training window; raise it when a bonnet is "
     "in view",
     property_controllable, WINDOW_FIELD(bottom)(0, side)},
    {"window-x", "Window x", "Left edge of the training window in pixels; -1 = centred",
     property_controllable, WINDOW_FIELD(x)(-1, side)},
    {"window-sigma", "Window sigma",
     "Exclude window pixels that are more than this many standard deviations from the window's mean, 0 = "
     "none",
     property_controllable, FIELD(window_sigma)(0, 4)},
    {"training-models", "Training models",
     "Number K of clusters of a frame's training pixels; must be less than learned-models",
     property_controllable, FIELD(training_models)(1, max_models)},
    {"learned-models", "Learned models",
     "Number N of Gaussians that are kept; must be greater than training-models", property_controllable,
     FIELD(learned_models)(1, max_models)},
    {"match-threshold", "Match threshold",
     "Largest squared distance, in summed covariances, at which a cluster updates a learned model",
     property_controllable, FIELD(match_threshold)(0, 16)},
    {"mass-cap", "Mass cap",
     "Largest mass of a model, in frames of training pixels; lower values adapt faster",
     property_controllable, FIELD(mass_cap)(1, 1 << 20)},
    {"mass-share", "Mass share",
     "Smallest mass of a model that is used for labelling, as a share of the largest mass",
     property_controllable, FIELD(mass_share)(0, 1)},
    {"threshold", "Threshold",
     "Largest Mahalanobis distance in standard deviations at which a pixel is terrain", property_controllable,
     FIELD(threshold)(0, 16)},
    {"variance-floor", "Variance floor",
     "Value added to the variances of every model, in squared 8-bit steps, so that a model of one colour can "
     "be inverted",
     property_controllable, FIELD(variance_floor)(1e-3, 1e4)},
    {"dilations", "Dilations", "Number of dilations of the mask by a square of 3x3 pixels",
     property_controllable, FIELD(dilations)(0, 16)},
    {"erosions", "Erosions", "Number of erosions of the mask by a square of 3x3 pixels, after the dilations",
     property_controllable, FIELD(erosions)(0, 16)},
    {"connected", "Connected", "Keep only terrain that is connected to the training pixels",
     property_controllable, FIELD(connected)()},
    {"seed", "Seed", "Seed of the random cluster centres; the same seed gives the same masks",
     property_controllable, FIELD(seed)(0, G_MAXUINT32)},
    {"learning", "Learning", "Learn from frames; false freezes the learned terrain", property_controllable,
     FIELD(learning)()},
    {"near-clear", "Near clear",
     "Set to false while a near-range sensor reports an obstacle in the training window; learning pauses",
     property_controllable, field<&ElementSettings::near_clear>()},
    {"overlay", "Overlay", "Draw the result onto the frame", property_controllable,
     field<&ElementSettings::overlay>()},
    drawing[0],
    drawing[1],
    drawing[2],
};
#undef FIELD
#undef WINDOW_FIELD
// ---- start, caps, events ---------------------------------------------------------------------------------

gboolean start(GstBaseTransform* transform) {
  return guarded<gboolean>(transform, FALSE, [&]() -> gboolean {
    ReferenceState& s = state_of(transform);
    ReferenceSettings settings;
    {
      ObjectLock lock(transform);
      settings = s.settings.engine;
      s.reset_wanted = false;
    }
    try {
      s.engine = std::make_unique<ReferenceEngine>(settings);
    } catch (const std::invalid_argument& error) {
      GST_ELEMENT_ERROR(transform, LIBRARY, SETTINGS, ("%s", error.what()), ("settings refused at start"));
      return FALSE;
    }
    s.frame = 0;
    s.generation = 0;
    s.training_flaw.again();
    s.interlaced.again();
    s.misfit.again();
    s.colours = {};
    s.in_force = settings;
    s.refused.clear();
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
      GST_ELEMENT_ERROR(transform, STREAM, FORMAT, ("Unsupported video format."),
                        ("caps %" GST_PTR_FORMAT, printable(caps)));
      return FALSE;
    }
    if (!may_be_progressive(s.info)) {
      const std::string mode = gst_video_interlace_mode_to_string(GST_VIDEO_INFO_INTERLACE_MODE(&s.info));
      if (s.interlaced.first()) // upstream tries this again and again
        report_interlaced(transform, ("interlace-mode=" + mode).c_str());
      return FALSE;
    }
    gst_video_info_set_format(&s.bgr_info, GST_VIDEO_FORMAT_BGR, static_cast<guint>(s.info.width),
                              static_cast<guint>(s.info.height));
    s.bgr_info.fps_n = s.info.fps_n; // the converter refuses to change the rate
    s.bgr_info.fps_d = s.info.fps_d;
    GstVideoInfo frames = s.info;
    frames.interlace_mode = GST_VIDEO_INTERLACE_MODE_PROGRESSIVE; // of mixed ones those that are
    s.to_bgr.reset(gst_video_converter_new(&frames, &s.bgr_info, nullptr));
    s.bgr.reset(gst_buffer_new_allocate(nullptr, s.bgr_info.size, nullptr));
    if (!s.to_bgr || !s.bgr) {
      GST_ELEMENT_ERROR(transform, STREAM, FORMAT, ("The video cannot be converted to BGR."),
                        ("caps %" GST_PTR_FORMAT, printable(caps)));
      return FALSE;
    }
    GST_DEBUG_OBJECT(transform, "caps %" GST_PTR_FORMAT, printable(caps));
    return TRUE;
  });
}

gboolean sink_event(GstBaseTransform* transform, GstEvent* event) {
  if (GST_EVENT_TYPE(event) == GST_EVENT_STREAM_START) {
    ObjectLock lock(transform);
    state_of(transform).reset_wanted = true;
  }
  return GST_BASE_TRANSFORM_CLASS(gst_terrain_reference_parent_class)->sink_event(transform, event);
}

gboolean src_event(GstBaseTransform* transform, GstEvent* event) {
  if (stops_qos(transform, event)) {
    gst_event_unref(event);
    return TRUE;
  }
  return GST_BASE_TRANSFORM_CLASS(gst_terrain_reference_parent_class)->src_event(transform, event);
}

// ---- frames ----------------------------------------------------------------------------------------------

/// The training pixels that upstream attached, as a mask of the frame's size; empty when there are none.
const cv::Mat& training_pixels(gpointer object, GstBuffer* buffer) {
  static const cv::Mat none;
  ReferenceState& s = state_of(object);
  const int width = s.info.width, height = s.info.height;
  const Supervision supervision = s.training.read(buffer, width, height);
  if (const char* error = s.training.error(); error && s.training_flaw.first()) {
    GST_ELEMENT_WARNING(GST_ELEMENT(object), STREAM, FORMAT, ("Invalid training pixels, ignored: %s.", error),
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

const ReferenceResult& look(gpointer object, GstBuffer* buffer, const MappedFrame& frame) {
  ReferenceState& s = state_of(object);
  const MappedFrame bgr(s.bgr_info, s.bgr.get(), GST_MAP_READWRITE);
  GstVideoFrame target = bgr.frame(); // the converter wants a frame of its own to note its state in
  gst_video_converter_frame(s.to_bgr.get(), &frame.frame(), &target);
  const cv::Mat picture(s.info.height, s.info.width, CV_8UC3, GST_VIDEO_FRAME_PLANE_DATA(&target, 0),
                        static_cast<std::size_t>(GST_VIDEO_FRAME_PLANE_STRIDE(&target, 0)));
  return s.engine->process(picture, training_pixels(object, buffer));
}

struct Buffers {
  OwnedBuffer mask, boundary;
};

/// Mask and boundary in buffers that can travel; empty when there is no memory.
Buffers buffers_of(ReferenceState& s, const Estimate& estimate) {
  const GrayView& mask = estimate.mask;
  const auto rows = estimate.boundary;
  Buffers made{s.masks.acquire(mask.width, mask.height),
               filled(s.boundaries.acquire(rows.size_bytes()), rows)};
  GstMapInfo map;
  if (!made.mask || !made.boundary || !gst_buffer_map(made.mask.get(), &map, GST_MAP_WRITE))
    return {};
  for (int y = 0; y < mask.height; ++y)
    std::copy_n(mask.plane.row(y), mask.width,
                map.data + static_cast<std::size_t>(y) * static_cast<std::size_t>(mask.width));
  gst_buffer_unmap(made.mask.get(), &map);
  return made;
}

/// Gives the engine `wanted`, or where they contradict each other those that were in force, with a warning.
void configure(gpointer object, ReferenceState& s, const ReferenceSettings& wanted) {
  std::string refused;
  try {
    s.engine->configure(wanted);
    s.in_force = wanted;
  } catch (const std::invalid_argument& error) {
    refused = error.what();
    s.in_force.learning = wanted.learning; // of the frame
    s.engine->configure(s.in_force);
  }
  if (std::exchange(s.refused, refused) != refused && !refused.empty())
    GST_ELEMENT_WARNING(GST_ELEMENT(object), LIBRARY, SETTINGS,
                        ("%s. The previous values are kept.", refused.c_str()),
                        ("settings refused while playing"));
}

/// Moves and cuts a window that does not fit the frame; says so once for each window and frame size.
void fit_window(gpointer object, ReferenceState& s, WindowPlace& window) {
  const WindowRequest request{window.width, window.height, window.bottom,
                              window.x,     s.info.width,  s.info.height};
  Settings wanted;
  wanted.window_width = window.width;
  wanted.window_height = window.height;
  wanted.window_bottom = window.bottom;
  wanted.window_x = window.x;
  wanted.power_of_two_window = window.power_of_two_window;
  const Settings fitted = with_fitting_window(wanted, s.info.width, s.info.height);
  if (fitted == wanted)
    return;
  window.width = fitted.window_width;
  window.height = fitted.window_height;
  window.bottom = fitted.window_bottom;
  window.x = fitted.window_x;
  if (s.misfit.first(request))
    TERRAINSEG_POST_WARNING(GST_ELEMENT(object), LIBRARY, SETTINGS, window_warning(request, fitted, ""));
}

/// Takes the settings and forgets what a new stream must not know.
void prepare(GstBaseTransform* object, ReferenceState& s, GstBuffer* buffer, ElementSettings& settings) {
  bool reset = false;
  {
    ObjectLock lock(object);
    settings = s.settings;
    reset = std::exchange(s.reset_wanted, false);
  }
  if (reset) {
    s.engine->reset();
    s.generation = 0;
  }
  fit_window(object, s, settings.engine.window);
  settings.engine.learning &= settings.near_clear && is_learnable(object->segment, buffer);
  configure(object, s, settings.engine);
}

GstFlowReturn transform_ip(GstBaseTransform* transform, GstBuffer* buffer) {
  if (GST_BUFFER_FLAG_IS_SET(buffer, GST_BUFFER_FLAG_GAP | GST_BUFFER_FLAG_CORRUPTED))
    return GST_FLOW_OK;
  GST_TRACE_OBJECT(transform, "in: %" GST_PTR_FORMAT, printable(buffer));
  return guarded(transform, GST_FLOW_ERROR, [&] {
    ReferenceState& s = state_of(transform);
    ElementSettings settings;
    prepare(transform, s, buffer, settings);
    if (!is_progressive(s.info, buffer)) {
      report_interlaced(transform, "interlace-mode=mixed, and this buffer holds two fields");
      return GST_FLOW_ERROR;
    }
    Estimate estimate;
    Buffers buffers;
    {
      const MappedFrame frame(s.info, buffer, settings.overlay ? GST_MAP_READWRITE : GST_MAP_READ);
      if (!frame) {
        report_unusable(transform, buffer, frame);
        return GST_FLOW_ERROR;
      }
      if (s.colours.see(frame.frame()))
        TERRAINSEG_POST_WARNING(transform, STREAM, FORMAT, colourless_warning(s.info));
      const ReferenceResult& result = look(transform, buffer, frame);
      s.generation += result.learned;
      estimate = reference::describe(result, s.frame++, s.generation, Settings{}.blocked_below, s.boundary);
      if (!settings.engine.learning)
        estimate.flags |= flag_frozen;
      buffers = buffers_of(s, estimate);
      if (!buffers.mask) {
        GST_ELEMENT_ERROR(transform, RESOURCE, NO_SPACE_LEFT, ("Out of memory for the mask."), (nullptr));
        return GST_FLOW_ERROR;
      }
      GST_LOG_OBJECT(transform,
                     "frame %" G_GUINT64_FORMAT ": flags %#x, generation %u, %zu models, %s, traversable %d "
                     "permille",
                     estimate.frame, estimate.flags, s.generation, result.models.size(),
                     result.learned   ? "learned"
                     : result.starved ? "too few training pixels"
                                      : "not learned",
                     estimate.traversable_permille);
      if (settings.overlay)
        paint(frame.mutable_view(), estimate, settings.drawing.paint());
    }
    if (!attach(buffer, estimate, buffers.mask.get(), buffers.boundary.get()))
      GST_WARNING_OBJECT(transform, "the metadata could not be attached");
    return GST_FLOW_OK;
  });
}

} // namespace

static void gst_terrain_reference_init(GstTerrainReference* self) {
  self->state.make();
  auto* transform = GST_BASE_TRANSFORM(self);
  gst_base_transform_set_in_place(transform, TRUE);
  gst_base_transform_set_qos_enabled(transform, FALSE); // a dropped frame would not be learned from
}

static void gst_terrain_reference_class_init(GstTerrainReferenceClass* klass) {
  init_class<GstTerrainReference, gst_terrain_reference_parent_class, table>(
      klass, {"Terrain learning, unmodified algorithm", "Filter/Analyzer/Video",
              "Labels traversable ground as Dahlkamp et al. 2006 did: full resolution, full covariances, "
              "floating point"});
  add_video_pad_templates(GST_ELEMENT_CLASS(klass));
  auto* transform_class = GST_BASE_TRANSFORM_CLASS(klass);
  transform_class->start = start;
  transform_class->stop = stop;
  transform_class->set_caps = set_caps;
  transform_class->propose_allocation = propose_video_allocation<gst_terrain_reference_parent_class>;
  transform_class->sink_event = sink_event;
  transform_class->src_event = src_event;
  transform_class->before_transform = sync_controlled;
  transform_class->transform_ip = transform_ip;
  GST_DEBUG_CATEGORY_INIT(terrainreference_debug, "terrainreference", 0, "unmodified terrain learning");
}
