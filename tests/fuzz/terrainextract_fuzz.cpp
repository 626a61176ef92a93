// SPDX-License-Identifier: LGPL-2.1-or-later
// Frames with metadata of any kind into terrainextract: raw and encoded video, outputs that change, gaps,
// flushes, segments, ends, stops, properties. What comes out keeps the promises of its format.
#include <cstring>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "exchange/vmti_klv.hpp"
#include "mavlink_frames.hpp"
#include "metadata_input.hpp"
#include "support/elements.hpp"

namespace {

using namespace terrainseg;
using namespace terrainseg::fuzz;

bool may_set(const GParamSpec* spec) {
  return std::strcmp(spec->name, "name") != 0 && std::strcmp(spec->name, "parent") != 0;
}

std::string bytes_of(GstBuffer* buffer) {
  std::string bytes(gst_buffer_get_size(buffer), '\0');
  gst_buffer_extract(buffer, 0, bytes.data(), bytes.size());
  return bytes;
}

std::span<const std::uint8_t> view_of(const std::string& bytes) {
  return {reinterpret_cast<const std::uint8_t*>(bytes.data()), bytes.size()};
}

/// A picture of that size, of values that a mask has.
void check_picture(GstBuffer* buffer, const GstCaps* caps) {
  GstVideoInfo info;
  require(gst_video_info_from_caps(&info, caps) && GST_VIDEO_INFO_FORMAT(&info) == GST_VIDEO_FORMAT_GRAY8);
  GstVideoFrame frame;
  require(gst_video_frame_map(&frame, &info, buffer, GST_MAP_READ));
  require(GST_VIDEO_FRAME_WIDTH(&frame) == GST_VIDEO_INFO_WIDTH(&info) &&
          GST_VIDEO_FRAME_HEIGHT(&frame) == GST_VIDEO_INFO_HEIGHT(&info));
  const int step = 1 + GST_VIDEO_FRAME_HEIGHT(&frame) / 256; // all rows but of large pictures
  for (int y = 0; y < GST_VIDEO_FRAME_HEIGHT(&frame); y += step) {
    const auto* row = static_cast<const std::uint8_t*>(GST_VIDEO_FRAME_PLANE_DATA(&frame, 0)) +
                      static_cast<std::ptrdiff_t>(y) * GST_VIDEO_FRAME_PLANE_STRIDE(&frame, 0);
    for (int x = 0; x < GST_VIDEO_FRAME_WIDTH(&frame); ++x)
      require(row[x] == mask_not_traversable || row[x] == mask_doubtful || row[x] == mask_traversable);
  }
  gst_video_frame_unmap(&frame);
}

/// One object on one line.
void check_line(const std::string& line) {
  require(!line.empty() && line.find('\n') == line.size() - 1);
  const nlohmann::json object = nlohmann::json::parse(line, nullptr, false);
  require(object.is_object() && object.contains("frame") && object.contains("boundary"));
}

/// A unit that is taken back.
void check_unit(const std::string& bytes) {
  require(!bytes.empty() && bytes.size() <= klv_unit_limit);
  static KlvUnit unit;
  require(unit.decode(view_of(bytes)) == KlvVerdict::ok);
  const Estimate& e = unit.estimate();
  require(flaw_of(e) == nullptr);
  std::vector<std::uint8_t> pixels(static_cast<std::size_t>(e.mask.width) *
                                   static_cast<std::size_t>(e.mask.height));
  unit.draw_mask({pixels.data(), e.mask.width});
}

/// Nothing that is empty is sent.
void check_sent(const std::string& bytes) {
  require(!bytes.empty());
  check_messages(view_of(bytes));
}

class Session {
 public:
  explicit Session(Input& in) : in_(in), element_(gst_element_factory_make("terrainextract", nullptr)) {
    require(element_ != nullptr);
    for (int i = in_.byte() % 4; i > 0; --i)
      set_property_from(in_, G_OBJECT(element_), may_set);
    harness_ = gst_harness_new_with_element(element_, "sink", "src");
    gst_object_unref(element_);
    if (in_.chance(2)) // strides of any kind are welcome
      gst_harness_add_propose_allocation_meta(harness_, GST_VIDEO_META_API_TYPE, nullptr);
    begin();
  }
  ~Session() {
    gst_element_set_state(element_, GST_STATE_NULL);
    gst_harness_teardown(harness_);
  }

  void step() {
    switch (in_.byte() % 20) {
    case 0:
      push_caps();
      break;
    case 1:
      choose_output();
      break;
    case 2:
    case 3:
      set_property_from(in_, G_OBJECT(element_), may_set);
      break;
    case 4:
      flush(harness_->srcpad, in_);
      break;
    case 5:
      gst_harness_push_event(harness_, segment_from(in_));
      break;
    case 6:
      gst_harness_push_event(harness_, gst_event_new_gap(in_.number(5), time_from(in_, 1)));
      break;
    case 7:
      push_event();
      break;
    case 8:
      push_upstream();
      break;
    case 9:
      if (in_.byte() % 4 == 1) {
        gst_element_set_state(element_, in_.byte() & 1 ? GST_STATE_READY : GST_STATE_NULL);
        gst_element_set_state(element_, GST_STATE_PLAYING);
        begin();
      }
      break;
    default:
      push_frame();
      break;
    }
    drain();
  }

 private:
  void begin() {
    gst_harness_push_event(harness_, gst_event_new_stream_start("video"));
    choose_output();
    if (in_.chance(16)) // frames before any caps
      return;
    push_caps();
    gst_harness_push_event(harness_, segment_from(in_));
  }

  void choose_output() {
    static constexpr const char* outputs[] = {
        "application/x-ndjson",
        "meta/x-klv,parsed=true",
        "application/x-mavlink",
        "video/x-raw,format=GRAY8",
        "video/x-raw,format=GRAY8,width=[1,40],height=[7,9]",
        "video/x-raw,format=GRAY8,width=33",
        "video/x-raw,format=GRAY8,height={2,500},pixel-aspect-ratio=1/1",
        "video/x-raw,format=GRAY8,width=16,height=900,pixel-aspect-ratio=[1/3,3/1],framerate=[1/1,60/1]",
        "ANY",
        "video/x-raw,format=I420;meta/x-klv",
        "video/x-raw,format=I420",
    };
    GstCaps* caps = gst_caps_from_string(outputs[in_.byte() % std::size(outputs)]);
    gst_harness_set_sink_caps(harness_, caps);
    gst_harness_push_upstream_event(harness_, gst_event_new_reconfigure());
  }

  /// Raw video mostly, so that its size is known; encoded video may say it, or not, or say what cannot be.
  void push_caps() {
    static constexpr const char* names[] = {"video/x-h264", "image/jpeg", "video/x-raw(memory:DMABuf)",
                                            "audio/x-raw", "video/x-h265"};
    static constexpr int sides[] = {1, 0, -1, 64, 32767, 32768, G_MAXINT, 7};
    static constexpr int heights[] = {1, 0, -1, 64, 700, 65, 2, 7};
    static constexpr int ratios[] = {1, 0, -1, 3, G_MAXINT, -G_MAXINT, 4, 65536};
    GstCaps* caps = nullptr;
    if (in_.byte() & 1) {
      caps = gst_caps_from_string(caps_from(in_).c_str());
    } else {
      caps = gst_caps_from_string(names[in_.byte() % std::size(names)]);
      const std::uint8_t what = in_.byte();
      const auto pick = [&](const auto& values) { return values[in_.byte() % std::size(values)]; };
      if (what & 1)
        gst_caps_set_simple(caps, "width", G_TYPE_INT, pick(sides), nullptr);
      if (what & 2) // no picture of 32767 x 32767
        gst_caps_set_simple(caps, "height", G_TYPE_INT, pick(what & 1 ? heights : sides), nullptr);
      for (const auto& [bit, name] : {std::pair(4, "framerate"), std::pair(8, "pixel-aspect-ratio")})
        if (what & bit) {
          const int over = pick(ratios), under = pick(ratios);
          gst_caps_set_simple(caps, name, GST_TYPE_FRACTION, over, under == 0 ? 1 : under, nullptr);
        }
    }
    const GstStructure* fields = gst_caps_get_structure(caps, 0);
    if (!gst_structure_get_int(fields, "width", &width_) ||
        !gst_structure_get_int(fields, "height", &height_))
      width_ = height_ = 0;
    gst_harness_push_event(harness_, gst_event_new_caps(caps));
    gst_caps_unref(caps);
  }

  void push_event() {
    switch (in_.byte() % 6) {
    case 0:
      gst_harness_push_event(harness_, gst_event_new_eos());
      break;
    case 1: {
      GstTagList* tags = gst_tag_list_new(GST_TAG_TITLE, "x", nullptr);
      gst_tag_list_set_scope(tags, in_.byte() & 1 ? GST_TAG_SCOPE_GLOBAL : GST_TAG_SCOPE_STREAM);
      gst_harness_push_event(harness_, gst_event_new_tag(tags));
      break;
    }
    case 2:
      gst_harness_push_event(harness_, gst_event_new_flush_start()); // frames while it flushes
      push_frame();
      flush(harness_->srcpad, in_);
      break;
    case 3: {
      GstEvent* start = gst_event_new_stream_start("other");
      if (in_.byte() & 1)
        gst_event_set_group_id(start, 1u + in_.byte());
      gst_harness_push_event(harness_, start);
      break;
    }
    default:
      gst_harness_push_event(harness_,
                             gst_event_new_custom(in_.byte() & 1 ? GST_EVENT_CUSTOM_DOWNSTREAM
                                                                 : GST_EVENT_CUSTOM_DOWNSTREAM_STICKY,
                                                  gst_structure_new_empty("terrainseg-pose")));
      break;
    }
  }

  void push_upstream() {
    GstEvent* event = nullptr;
    switch (in_.byte() % 4) {
    case 0:
      event = gst_event_new_qos(GST_QOS_TYPE_UNDERFLOW, 2, in_.byte(), in_.number(5));
      break;
    case 1:
      event = gst_event_new_reconfigure();
      break;
    case 2:
      event = gst_event_new_latency(in_.number(2));
      break;
    default:
      event = gst_event_new_seek(1, GST_FORMAT_TIME, GST_SEEK_FLAG_FLUSH, GST_SEEK_TYPE_SET,
                                 static_cast<gint64>(in_.number(5)), GST_SEEK_TYPE_NONE, 0);
      break;
    }
    gst_harness_push_upstream_event(harness_, event);
    gst_harness_query_latency(harness_);
  }

  void push_frame() {
    GstBuffer* frame = gst_buffer_new_allocate(nullptr, in_.byte(), nullptr);
    const bool sized =
        width_ >= 1 && width_ <= longest_picture_side && height_ >= 1 && height_ <= longest_picture_side;
    metadata_.attach_to(frame, in_, frames_, sized ? width_ : 0, sized ? height_ : 0);
    set_times(frame, in_, frames_);
    if (in_.chance(8))
      GST_BUFFER_FLAG_SET(frame, GST_BUFFER_FLAG_DISCONT);
    ++frames_;
    const GstClockTime pts = GST_BUFFER_PTS(frame), duration = GST_BUFFER_DURATION(frame);
    gst_harness_push(harness_, frame);
    GstBuffer* const unit = gst_harness_try_pull(harness_);
    if (!unit)
      return;
    require(GST_BUFFER_PTS(unit) == pts && GST_BUFFER_DURATION(unit) == duration);
    check(unit);
    gst_buffer_unref(unit);
  }

  void check(GstBuffer* unit) {
    GstCaps* caps = gst_pad_get_current_caps(harness_->sinkpad);
    require(caps != nullptr);
    const GstStructure* fields = gst_caps_get_structure(caps, 0);
    if (gst_structure_has_name(fields, "video/x-raw"))
      check_picture(unit, caps);
    else if (gst_structure_has_name(fields, "application/x-ndjson"))
      check_line(bytes_of(unit));
    else if (gst_structure_has_name(fields, "meta/x-klv"))
      check_unit(bytes_of(unit));
    else
      check_sent(bytes_of(unit));
    gst_caps_unref(caps);
  }

  void drain() {
    require(gst_harness_try_pull(harness_) == nullptr); // one frame, one unit
    drain_events(harness_);
  }

  Input& in_;
  GstElement* element_;
  GstHarness* harness_ = nullptr;
  EstimateInput metadata_;
  int width_ = 0, height_ = 0;
  guint64 frames_ = 0;
};

} // namespace

extern "C" int LLVMFuzzerInitialize(int*, char***) {
  start_gstreamer();
  require(GST_ELEMENT_REGISTER(terrainextract, nullptr));
  return 0;
}

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  return play<Session>(data, size, 32);
}
