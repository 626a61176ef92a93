// SPDX-License-Identifier: LGPL-2.1-or-later

#include <gst/base/gstbasetransform.h>

#include <atomic>
#include <optional>
#include <span>
#include <utility>

#include "exchange/precision_stamp.hpp"
#include "support/buffers.hpp"
#include "support/element.hpp"
#include "support/times.hpp"
#include "support/warnings.hpp"

GST_DEBUG_CATEGORY_STATIC(terrainstamp_debug);
#define GST_CAT_DEFAULT terrainstamp_debug

using namespace terrainseg;

namespace {

enum class StampMode : std::uint8_t { write, read };

struct StampSettings {
  std::atomic<StampMode> mode = StampMode::write;
};

constexpr Choice modes[] = {
    {"write", "Write the time into pictures without a stamp"},
    {"read",
     "Only read stamps, for the decoder to pass on; the stamp of a picture directly after a gap is ignored"},
};
const Property<StampSettings> stamp_table[] = {
    {"mode", "Mode", "Write the time (after an encoder) or read it (before a decoder)", property_playing,
     field<&StampSettings::mode>("GstTerrainStampMode", modes)},
};

/// Everything behind the instance.
struct StampState {
  GstBaseTransform* element = nullptr;
  StampSettings settings; // any thread
  NalFraming framing;     // streaming
  bool first = true;      // streaming; nothing has passed since the start or a flush
  Once<> formless;        // streaming; a buffer without a slice
  Once<> timeless;        // streaming
};

/**
 * SECTION:element-terrainstamp
 * @title: terrainstamp
 * @short_description: the precision time of each picture in H.264 and H.265
 *
 * Writes the precision time stamp of MISB ST 0604 into encoded video: the time that #GstTerrainExtract writes
 * into the KLV unit of the same frame. At the other end #GstTerrainCombine finds the frame of a unit by it,
 * to the microsecond, wherever demuxers and RTP receivers shift the time stamps of the two streams. Pictures
 * that carry a stamp keep it.
 *
 * In front of a decoder, with `mode=read`, it attaches the stamp to what the decoder takes, which hands it on
 * to its frames. `h264parse` does so by itself; `h265parse` of GStreamer 1.22 does not, and on links that
 * lose packets a parser may take a stamp for the wrong picture.
 *
 * ## Example launch line
 * |[
 * gst-launch-1.0 terrainscenesrc num-buffers=60 ! terrainseg ! tee name=t
 * t. ! queue ! x264enc tune=zerolatency ! h264parse ! terrainstamp ! mux.
 * t. ! queue ! terrainextract ! meta/x-klv,parsed=true ! mux. mpegtsmux name=mux ! filesink location=drive.ts
 * ]|
 *
 * Since: 0.1
 */
using GstTerrainStamp = Instance<GstBaseTransform, StampState>;
using GstTerrainStampClass = GstBaseTransformClass;

G_DEFINE_TYPE(GstTerrainStamp, gst_terrain_stamp, GST_TYPE_BASE_TRANSFORM)

bool start(StampState& s) {
  s.first = true;
  s.formless.again();
  s.timeless.again();
  return true;
}

/// The codec_data of the caps; nullptr when there is none.
GstBuffer* codec_data_of(const GstStructure* fields) {
  const GValue* value = gst_structure_get_value(fields, "codec_data");
  return value && GST_VALUE_HOLDS_BUFFER(value) ? gst_value_get_buffer(value) : nullptr;
}

/// How many bytes the lengths in front of NAL units have; nothing when the caps do not tell.
std::optional<unsigned> length_bytes_of(const GstStructure* fields, VideoCodec codec) {
  if (g_strcmp0(gst_structure_get_string(fields, "stream-format"), "byte-stream") == 0)
    return 0;
  const MappedBuffer map(codec_data_of(fields), GST_MAP_READ);
  return map ? nal_length_bytes(codec, {map.data(), map.size()}) : std::nullopt;
}

bool set_caps(StampState& s, GstCaps* caps, GstCaps*) {
  const GstStructure* fields = gst_caps_get_structure(caps, 0);
  const VideoCodec codec =
      gst_structure_has_name(fields, "video/x-h265") ? VideoCodec::h265 : VideoCodec::h264;
  const auto length_bytes = length_bytes_of(fields, codec);
  if (!length_bytes) {
    GST_ELEMENT_ERROR(s.element, STREAM, FORMAT,
                      ("%s: put h264parse or h265parse before terrainstamp.",
                       codec_data_of(fields)
                           ? "The codec_data in the video's caps does not give the size of NAL length fields"
                           : "The video's caps lack the codec_data that its stream-format needs"),
                      ("caps %" GST_PTR_FORMAT, printable(caps)));
    return false;
  }
  s.framing = {codec, *length_bytes};
  return true;
}

gboolean sink_event(StampState& s, GstEvent* event) {
  if (GST_EVENT_TYPE(event) == GST_EVENT_FLUSH_STOP)
    s.first = true;
  return GST_BASE_TRANSFORM_CLASS(gst_terrain_stamp_parent_class)->sink_event(s.element, event);
}

/// A buffer with the stamp at its place, which shares the memory of `in`.
OwnedBuffer with_stamp(GstBuffer* in, std::span<const std::uint8_t> stamp, std::size_t place) {
  OwnedBuffer out(gst_buffer_new());
  const OwnedBuffer unit = copy_of(stamp);
  if (!unit)
    return nullptr;
  constexpr auto whole = static_cast<gsize>(-1);
  if (!gst_buffer_copy_into(out.get(), in, GST_BUFFER_COPY_METADATA, 0, whole) ||
      (place > 0 && !gst_buffer_copy_into(out.get(), in, GST_BUFFER_COPY_MEMORY, 0, place)))
    return nullptr;
  gst_buffer_append_memory(out.get(), gst_buffer_get_all_memory(unit.get()));
  if (!gst_buffer_copy_into(out.get(), in, GST_BUFFER_COPY_MEMORY, place, whole))
    return nullptr;
  return out;
}

/// Once: where the stamps would go is not to be found.
void warn_formless(StampState& s, GstBuffer* in) {
  GST_WARNING_OBJECT(s.element, "no slice in %" GST_PTR_FORMAT, printable(in));
  if (!s.formless.first())
    return;
  GST_ELEMENT_WARNING(s.element, STREAM, FORMAT,
                      ("A buffer without a complete picture was passed through without a stamp: add a parser "
                       "before terrainstamp, or check the link for packet loss."),
                      ("no slice in %" GST_PTR_FORMAT, printable(in)));
}

/// Once: there is no time to be written.
void warn_timeless(StampState& s, GstBuffer* in) {
  if (!s.timeless.first())
    return;
  GST_ELEMENT_WARNING(
      s.element, STREAM, FORMAT,
      ("A picture without a time stamp was passed through without a precision time stamp: add an element "
       "that sets time stamps (a parser that knows the frame rate, or appsrc with do-timestamp=true)."),
      ("neither PTS nor time of day in %" GST_PTR_FORMAT, printable(in)));
}

/// The picture with its stamp in the bytes and beside them.
OwnedBuffer write_stamp(StampState& s, GstBuffer* in, const StampSearch& found) {
  if (!found.place)
    warn_formless(s, in);
  if (!found.place || found.several || (found.time_us && stamp_of(in)))
    return nullptr;
  const auto time_us = found.time_us ? found.time_us : precision_time(in, s.element->segment);
  if (!time_us) {
    warn_timeless(s, in);
    return nullptr;
  }
  OwnedBuffer out = found.time_us
                        ? OwnedBuffer(gst_buffer_make_writable(gst_buffer_ref(in)))
                        : with_stamp(in, stamp_unit(s.framing, *time_us, found.temporal), *found.place);
  if (out && !stamp_of(out.get()))
    note_stamp(out.get(), s.framing.codec, *time_us);
  return out;
}

/// The picture with the stamp of its bytes beside them, and no other.
OwnedBuffer read_stamp(StampState& s, GstBuffer* in, const StampSearch& found, bool trusted) {
  const bool stamped = trusted && found.place && found.time_us;
  const auto noted = stamp_of(in);
  if (stamped ? noted == found.time_us : !noted)
    return nullptr;
  OwnedBuffer out(gst_buffer_make_writable(gst_buffer_ref(in)));
  forget_stamps(out.get());
  if (stamped)
    note_stamp(out.get(), s.framing.codec, *found.time_us);
  return out;
}

/// What leaves for `in`: itself where nothing changes.
GstFlowReturn stamped(StampState& s, GstBuffer* in, GstBuffer** out) {
  // Behind a gap a parser may have joined the beginning of a lost picture, its stamp, with another one's
  // slices.
  const bool trusted = std::exchange(s.first, false) || !GST_BUFFER_IS_DISCONT(in);
  StampSearch found;
  {
    const MappedBuffer map(in, GST_MAP_READ);
    if (!map) {
      GST_ELEMENT_ERROR(s.element, RESOURCE, READ, ("The memory of a buffer cannot be read."), (nullptr));
      return GST_FLOW_ERROR;
    }
    found = find_stamp({map.data(), map.size()}, s.framing);
  }
  OwnedBuffer changed =
      s.settings.mode == StampMode::read ? read_stamp(s, in, found, trusted) : write_stamp(s, in, found);
  GST_LOG_OBJECT(s.element, "%s: %" GST_PTR_FORMAT, changed ? "stamped" : "as it was", printable(in));
  *out = changed ? changed.release() : in;
  return GST_FLOW_OK;
}

void gst_terrain_stamp_init(GstTerrainStamp* self) {
  gst_base_transform_set_gap_aware(self->make_state().element, TRUE);
}

void gst_terrain_stamp_class_init(GstTerrainStampClass* klass) {
  GST_DEBUG_CATEGORY_INIT(terrainstamp_debug, "terrainstamp", 0,
                          "The precision time of pictures in H.264 and H.265");
  init_class<GstTerrainStamp, gst_terrain_stamp_parent_class, stamp_table>(
      klass, {"Terrain stamp", "Codec/Metadata/Video",
              "Writes and reads the precision time of each picture in H.264 and H.265"});
  for (const auto& [name, direction] : {std::pair{"sink", GST_PAD_SINK}, {"src", GST_PAD_SRC}})
    add_pad_template(
        klass, name, direction,
        "video/x-h264, stream-format = (string) { byte-stream, avc, avc3 }, alignment = (string) au; "
        "video/x-h265, stream-format = (string) { byte-stream, hvc1, hev1 }, alignment = (string) au");
  auto* transform_class = GST_BASE_TRANSFORM_CLASS(klass);
  transform_class->start = GstTerrainStamp::call<start>;
  transform_class->set_caps = GstTerrainStamp::call<set_caps>;
  transform_class->sink_event = GstTerrainStamp::call<sink_event>;
  transform_class->prepare_output_buffer = GstTerrainStamp::call<stamped>;
  transform_class->transform = [](GstBaseTransform*, GstBuffer*, GstBuffer*) { return GST_FLOW_OK; };
}

} // namespace

GST_ELEMENT_REGISTER_DEFINE(terrainstamp, "terrainstamp", GST_RANK_NONE, gst_terrain_stamp_get_type())
