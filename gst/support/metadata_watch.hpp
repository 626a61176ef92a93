// SPDX-License-Identifier: LGPL-2.1-or-later
// Whether any frame of a stream carries the metadata that an element reads.
#pragma once

#include <cstdint>
#include <string>

#include "exchange/counted.hpp"
#include "support/warning.hpp"

namespace terrainseg {

/// Reports a second of frames without metadata, or a shorter stream without; the first metadata ends the
/// watch.
class MetadataWatch {
 public:
  static constexpr std::uint64_t patience = 25; ///< frames

  /// True once, with the last of that many frames when none had metadata.
  bool see(bool has_metadata) {
    if (is_over_)
      return false;
    is_over_ = has_metadata || ++bare_frames_ == patience;
    return !has_metadata && is_over_;
  }
  /// The stream ends: true when there were frames, none with metadata, and that was not reported yet.
  bool end() {
    const bool to_tell = !is_over_ && bare_frames_ > 0;
    is_over_ = is_over_ || to_tell;
    return to_tell;
  }
  /// That nothing comes of it; `source` is the terrainseg that was asked for, "" is any.
  Warning warning(const std::string& element, const char* consequence, const char* source) const {
    const std::string named = *source ? std::string(" of source=") + source : "";
    return {"No terrain metadata" + named + " on the first " + counted(bare_frames_, "frame") + ", so " +
                consequence + ". Put terrainseg before " + element +
                ", without an element between them that drops metadata (videocrop, videobox, videoflip, "
                "compositor).",
            "no GstTerrainSegMeta" + named};
  }

 private:
  std::uint64_t bare_frames_ = 0; ///< those before the first with metadata
  bool is_over_ = false;          ///< metadata came, or its absence was reported
};

} // namespace terrainseg
