// SPDX-License-Identifier: LGPL-2.1-or-later
// A training window in pixels that does not fit into the frame.
#pragma once

#include <string>
#include <utility>

#include "support/warnings.hpp"
#include "terrainseg/settings.hpp"

namespace terrainseg {

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
