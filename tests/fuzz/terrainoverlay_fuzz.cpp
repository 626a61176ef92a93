// SPDX-License-Identifier: LGPL-2.1-or-later
// Frames of all formats, strides and sizes with metadata of any kind into terrainoverlay, in every style,
// with properties, caps, flushes and segments between them. It draws inside of the picture and nowhere else,
// and on frames without metadata not at all.
#include <cstring>
#include <vector>

#include "metadata_input.hpp"
#include "support/elements.hpp"

namespace {

using namespace terrainseg;
using namespace terrainseg::fuzz;

bool may_set(const GParamSpec* spec) {
  return std::strcmp(spec->name, "qos") != 0 && std::strcmp(spec->name, "name") != 0 &&
         std::strcmp(spec->name, "parent") != 0;
}

using Bytes = std::vector<std::uint8_t>;

Bytes bytes_of(GstBuffer* buffer) {
  Bytes bytes(gst_buffer_get_size(buffer));
  gst_buffer_extract(buffer, 0, bytes.data(), bytes.size());
  return bytes;
}

/// Where a plane of a frame lies in its buffer.
struct Plane {
  gsize offset = 0;
  gint stride = 0;
  int rows = 0;
  gsize row_bytes = 0; ///< that hold pixels
};

/// The planes of a frame of `info` as its buffer has them.
std::vector<Plane> planes_of(GstBuffer* buffer, const GstVideoInfo& info) {
  const GstVideoMeta* meta = gst_buffer_get_video_meta(buffer);
  std::vector<Plane> planes(GST_VIDEO_INFO_N_PLANES(&info));
  for (guint p = 0; p < planes.size(); ++p) {
    planes[p].offset = meta ? meta->offset[p] : GST_VIDEO_INFO_PLANE_OFFSET(&info, p);
    planes[p].stride = meta ? meta->stride[p] : GST_VIDEO_INFO_PLANE_STRIDE(&info, p);
  }
  for (guint c = 0; c < GST_VIDEO_INFO_N_COMPONENTS(&info); ++c) {
    Plane& plane = planes[GST_VIDEO_INFO_COMP_PLANE(&info, c)];
    plane.rows = std::max(plane.rows, GST_VIDEO_INFO_COMP_HEIGHT(&info, c));
    plane.row_bytes =
        std::max(plane.row_bytes, static_cast<gsize>(GST_VIDEO_INFO_COMP_WIDTH(&info, c)) *
                                      static_cast<gsize>(GST_VIDEO_INFO_COMP_PSTRIDE(&info, c)));
  }
  return planes;
}

/// What may change is made equal: the bytes of pixels.
void take_pixels(Bytes& before, const Bytes& after, const std::vector<Plane>& planes) {
  for (const Plane& plane : planes)
    for (int y = 0; y < plane.rows; ++y) {
      const gsize at = plane.offset + static_cast<gsize>(y) * static_cast<gsize>(plane.stride);
      if (at >= before.size())
        break;
      std::memcpy(before.data() + at, after.data() + at, std::min(plane.row_bytes, before.size() - at));
    }
}

class Session {
 public:
  explicit Session(Input& in) : in_(in), element_(gst_element_factory_make("terrainoverlay", nullptr)) {
    require(element_ != nullptr);
    for (int i = in_.byte() % 4; i > 0; --i)
      set_property_from(in_, G_OBJECT(element_), may_set);
    choose_style();
    harness_ = gst_harness_new_with_element(element_, "sink", "src");
    gst_object_unref(element_);
    begin("video");
  }
  ~Session() {
    gst_element_set_state(element_, GST_STATE_NULL);
    gst_harness_teardown(harness_);
  }

  void step() {
    switch (in_.byte() % 16) {
    case 0:
      set_caps();
      break;
    case 1:
      set_property_from(in_, G_OBJECT(element_), may_set);
      break;
    case 2:
      choose_style();
      break;
    case 3:
      flush(harness_->srcpad, in_);
      break;
    case 4:
      gst_harness_push_event(harness_, segment_from(in_));
      break;
    case 5:
      gst_harness_push_event(harness_, gst_event_new_gap(in_.number(5), time_from(in_, 1)));
      break;
    case 6:
      if (in_.chance(4))
        gst_harness_push_event(harness_, gst_event_new_eos());
      else
        gst_harness_push_event(harness_, gst_event_new_stream_start("x"));
      break;
    case 7:
      if (in_.chance(4)) {
        gst_element_set_state(element_, in_.byte() & 1 ? GST_STATE_READY : GST_STATE_NULL);
        gst_element_set_state(element_, GST_STATE_PLAYING);
        begin("again");
      }
      break;
    default:
      push_frame();
      break;
    }
    drain();
  }

 private:
  void begin(const char* stream) {
    gst_harness_push_event(harness_, gst_event_new_stream_start(stream));
    set_caps();
    gst_harness_push_event(harness_, segment_from(in_));
  }
  void set_caps() {
    GstCaps* caps = gst_caps_from_string(caps_from(in_).c_str());
    gst_harness_push_event(harness_, gst_event_new_caps(caps));
    gst_caps_unref(caps);
    caps = gst_pad_get_current_caps(harness_->srcpad); // still those before, after an end
    require(caps != nullptr && gst_video_info_from_caps(&info_, caps));
    gst_caps_unref(caps);
  }
  void choose_style() {
    static constexpr const char* styles[] = {"tint", "contour", "mask", "models", "map"};
    gst_util_set_object_arg(G_OBJECT(element_), "overlay-style", styles[in_.byte() % std::size(styles)]);
  }

  void push_frame() {
    GstBuffer* frame = frame_from(in_, info_);
    const GstVideoMeta* meta = gst_buffer_get_video_meta(frame);
    // A meta that lies says where there is nothing: what it is believed of is the sanitizer's to see.
    const bool honest = !meta || (meta->width == static_cast<guint>(GST_VIDEO_INFO_WIDTH(&info_)) &&
                                  meta->height == static_cast<guint>(GST_VIDEO_INFO_HEIGHT(&info_)));
    if (!in_.chance(8))
      metadata_.attach_to(frame, in_, frames_, GST_VIDEO_INFO_WIDTH(&info_), GST_VIDEO_INFO_HEIGHT(&info_));
    set_times(frame, in_, frames_);
    GST_BUFFER_FLAG_SET(frame, in_.chance(8) ? GST_BUFFER_FLAG_GAP : 0U);
    ++frames_;
    gchar* source = nullptr;
    g_object_get(element_, "source", &source, nullptr);
    const bool drawn = static_cast<bool>(EstimateReader(frame, source ? source : ""));
    g_free(source);
    Bytes before = bytes_of(frame);
    const std::vector<Plane> planes = planes_of(frame, info_);
    GstBuffer* held = in_.chance(8) ? gst_buffer_ref(frame) : nullptr; // somebody else reads it, too
    gst_harness_push(harness_, frame);
    if (held)
      require(bytes_of(held) == before);
    gst_clear_buffer(&held);
    GstBuffer* const out = gst_harness_try_pull(harness_);
    if (!out)
      return;
    const Bytes after = bytes_of(out);
    require(after.size() == before.size());
    if (drawn && honest)
      take_pixels(before, after, planes);
    require(after == before || (drawn && !honest));
    gst_buffer_unref(out);
  }

  void drain() {
    while (GstBuffer* out = gst_harness_try_pull(harness_))
      gst_buffer_unref(out);
    drain_events(harness_);
  }

  Input& in_;
  GstElement* element_;
  GstHarness* harness_ = nullptr;
  GstVideoInfo info_;
  EstimateInput metadata_;
  guint64 frames_ = 0;
};

} // namespace

extern "C" int LLVMFuzzerInitialize(int*, char***) {
  start_gstreamer();
  require(GST_ELEMENT_REGISTER(terrainoverlay, nullptr));
  return 0;
}

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  return play<Session>(data, size, 24);
}
