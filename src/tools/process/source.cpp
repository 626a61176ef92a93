// SPDX-License-Identifier: LGPL-2.1-or-later
#include "tools/process/source.hpp"

#include <gst/app/gstappsrc.h>
#include <gst/base/gsttypefindhelper.h>
#include <gst/video/video.h>

#include <algorithm>
#include <cstring>
#include <iterator>
#include <span>

#include "exchange/counted.hpp"
#include "tools/process/handles.hpp"

namespace terrainseg::process {
namespace {

/// Number of consecutive reads after the end of the file from which on a demuxer is taken to be in an endless
/// loop. Others read there once or twice.
constexpr std::uint64_t often = 1000;

/// The element of a pad, inside of bins; null when there is none.
ElementPointer element_of(PadPointer pad) {
  while (pad && GST_IS_GHOST_PAD(pad.get()))
    pad.reset(gst_ghost_pad_get_target(GST_GHOST_PAD(pad.get())));
  return ElementPointer(pad ? gst_pad_get_parent_element(pad.get()) : nullptr);
}

/// The element before one; null when there is none.
ElementPointer element_before(GstElement* element) {
  const PadPointer sink = pad_of(element, "sink");
  return element_of(PadPointer(sink ? gst_pad_get_peer(sink.get()) : nullptr));
}

/// The decoder upstream of a pad; null when there is none.
ElementPointer decoder_of(GstPad* pad) {
  ElementPointer element = element_of(PadPointer(GST_PAD(gst_object_ref(pad))));
  while (element && !gst_element_factory_list_is_type(gst_element_get_factory(element.get()),
                                                      GST_ELEMENT_FACTORY_TYPE_DECODER))
    element = element_before(element.get());
  return element;
}

/// True when the pad's stream was encoded as still pictures.
bool is_picture(GstPad* pad) {
  const ElementPointer decoder = decoder_of(pad);
  const PadPointer sink = decoder ? pad_of(decoder.get(), "sink") : nullptr;
  const CapsPointer caps(sink ? gst_pad_get_current_caps(sink.get()) : nullptr);
  return media_type(caps.get()).starts_with("image/");
}

/// Why pictures of these caps cannot be decoded; empty when their size is supported or unknown.
std::string too_large(const GstCaps* caps) {
  constexpr int most = 32767; // limit of gst_video_info_set_format()
  int width = 0, height = 0;
  const GstStructure* format = gst_caps_get_structure(caps, 0);
  gst_structure_get_int(format, "width", &width);
  gst_structure_get_int(format, "height", &height);
  if (width <= most && height <= most)
    return {};
  return "its pictures are " + std::to_string(width) + " x " + std::to_string(height) +
         " pixels, and GStreamer takes " + std::to_string(most) +
         " at most on each side; make them smaller: ffmpeg -i INPUT -vf scale=iw/4:ih/4 OUTPUT";
}

/// The number of a track in its container, from its stream id; 0 when there is none.
unsigned track_id_of(GstPad* pad) {
  const CharPointer id(gst_pad_get_stream_id(pad));
  const char* number = id ? std::strrchr(id.get(), '/') : nullptr;
  return number ? static_cast<unsigned>(g_ascii_strtoull(number + 1, nullptr, 10)) : 0;
}

/// The colorimetry in the caps of an event, if any.
std::optional<GstVideoColorimetry> colorimetry_of(GstEvent* event) {
  GstVideoColorimetry color;
  const char* text = gst_structure_get_string(gst_caps_get_structure(caps_of(event), 0), "colorimetry");
  if (!text || !gst_video_colorimetry_from_string(&color, text))
    return std::nullopt;
  return color;
}

/// Replaces the colorimetry in the caps event of a probe.
void set_colorimetry(GstPadProbeInfo* info, const GstVideoColorimetry& color) {
  GstEvent* event = GST_PAD_PROBE_INFO_EVENT(info);
  const CapsPointer changed(gst_caps_copy(caps_of(event)));
  const CharPointer text(gst_video_colorimetry_to_string(&color));
  gst_caps_set_simple(changed.get(), "colorimetry", G_TYPE_STRING, text.get(), nullptr);
  GST_PAD_PROBE_INFO_DATA(info) = gst_event_new_caps(changed.get());
  gst_event_unref(event);
}

bool is_video(const GstCaps* caps) {
  return !gst_caps_is_empty(caps) && !gst_caps_is_any(caps) && media_type(caps).starts_with("video/");
}

/// False for planar 8-bit 4:2:2, which videoflip (it rotates a video by its tag) does not support. Converting
/// every frame is expensive, so such a video has no videoflip unless a tag says that it is rotated.
bool can_be_turned(const GstCaps* caps) {
  const char* format = gst_structure_get_string(gst_caps_get_structure(caps, 0), "format");
  return !format || !g_str_equal(format, "Y42B");
}

/// Whether a tag before the first frame says that the video is rotated.
bool is_turned(GstPad* pad) {
  bool turned = false;
  for (guint index = 0;; ++index) {
    GstEvent* event = gst_pad_get_sticky_event(pad, GST_EVENT_TAG, index);
    if (!event)
      return turned;
    GstTagList* tags = nullptr;
    gst_event_parse_tag(event, &tags);
    char* orientation = nullptr;
    if (gst_tag_list_get_string(tags, GST_TAG_IMAGE_ORIENTATION, &orientation))
      turned = process::take(orientation) != "rotate-0";
    gst_event_unref(event);
  }
}

/// False for a truncated JPEG file. Decoders fill the rest with grey without an error.
bool has_end_mark(std::span<const std::uint8_t> jpeg) {
  constexpr std::uint8_t mark[] = {0xff, 0xd9};
  constexpr std::size_t most_padding = 4096; // some cameras pad files to whole blocks
  const auto tail = jpeg.last(std::min(jpeg.size(), most_padding));
  return std::search(tail.begin(), tail.end(), std::begin(mark), std::end(mark)) != tail.end();
}

/// Key under which the buffer of an image stores its orientation tag.
GQuark turned_quark() {
  return g_quark_from_static_string("terrainseg-process-orientation");
}

/// Limits a decoder's threads. The property has another name in each of libav's, dav1d's and libvpx's
/// decoders.
void bound_threads(GstElement* decoder, int threads) {
  for (const char* name : {"max-threads", "n-threads", "threads"})
    if (const GParamSpec* spec = g_object_class_find_property(G_OBJECT_GET_CLASS(decoder), name);
        spec && (spec->value_type == G_TYPE_INT || spec->value_type == G_TYPE_UINT))
      gst_util_set_object_arg(G_OBJECT(decoder), name, std::to_string(threads).c_str());
}

/// Sets range and matrix where a decoder leaves them unknown. With an unknown matrix GStreamer 1.22 replaces
/// the whole colorimetry by the default, and a full range is lost.
GstPadProbeReturn on_decoded_caps(GstPad*, GstPadProbeInfo* info, gpointer) {
  GstEvent* event = GST_PAD_PROBE_INFO_EVENT(info);
  if (GST_EVENT_TYPE(event) != GST_EVENT_CAPS)
    return GST_PAD_PROBE_OK;
  auto color = colorimetry_of(event);
  const CapsPointer plain(gst_caps_copy(caps_of(event)));
  gst_structure_remove_field(gst_caps_get_structure(plain.get(), 0), "colorimetry");
  GstVideoInfo usual;
  if (!color || !gst_video_info_from_caps(&usual, plain.get()) || GST_VIDEO_INFO_IS_RGB(&usual))
    return GST_PAD_PROBE_OK;
  const GstVideoColorimetry before = *color;
  if (color->range == GST_VIDEO_COLOR_RANGE_UNKNOWN)
    color->range = usual.colorimetry.range;
  if (color->matrix == GST_VIDEO_COLOR_MATRIX_UNKNOWN)
    color->matrix = usual.colorimetry.matrix;
  if (!gst_video_colorimetry_is_equal(&*color, &before))
    set_colorimetry(info, *color);
  return GST_PAD_PROBE_OK;
}

} // namespace

Source::Source(const Input& input, const Options& options)
    : input_(input), options_(options),
      tables_(input.kind == Input::Kind::file ? iso_video_tracks(input.path) : std::vector<IsoTrack>()) {
  bin_ = gst_bin_new("source");
  tail_ = gst_element_factory_make("queue", nullptr);
  g_object_set(tail_, "max-size-buffers", 4, "max-size-bytes", 0, "max-size-time", guint64{0}, nullptr);
  gst_bin_add(GST_BIN(bin_), tail_);
  gst_element_add_pad(bin_, gst_ghost_pad_new("src", pad_of(tail_, "src").get()));
  const bool images = input.kind == Input::Kind::images;
  GstElement* decoder = gst_element_factory_make(images ? "decodebin" : "uridecodebin", nullptr);
  const auto connect = [this, decoder](const char* signal, GCallback handler) {
    g_signal_connect(decoder, signal, handler, this);
  };
  connect("pad-added", G_CALLBACK(+[](GstElement*, GstPad* pad, Source* self) { self->pad_added(pad); }));
  connect("no-more-pads", G_CALLBACK(+[](GstElement*, Source* self) { self->no_more_pads(); }));
  connect("autoplug-continue", G_CALLBACK(+[](GstElement*, GstPad*, GstCaps* caps, Source* self) -> gboolean {
            return self->wants(caps);
          }));
  connect("deep-element-added", G_CALLBACK(+[](GstBin*, GstBin*, GstElement* element, Source* self) {
            self->element_added(element);
          }));
  gst_bin_add(GST_BIN(bin_), decoder);
  if (images) {
    build_image_feeder(decoder);
  } else {
    const CharPointer uri(input.kind == Input::Kind::uri ? g_strdup(input.path.c_str())
                                                         : gst_filename_to_uri(input.path.c_str(), nullptr));
    g_object_set(decoder, "uri", uri.get(), nullptr);
  }
}

void Source::build_image_feeder(GstElement* decoder) {
  feeder_ = gst_element_factory_make("appsrc", nullptr);
  g_object_set(feeder_, "format", GST_FORMAT_TIME, "max-buffers", guint64{2}, "max-bytes", guint64{0},
               "block", FALSE, nullptr);
  g_signal_connect(feeder_, "need-data", G_CALLBACK(+[](GstElement*, guint, Source* self) { self->feed(); }),
                   this);
  gst_bin_add(GST_BIN(bin_), feeder_);
  gst_element_link(feeder_, decoder);
  add_probe<&Source::on_image>(pad_of(feeder_, "src"), GST_PAD_PROBE_TYPE_BUFFER, this);
}

/// Reads an image file and its type. When it cannot be used, sets the problem and returns null.
GstBuffer* Source::read_image(const std::filesystem::path& path, std::string& type) {
  gchar* data = nullptr;
  gsize size = 0;
  GError* error = nullptr;
  if (!g_file_get_contents(path.c_str(), &data, &size, &error)) {
    blame({cause_of_reading(error), path.string() + ": " + error->message});
    g_error_free(error);
    return nullptr;
  }
  GstBuffer* buffer = gst_buffer_new_wrapped(data, size);
  const CapsPointer caps(size ? gst_type_find_helper_for_buffer(GST_OBJECT(feeder_), buffer, nullptr)
                              : nullptr);
  type = media_type(caps.get());
  std::string flaw;
  if (size == 0)
    flaw = "the file is empty";
  else if (!type.starts_with("image/"))
    flaw = "not an image" + (type.empty() ? "" : " but " + type);
  else if (next_image_ > 0 && type != image_type_)
    flaw = "the sequence starts with " + image_type_ + ", but this is " + type;
  else if (caps)
    flaw = too_large(caps.get());
  if (flaw.empty()) {
    const std::span<const std::uint8_t> content(reinterpret_cast<const std::uint8_t*>(data), size);
    if (type == "image/jpeg" && !has_end_mark(content)) {
      const std::lock_guard lock(mutex_);
      if (cut_images_++ == 0)
        cut_image_ = path.string();
    }
    const int orientation = exif_orientation(content);
    gst_mini_object_set_qdata(GST_MINI_OBJECT(buffer), turned_quark(),
                              const_cast<char*>(orientation_tag(orientation)), nullptr);
    return buffer;
  }
  gst_buffer_unref(buffer);
  blame({Cause::damaged, path.string() + ": " + flaw});
  return nullptr;
}

/// Pushes the next image with its time to the decoder.
void Source::feed() {
  GstAppSrc* feeder = GST_APP_SRC(feeder_);
  std::string type;
  GstBuffer* buffer =
      next_image_ < input_.images.size() && !fault() ? read_image(input_.images[next_image_], type) : nullptr;
  if (!buffer) {
    gst_app_src_end_of_stream(feeder);
    return;
  }
  if (next_image_ == 0) {
    image_type_ = type;
    const CapsPointer full(gst_caps_new_simple(type.c_str(), "framerate", GST_TYPE_FRACTION,
                                               options_.fps_numerator, options_.fps_denominator, nullptr));
    gst_app_src_set_caps(feeder, full.get());
  }
  const auto time_of = [this](std::size_t index) {
    return gst_util_uint64_scale(index, GST_SECOND * static_cast<guint64>(options_.fps_denominator),
                                 static_cast<guint64>(options_.fps_numerator));
  };
  GST_BUFFER_PTS(buffer) = time_of(next_image_);
  GST_BUFFER_DURATION(buffer) = time_of(next_image_ + 1) - time_of(next_image_);
  ++next_image_;
  gst_app_src_push_buffer(feeder, buffer);
}

/// Sends the orientation tag to videoflip before an image whose orientation differs from the last one's.
GstPadProbeReturn Source::on_image(GstPad* pad, GstPadProbeInfo* info) {
  const char* tag = static_cast<const char*>(
      gst_mini_object_get_qdata(GST_MINI_OBJECT(GST_PAD_PROBE_INFO_BUFFER(info)), turned_quark()));
  if (!tag || orientation_ == tag)
    return GST_PAD_PROBE_OK;
  orientation_ = tag;
  gst_pad_push_event(pad, gst_event_new_tag(gst_tag_list_new(GST_TAG_IMAGE_ORIENTATION, tag, nullptr)));
  return GST_PAD_PROBE_OK;
}

std::string Source::image_after(std::uint64_t frames) const {
  return input_.kind == Input::Kind::images && frames < input_.images.size() ? input_.images[frames].string()
                                                                             : "";
}

void Source::pad_added(GstPad* pad) {
  CapsPointer caps(gst_pad_get_current_caps(pad));
  if (!caps)
    caps.reset(gst_pad_query_caps(pad, nullptr));
  if (is_video(caps.get())) {
    ++videos_;
    // A still picture (cover, preview) before the video is used only if no video follows. Network streams
    // cannot wait for that.
    if (!linked_ && input_.kind != Input::Kind::uri && is_picture(pad)) {
      if (!picture_)
        picture_.reset(GST_PAD(gst_object_ref(pad)));
    } else if (!linked_) { // only the first video track is used
      take(pad);
    }
    return;
  }
  if (gst_caps_is_empty(caps.get()) || gst_caps_is_any(caps.get()))
    return;
  const std::lock_guard lock(mutex_);
  other_streams_ += (other_streams_.empty() ? "" : ", ") + media_type(caps.get());
}

Source::Track* Source::track_of(const GstElement* element) {
  const std::lock_guard lock(mutex_);
  for (const auto& track : tracks_)
    if (track->element == element)
      return track.get();
  return nullptr;
}

void Source::take(GstPad* pad) {
  const ElementPointer decoder = decoder_of(pad);
  taken_ = track_of(decoder.get());
  // Since GStreamer 1.24 a parser of pictures drops those that it does not understand before they are
  // decoded.
  ElementPointer before = decoder ? element_before(decoder.get()) : ElementPointer();
  while (before && !parsed_) {
    parsed_ = track_of(before.get());
    before = element_before(before.get());
  }
  track_id_ = track_id_of(pad);
  taken_number_ = videos_;
  linked_ = link_video(pad);
}

std::string Source::listed() const {
  std::size_t frames = 0;
  std::uint64_t shown = 0;
  for (const IsoTrack& track : tables_) {
    frames += track.times.size() + track.fragment_frames;
    shown += track.shown_frames();
  }
  if (frames == 0)
    return {};
  return "it holds " + counted(frames, "frame") +
         (shown == 0 ? ", of which its edit list shows none" : ", and no picture came out of any") +
         "; cut it from the recording again, and encode it (ffmpeg without -c copy)";
}

std::string Source::choice() const {
  if (videos_ < 2)
    return {};
  return "it has " + std::to_string(videos_) + " video tracks; number " + std::to_string(taken_number_) +
         " was taken" + (track_id_ ? " (track " + std::to_string(track_id_) + " of the file)" : "") +
         ", the others are ignored";
}

/// Links conversion, deinterlacing and rotation. Each passes frames through that do not need it.
bool Source::link_video(GstPad* pad) {
  const CapsPointer caps(gst_pad_query_caps(pad, nullptr));
  // One frame out per frame in: the second field would show the same moment again.
  std::string elements = "videoconvert ! deinterlace fields=top";
  // A later image of a sequence may be rotated. GStreamer 1.26's FFmpeg decoders abort at times when they
  // decode into videoflip's buffers and the frame is padded ("video meta uses 368x640 instead of 360x640"):
  // with the identity they decode into their own.
  if (input_.kind == Input::Kind::images || can_be_turned(caps.get()) || is_turned(pad))
    elements += " ! identity drop-allocation=true ! videoflip video-direction=auto";
  GstElement* upright = gst_parse_bin_from_description(elements.c_str(), TRUE, nullptr);
  gst_bin_add(GST_BIN(bin_), upright);
  const bool ok = gst_element_link(upright, tail_);
  // The first frame may arrive while the bin still starts its other elements, and a queue that is not started
  // refuses it.
  gst_element_sync_state_with_parent(tail_);
  gst_element_sync_state_with_parent(upright);
  const PadPointer sink = pad_of(upright, "sink");
  add_probe<&Source::on_decoded>(sink, GST_PAD_PROBE_TYPE_BUFFER, this);
  gst_pad_add_probe(sink.get(), GST_PAD_PROBE_TYPE_EVENT_DOWNSTREAM, on_decoded_caps, nullptr, nullptr);
  if (ok && gst_pad_link(pad, sink.get()) == GST_PAD_LINK_OK)
    return true;
  blame({Cause::unsupported, "its video cannot be used: " + process::take(gst_caps_to_string(caps.get()))});
  return false;
}

void Source::end() {
  gst_pad_send_event(pad_of(tail_, "sink").get(), gst_event_new_eos());
}

/// The first fault is kept.
void Source::blame(const Fault& fault) {
  const std::lock_guard lock(mutex_);
  if (!fault_)
    fault_ = fault;
}

Fault Source::fault() const {
  const std::lock_guard lock(mutex_);
  return fault_;
}

bool Source::has_given_up() const {
  if (linked_ || input_.kind != Input::Kind::file)
    return false;
  struct Look {
    GstElement* tail; // its thread always runs, waiting for frames
    bool working = false;
  } look{tail_};
  GstIterator* elements = gst_bin_iterate_recurse(GST_BIN(bin_));
  const auto visit = [](const GValue* value, gpointer data) {
    Look& state = *static_cast<Look*>(data);
    GstElement* element = GST_ELEMENT(g_value_get_object(value));
    GST_OBJECT_LOCK(element);
    for (GList* pad = element->pads; pad && element != state.tail; pad = pad->next)
      state.working = state.working || gst_pad_get_task_state(GST_PAD(pad->data)) == GST_TASK_STARTED;
    GST_OBJECT_UNLOCK(element);
  };
  const GstIteratorResult result = gst_iterator_foreach(elements, visit, &look);
  gst_iterator_free(elements);
  return result == GST_ITERATOR_DONE &&
         !look.working; // not done: the bin changed meanwhile, so it is working
}

std::string Source::cut_images() const {
  const std::lock_guard lock(mutex_);
  if (cut_images_ == 0)
    return {};
  return cut_image_ + ": the picture is truncated, its end mark is missing" +
         (cut_images_ > 1 ? "; so are " + std::to_string(cut_images_ - 1) + " more" : "");
}

std::string Source::other_streams() const {
  const std::lock_guard lock(mutex_);
  return other_streams_;
}

void Source::no_more_pads() {
  if (!linked_ && picture_) {
    taken_number_ = 1;
    take(picture_.get());
  }
  const std::string others = other_streams();
  if (!linked_)
    blame({Cause::unsupported, no_video + (others.empty() ? "" : ", only " + others)});
}

/// Prevents the decoding of sound and subtitles, and the search for decoders of them.
bool Source::wants(const GstCaps* caps) {
  if (const std::string flaw = too_large(caps); !flaw.empty())
    blame({Cause::unsupported, flaw});
  const std::string name = media_type(caps);
  for (const char* ignored :
       {"audio/", "text/", "subpicture/", "closedcaption/", "application/x-subtitle", "meta/"})
    if (name.starts_with(ignored))
      return false;
  return true;
}

void Source::element_added(GstElement* element) {
  GstElementFactory* factory = gst_element_get_factory(element);
  if (!factory)
    return;
  const std::string name = GST_OBJECT_NAME(factory);
  if (name == "qtdemux") {
    is_iso_media_ = true;
    add_probe<&Source::on_index>(pad_of(element, "sink"), GST_PAD_PROBE_TYPE_PULL | GST_PAD_PROBE_TYPE_BUFFER,
                                 this);
  } else if (name.starts_with("avdemux_")) {
    const PadPointer sink = pad_of(element, "sink");
    add_probe<&Source::on_pulled>(sink, GST_PAD_PROBE_TYPE_PULL | GST_PAD_PROBE_TYPE_BUFFER, this);
    // Called before each pull, even if the pull fails.
    add_probe<&Source::on_pull>(sink, GST_PAD_PROBE_TYPE_PULL | GST_PAD_PROBE_TYPE_BLOCK, this);
  }
  const auto is = [factory](GstElementFactoryListType type) {
    return gst_element_factory_list_is_type(factory, type);
  };
  const bool decodes = is(GST_ELEMENT_FACTORY_TYPE_DECODER | GST_ELEMENT_FACTORY_TYPE_MEDIA_VIDEO |
                          GST_ELEMENT_FACTORY_TYPE_MEDIA_IMAGE);
  if (!decodes && !is(GST_ELEMENT_FACTORY_TYPE_PARSER | GST_ELEMENT_FACTORY_TYPE_MEDIA_IMAGE))
    return;
  if (decodes)
    bound_threads(element, options_.threads);
  const PadPointer sink = pad_of(element, "sink");
  if (!sink)
    return;
  const std::lock_guard lock(mutex_);
  tracks_.push_back(std::make_unique<Track>(Track{element, true, false, {}, this}));
  Track* track = tracks_.back().get();
  add_probe<&Track::on_encoded>(sink, GST_PAD_PROBE_TYPE_BUFFER, track);
  if (decodes)
    add_probe<&Track::on_encoded_caps>(sink, GST_PAD_PROBE_TYPE_EVENT_DOWNSTREAM, track);
}

/// libav's demuxers in GStreamer 1.22 treat the end of a truncated file (such as a GIF) as missing data and
/// read again forever. They hold libav's lock, so encoders cannot stop. FLUSHING makes them end the stream
/// and output what they have read.
GstPadProbeReturn Source::on_pull(GstPad*, GstPadProbeInfo* info) {
  const bool at_end = pulled_ > 0 && GST_PAD_PROBE_INFO_OFFSET(info) >= pulled_;
  pulls_at_end_ = at_end ? pulls_at_end_ + 1 : 0;
  if (pulls_at_end_ <= often)
    return GST_PAD_PROBE_PASS;
  GST_PAD_PROBE_INFO_FLOW_RETURN(info) = GST_FLOW_FLUSHING;
  return GST_PAD_PROBE_HANDLED;
}

/// Replaces edit lists that qtdemux would not follow exactly; on_decoded() applies the original ones.
GstPadProbeReturn Source::on_index(GstPad*, GstPadProbeInfo* info) {
  const std::uint64_t begin = GST_PAD_PROBE_INFO_OFFSET(info);
  for (const IsoTrack& track : tables_)
    for (const auto& [at, bytes] : track.untrimmed) {
      GstBuffer* buffer = GST_PAD_PROBE_INFO_BUFFER(info);
      if (!track.followed_here() || !buffer || at < begin ||
          at + bytes.size() > begin + gst_buffer_get_size(buffer))
        continue;
      buffer = gst_buffer_make_writable(buffer);
      gst_buffer_fill(buffer, at - begin, bytes.data(), bytes.size());
      GST_PAD_PROBE_INFO_DATA(info) = buffer;
    }
  return GST_PAD_PROBE_OK;
}

const IsoTrack* Source::table(unsigned track_id) const {
  for (const IsoTrack& track : tables_)
    if (track.id == track_id || tables_.size() == 1)
      return &track;
  return nullptr;
}

std::uint64_t Source::promised() const {
  const IsoTrack* track = table();
  return track && is_countable() ? track->shown_frames() : 0;
}

GstPadProbeReturn Source::on_pulled(GstPad*, GstPadProbeInfo* info) {
  GstBuffer* buffer = GST_PAD_PROBE_INFO_BUFFER(info);
  if (buffer && GST_BUFFER_OFFSET_IS_VALID(buffer))
    pulled_ = std::max<std::uint64_t>(pulled_, GST_BUFFER_OFFSET(buffer) + gst_buffer_get_size(buffer));
  return GST_PAD_PROBE_OK;
}

GstPadProbeReturn Source::Track::on_encoded(GstPad* pad, GstPadProbeInfo* info) {
  GstBuffer* buffer = GST_PAD_PROBE_INFO_BUFFER(info);
  if (encoded.empty()) {
    const CapsPointer caps(gst_pad_get_current_caps(pad));
    const std::string name = media_type(caps.get());
    countable = countable && name != "video/x-vp8" && name != "video/x-vp9" && name != "video/x-av1";
    pictures = name.starts_with("image/");
  }
  countable = countable && GST_BUFFER_PTS_IS_VALID(buffer);
  if (countable && !GST_BUFFER_FLAG_IS_SET(buffer, GST_BUFFER_FLAG_DECODE_ONLY))
    encoded.push_back(GST_BUFFER_PTS(buffer));
  return GST_PAD_PROBE_OK;
}

/// qtdemux 1.22 reports a limited range for every colr box, and parsers and decoders prefer that to the
/// stream's own value. Sets the full range when the box declares it; otherwise the range is left unknown, and
/// the decoder sets it.
GstPadProbeReturn Source::Track::on_encoded_caps(GstPad* pad, GstPadProbeInfo* info) {
  if (!source->is_iso_media_ || GST_EVENT_TYPE(GST_PAD_PROBE_INFO_EVENT(info)) != GST_EVENT_CAPS)
    return GST_PAD_PROBE_OK;
  if (auto color = colorimetry_of(GST_PAD_PROBE_INFO_EVENT(info));
      color && color->range != GST_VIDEO_COLOR_RANGE_0_255) {
    const IsoTrack* track = source->table(track_id_of(pad));
    color->range = track && track->full_range ? GST_VIDEO_COLOR_RANGE_0_255 : GST_VIDEO_COLOR_RANGE_UNKNOWN;
    set_colorimetry(info, *color);
  }
  return GST_PAD_PROBE_OK;
}

bool Source::is_countable() const {
  return countable_ && taken_ && taken_->countable;
}

std::uint64_t Source::lost() const {
  if (!is_countable() || decoded_.empty() || taken_->encoded.empty())
    return 0;
  const bool parsed = parsed_ && parsed_->countable && parsed_->encoded.size() > taken_->encoded.size();
  std::vector<GstClockTime> in = (parsed ? parsed_ : taken_)->encoded, out = decoded_;
  std::sort(in.begin(), in.end());
  std::sort(out.begin(), out.end());
  // The file itself trims frames before the first and after the last decoded one. This does not apply to
  // still pictures, which are decoded independently.
  if (!taken_->pictures) {
    in.erase(in.begin(), std::lower_bound(in.begin(), in.end(), out.front()));
    in.erase(std::upper_bound(in.begin(), in.end(), out.back()), in.end());
  }
  std::vector<GstClockTime> lost;
  std::set_difference(in.begin(), in.end(), out.begin(), out.end(), std::back_inserter(lost));
  if (const IsoTrack* track = table();
      track && track->followed_here()) // frames that no edit shows are not lost
    std::erase_if(lost, [track](GstClockTime time) { return !track->shown_at(time); });
  // If no time matches, the decoder assigned new times, and the number is unknown.
  return lost.size() + 1 < in.size() ? lost.size() : 0;
}

GstPadProbeReturn Source::on_decoded(GstPad* pad, GstPadProbeInfo* info) {
  GstBuffer* buffer = GST_PAD_PROBE_INFO_BUFFER(info);
  if (decoded_.empty()) {
    const CapsPointer caps(gst_pad_get_current_caps(pad));
    const char* mode =
        caps ? gst_structure_get_string(gst_caps_get_structure(caps.get(), 0), "interlace-mode") : "";
    if (mode && *mode && !g_str_equal(mode, "progressive"))
      countable_ = false;
  }
  if (countable_)
    decoded_.push_back(GST_BUFFER_PTS(buffer));
  const IsoTrack* track = table();
  const bool follows = track && track->followed_here() && GST_BUFFER_PTS_IS_VALID(buffer);
  const auto shown = follows ? track->shown_at(GST_BUFFER_PTS(buffer)) : std::nullopt;
  if (follows && !shown)
    return GST_PAD_PROBE_DROP;
  if (GST_BUFFER_FLAG_IS_SET(buffer, GST_BUFFER_FLAG_CORRUPTED))
    ++corrupted_;
  else if (!std::exchange(sound_, true))
    corrupted_ = 0;
  if (!follows)
    return GST_PAD_PROBE_OK;
  buffer = gst_buffer_make_writable(buffer);
  GST_BUFFER_PTS(buffer) = *shown;
  GST_PAD_PROBE_INFO_DATA(info) = buffer;
  return GST_PAD_PROBE_OK;
}

} // namespace terrainseg::process
