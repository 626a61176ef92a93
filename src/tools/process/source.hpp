// SPDX-License-Identifier: LGPL-2.1-or-later
// The decoding part of a pipeline: turns a file, a URI or a list of images into raw, upright, progressive
// video.
#pragma once

#include <gst/gst.h>

#include <atomic>
#include <cstdint>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "tools/process/container.hpp"
#include "tools/process/faults.hpp"
#include "tools/process/handles.hpp"
#include "tools/process/inputs.hpp"
#include "tools/process/options.hpp"

namespace terrainseg::process {

/// The problem of a source without any details. An error message, if there is one, is more precise.
inline constexpr const char* no_video = "there is no video in it";

class Source {
 public:
  Source(const Input& input, const Options& options);

  /// The bin with one pad "src". A pipeline must take ownership of it, and must set it to NULL before the
  /// Source is destroyed.
  GstElement* bin() const { return bin_; }

  bool has_video() const { return linked_; }
  /// True when no thread processes the input although no video was found: some demuxers stop at a truncated
  /// file without an error.
  bool has_given_up() const;
  /// The media types of the input's other streams, for a message; empty when unknown.
  std::string other_streams() const;
  /// Why reading an image or linking failed, if one did.
  Fault fault() const;
  /// Number of frames that the decoder marked as damaged. Frames before the first undamaged one do not count:
  /// a file that is trimmed inside an open group of pictures starts with such frames.
  std::uint64_t corrupted() const { return corrupted_; }
  /// Number of frames after the first decoded one that the decoder received but did not output. 0 when this
  /// is unknown: codecs with hidden frames (VP8, VP9, AV1), fields, files without times. Call it only after
  /// the pipeline has stopped.
  std::uint64_t lost() const;
  /// False when the decoder may output fewer frames than it receives.
  bool is_countable() const;
  /// Which of several video tracks is used, for a message; empty when there is only one.
  std::string choice() const;
  /// The truncated images of a sequence, for a message; empty when there are none.
  std::string cut_images() const;
  /// Why the video tracks in the file's tables gave no frame; empty when there are no such tracks.
  std::string listed() const;
  /// Number of frames of the track according to the file's tables; 0 when unknown.
  std::uint64_t promised() const;
  /// The image that is decoded after `frames` frames; empty for other inputs.
  std::string image_after(std::uint64_t frames) const;
  /// Sends EOS as at the end of the input, for a decoder that failed without sending it.
  void end();

 private:
  void build_image_feeder(GstElement* decoder);
  /// A video track and the frames that its decoder, or its parser of pictures, receives.
  struct Track {
    GstElement* element;
    bool countable = true;
    bool pictures = false;             ///< each can be decoded without the others
    std::vector<GstClockTime> encoded; ///< times of its frames
    const Source* source = nullptr;
    GstPadProbeReturn on_encoded(GstPad* pad, GstPadProbeInfo* info);
    GstPadProbeReturn on_encoded_caps(GstPad* pad, GstPadProbeInfo* info);
  };
  /// The file's tables of the used track; null for other containers.
  const IsoTrack* table() const { return table(track_id_); }
  const IsoTrack* table(unsigned track_id) const;
  Track* track_of(const GstElement* element);
  void take(GstPad* pad);
  void feed();
  GstBuffer* read_image(const std::filesystem::path& path, std::string& type);
  void pad_added(GstPad* pad);
  bool link_video(GstPad* pad);
  void blame(const Fault& fault);
  void no_more_pads();
  bool wants(const GstCaps* caps);
  void element_added(GstElement* element);
  GstPadProbeReturn on_image(GstPad* pad, GstPadProbeInfo* info);
  GstPadProbeReturn on_pull(GstPad* pad, GstPadProbeInfo* info);
  GstPadProbeReturn on_pulled(GstPad* pad, GstPadProbeInfo* info);
  GstPadProbeReturn on_index(GstPad* pad, GstPadProbeInfo* info);
  GstPadProbeReturn on_decoded(GstPad* pad, GstPadProbeInfo* info);

  const Input& input_;
  const Options& options_;
  GstElement* bin_ = nullptr;
  GstElement* tail_ = nullptr;           ///< the queue that ends the bin
  GstElement* feeder_ = nullptr;         ///< the appsrc of an image sequence
  std::size_t next_image_ = 0;           ///< used by the feeder's thread only
  std::string image_type_;               ///< media type of the first image; feeder's thread only
  std::string orientation_ = "rotate-0"; ///< of the last image; streaming thread only
  std::atomic<bool> linked_{false};
  std::atomic<bool> is_iso_media_{false}; ///< qtdemux reads it
  std::atomic<std::uint64_t> corrupted_{0};
  bool sound_ = false;                ///< an undamaged frame was decoded; streaming thread only
  bool countable_ = true;             ///< one frame out per frame in; streaming threads only
  std::vector<GstClockTime> decoded_; ///< times of the decoded frames; streaming thread only
  std::vector<std::unique_ptr<Track>> tracks_;
  Track* taken_ = nullptr;
  Track* parsed_ = nullptr; ///< of the parser before the used track's decoder, where there is one
  PadPointer picture_;      ///< a track of still pictures, used when there is no other video
  int videos_ = 0, taken_number_ = 0;
  unsigned track_id_ = 0;              ///< number of the used track in the container; 0 = unknown
  const std::vector<IsoTrack> tables_; ///< of an MP4 or MOV file
  std::uint64_t pulled_ = 0;           ///< end of the bytes that a libav demuxer has read; its thread only
  std::uint64_t pulls_at_end_ = 0;     ///< consecutive reads after that end; its thread only
  mutable std::mutex mutex_;           ///< protects the members below and tracks_
  Fault fault_;
  std::string other_streams_;
  std::string cut_image_; ///< path of the first truncated image
  std::uint64_t cut_images_ = 0;
};

} // namespace terrainseg::process
