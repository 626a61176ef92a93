// SPDX-License-Identifier: LGPL-2.1-or-later
// The settings that the next frame is labelled with.
#pragma once

#include <gst/video/video.h>

#include <cstdint>
#include <optional>
#include <utility>

#include "elements/terrainseg/settings_book.hpp"
#include "support/warnings.hpp"
#include "support/window_request.hpp"
#include "terrainseg/segmenter.hpp"

namespace terrainseg {

struct Shared;

/// A snapshot of the book, its window fitted to the frame, and what of it the segmenter has. Used by the
/// streaming thread alone, or while there is none.
class FrameSettings {
 public:
  const ElementSettings& values() const { return values_; }

  /// Reads the file of settings-location and takes the first snapshot. False after an error was posted.
  bool start(GstElement* element, Shared& shared);
  /// Takes properties that changed since the last frame, and fits them to the frame. Contradictory values are
  /// reported, and the previous ones are kept.
  void update(GstElement* element, Shared& shared, const GstVideoInfo& info);
  /// Gives the segmenter its settings when they changed. A frame that is not learnable is scored all the
  /// same.
  void configure(Segmenter& segmenter, bool learnable);

 private:
  /// Takes the values of the book. Returns what is wrong with them: then the previous ones are kept.
  std::optional<SettingsError> take(GstElement* element, Shared& shared);
  bool is_current(Shared& shared) const;
  void fit_window(GstElement* element, int width, int height);
  void check_vanishing_row(GstElement* element, int height);

  ElementSettings values_;
  std::uint64_t sequence_ = 0;            ///< of values_
  Settings fitted_;                       ///< with a window that fits the frame
  std::uint64_t fitted_sequence_ = 0;     ///< of the settings that it was made from
  std::optional<WindowRequest> request_;  ///< that it was made from
  std::uint64_t configured_sequence_ = 0; ///< of the settings that the segmenter has
  bool configured_learnable_ = true;      ///< whether they let it learn
  Once<WindowRequest> misfit_;
  Once<std::pair<int, int>> line_; ///< row and height of a vanishing line below the frame
};

} // namespace terrainseg
