// SPDX-License-Identifier: LGPL-2.1-or-later
// Warnings of an element: once instead of with every frame.
#pragma once

#include <gst/gst.h>

#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <variant>

#include "exchange/counted.hpp"
#include "terrainseg/settings.hpp"

namespace terrainseg {

/// Returns true the first time, and when `key` differs from the last one. Not thread-safe.
template <class Key = std::monostate> class Once {
 public:
  bool first(const Key& key = {}) { return std::exchange(last_, key) != key; }
  /// The next call returns true again.
  void again() { last_.reset(); }

 private:
  std::optional<Key> last_;
};

/// The texts of a warning. The element's own file posts it: warnings posted from headers and shared code have
/// no debug category of the element, and `GST_DEBUG=terrain*` does not show them.
struct Warning {
  std::string text, debug;
};

/// Posts it like GST_ELEMENT_WARNING, with file and category of the element.
#define TERRAINSEG_POST_WARNING(element, domain, code, warning)                                              \
  do {                                                                                                       \
    const terrainseg::Warning& to_post = (warning);                                                          \
    GST_ELEMENT_WARNING((element), domain, code, ("%s", to_post.text.c_str()),                               \
                        ("%s", to_post.debug.c_str()));                                                      \
  } while (false)

/// Reports once a second of frames without metadata, or a shorter stream without it. Stops at the first
/// metadata.
class MetadataWatch {
 public:
  static constexpr std::uint64_t patience = 25; ///< number of frames before the report

  /// Returns true once, for the last of that many frames, if none had metadata.
  bool see(bool has_metadata) {
    if (is_over_)
      return false;
    is_over_ = has_metadata || ++bare_frames_ == patience;
    return !has_metadata && is_over_;
  }
  /// At the end of the stream: true if no frame had metadata and this was not reported yet.
  bool end() {
    const bool to_tell = !is_over_ && bare_frames_ > 0;
    is_over_ = is_over_ || to_tell;
    return to_tell;
  }
  /// Warning that there is no metadata. `source` is the name of the terrainseg that is read, "" = any.
  Warning warning(const std::string& element, const char* consequence, const char* source) const {
    const std::string named = *source ? std::string(" of source=") + source : "";
    return {"No terrain metadata" + named + " on the first " + counted(bare_frames_, "frame") + ", so " +
                consequence + ". Put terrainseg before " + element +
                ", without an element between them that drops metadata (videocrop, videobox, videoflip, "
                "compositor).",
            "no GstTerrainSegMeta" + named};
  }

 private:
  std::uint64_t bare_frames_ = 0; ///< frames so far without metadata
  bool is_over_ = false;          ///< metadata has come, or its absence was reported
};

/// The requested window in pixels, and the size of the frame.
struct WindowRequest {
  int width, height, bottom, x, frame_width = 0, frame_height = 0;
  bool operator==(const WindowRequest&) const = default;
};

inline std::string text_of(const WindowRequest& r) {
  std::string text;
  for (const auto& [name, value] : {std::pair{"window-width", r.width},
                                    {"window-height", r.height},
                                    {"window-bottom", r.bottom},
                                    {"window-x", r.x}})
    text.append(text.empty() ? "" : ", ").append(name).append(" = ").append(std::to_string(value));
  return text;
}

/// Warning: the window was moved and reduced to `used`. `remedy` is an additional sentence, or empty.
inline Warning window_warning(const WindowRequest& request, const Settings& used, const char* remedy) {
  const std::string wanted = text_of(request),
                    fitted =
                        text_of({used.window_width, used.window_height, used.window_bottom, used.window_x}),
                    width = std::to_string(request.frame_width),
                    height = std::to_string(request.frame_height);
  return {"The training window (" + wanted + ") does not fit a frame of " + width + " x " + height +
              "; it is moved and cut to fit (" + fitted + ")." + remedy,
          "window " + wanted + " in " + width + " x " + height + ", used: " + fitted};
}

} // namespace terrainseg
