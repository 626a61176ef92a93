// SPDX-License-Identifier: LGPL-2.1-or-later
// Video and KLV units into terraincombine in any order and at any times: whole, mutated and foreign units,
// gaps, flushes, segments, ends, caps, relinking, queries. One thread feeds both pads, so that a hang is a
// finding.
#include <vector>

#include "element_input.hpp"
#include "exchange/vmti_klv.hpp"
#include "klv_sums.hpp"
#include "metadata_input.hpp"
#include "support/elements.hpp"
#include "support/estimate_meta.hpp"
#include "support/times.hpp"

namespace {

using namespace terrainseg;
using namespace terrainseg::fuzz;

class Session {
 public:
  explicit Session(Input& in) : in_(in), element_(gst_element_factory_make("terraincombine", nullptr)) {
    require(element_ != nullptr);
    g_object_set(element_, "latency", in_.byte() % 4 * 3u, nullptr);
    video_ = gst_harness_new_with_element(element_, "sink", "src");
    meta_ = gst_harness_new_with_element(element_, "meta", nullptr);
    gst_object_unref(element_);
    src_ = gst_element_get_static_pad(element_, "src");
    peer_ = gst_pad_get_peer(src_);
    const bool live = in_.byte() & 1;
    gst_harness_set_live(video_, live);
    gst_harness_set_live(meta_, live);
    gst_harness_set_src_caps_str(meta_, "meta/x-klv,parsed=true");
    set_caps();
  }
  ~Session() {
    GstStructure* stats = nullptr;
    g_object_get(element_, "stats", &stats, nullptr);
    guint64 matched = 0, precisely = 0, lost = 0, rejected = 0;
    require(gst_structure_get_uint64(stats, "matched", &matched) &&
            gst_structure_get_uint64(stats, "matched-precisely", &precisely) &&
            gst_structure_get_uint64(stats, "lost", &lost) &&
            gst_structure_get_uint64(stats, "rejected", &rejected));
    gst_structure_free(stats);
    require(matched + lost <= frames_ && matched <= units_ && precisely <= matched && rejected <= units_);
    if (!gst_pad_is_linked(src_))
      gst_pad_link(src_, peer_);
    // The task asks both harnesses for their latency: it has ended before either goes.
    gst_element_set_state(element_, GST_STATE_NULL);
    gst_harness_teardown(video_);
    gst_harness_teardown(meta_);
    gst_object_unref(src_);
    gst_object_unref(peer_);
  }

  void step() {
    switch (in_.byte() % 20) {
    case 0:
      set_caps();
      break;
    case 1:
      gst_harness_push_event(video_, segment_from(in_));
      break;
    case 2:
      gst_harness_push_event(meta_, segment_from(in_));
      break;
    case 3:
      flush((in_.byte() & 1 ? video_ : meta_)->srcpad, in_);
      break;
    case 4:
      gap(video_);
      break;
    case 5:
      gap(meta_);
      break;
    case 6:
      gst_harness_push_event(meta_, gst_event_new_eos());
      break;
    case 7:
      gst_harness_push_event(in_.byte() & 1 ? video_ : meta_, gst_event_new_stream_start("x"));
      break;
    case 8:
      relink();
      break;
    case 9:
      ask();
      break;
    case 10:
      g_object_set(element_, "latency", in_.byte() % 16u, "match", in_.byte() % 8 == 1 ? 1 : 0, nullptr);
      break;
    case 11:
    case 12:
    case 13:
    case 14:
      push_unit();
      break;
    default:
      push_frame();
      break;
    }
    drain();
  }

 private:
  void set_caps() {
    GstCaps* caps = gst_caps_from_string(caps_from(in_).c_str());
    require(gst_video_info_from_caps(&info_, caps));
    gst_harness_set_src_caps(video_, caps);
  }
  void gap(GstHarness* h) {
    gst_harness_push_event(h,
                           gst_event_new_gap(std::min<GstClockTime>(time_from(in_, now()), G_MAXUINT64 - 1),
                                             time_from(in_, 33 * GST_MSECOND)));
  }
  void relink() {
    if (gst_pad_is_linked(src_))
      gst_pad_unlink(src_, peer_);
    else
      gst_pad_link(src_, peer_);
  }
  void ask() {
    GstPad* sink = gst_element_get_static_pad(element_, "sink");
    GstCaps* caps = gst_pad_get_current_caps(sink);
    GstQuery* query =
        in_.byte() & 1 || !caps ? gst_query_new_latency() : gst_query_new_allocation(caps, TRUE);
    if (GST_QUERY_TYPE(query) == GST_QUERY_LATENCY)
      gst_pad_query(src_, query);
    else
      gst_pad_query(sink, query);
    gst_query_unref(query);
    gst_clear_caps(&caps);
    gst_object_unref(sink);
    gst_harness_push_upstream_event(video_, gst_event_new_latency(in_.number(2)));
  }
  GstClockTime now() const { return frames_ * 33 * GST_MSECOND; }

  void push_frame() {
    GstBuffer* frame = gst_buffer_new_allocate(nullptr, GST_VIDEO_INFO_SIZE(&info_), nullptr);
    GST_BUFFER_PTS(frame) = time_from(in_, now());
    GST_BUFFER_DURATION(frame) = time_from(in_, 33 * GST_MSECOND);
    if (in_.chance(3))
      note_stamp(frame, VideoCodec::h264, in_.chance(4) ? in_.number(8) : now() / 1000);
    ++frames_;
    gst_harness_push(video_, frame);
  }

  /// A unit of the encoder with a mask of any size, some bytes of it changed and its sums put right.
  std::vector<std::uint8_t> unit() {
    const Estimate e = estimates_.masked(in_, frames_);
    const std::uint64_t time = in_.chance(4) ? in_.number(8) : now() / 1000;
    static const UasPlatform platform = {90, UasAttitude{-5, 2}, UasPosition{52.5, 13.4, 34}};
    const auto bytes = encoder_.encode(e, time, in_.chance(3) ? &platform : nullptr);
    std::vector<std::uint8_t> out(bytes.begin(), bytes.end());
    for (int i = in_.byte() % 8 < 4 ? 0 : in_.byte() % 6; i > 0; --i)
      out[in_.number(2) % out.size()] = in_.byte();
    if (!in_.chance(8))
      put_sums(out);
    if (in_.chance(16))
      out.resize(out.size() / 2);
    if (in_.chance(16))
      out.resize(out.size() + in_.number(2));
    return out;
  }

  void push_unit() {
    const std::vector<std::uint8_t> bytes = in_.chance(8) ? std::vector<std::uint8_t>(in_.byte()) : unit();
    GstBuffer* buffer = gst_buffer_new_allocate(nullptr, bytes.size(), nullptr);
    gst_buffer_fill(buffer, 0, bytes.data(), bytes.size());
    GST_BUFFER_PTS(buffer) = time_from(in_, now());
    GST_BUFFER_DTS(buffer) = in_.chance(4) ? time_from(in_, now()) : GST_CLOCK_TIME_NONE;
    ++units_;
    gst_harness_push(meta_, buffer);
  }

  void drain() {
    while (GstBuffer* out = gst_harness_try_pull(video_)) {
      const EstimateReader reader(out);
      require(reader.error() == nullptr);
      gst_buffer_unref(out);
    }
    drain_events(video_);
    drain_events(meta_);
  }

  Input& in_;
  GstElement* element_;
  GstHarness *video_ = nullptr, *meta_ = nullptr;
  GstPad *src_ = nullptr, *peer_ = nullptr;
  GstVideoInfo info_;
  KlvEncoder encoder_;
  EstimateInput estimates_;
  guint64 frames_ = 0, units_ = 0;
};

} // namespace

extern "C" int LLVMFuzzerInitialize(int*, char***) {
  start_gstreamer();
  require(GST_ELEMENT_REGISTER(terraincombine, nullptr));
  return 0;
}

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  return play<Session>(data, size, 40);
}
