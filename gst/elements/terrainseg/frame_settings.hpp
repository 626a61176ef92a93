// SPDX-License-Identifier: LGPL-2.1-or-later
// The settings that the next frame is labelled with.
#pragma once

#include <gst/video/video.h>

#include <cstdint>
#include <optional>
#include <string>
#include <utility>

#include "elements/terrainseg/settings_book.hpp"
#include "elements/terrainseg/shared.hpp"
#include "support/warnings.hpp"
#include "terrainseg/segmenter.hpp"

namespace terrainseg {

/// Reads the file of settings-location. False after an error was posted.
inline bool read_file(GstElement* element, Shared& shared) {
  SettingsFile file;
  {
    const Lock lock(shared.mutex);
    file.path = shared.book.settings().settings_location;
  }
  if (!file.path.empty())
    file = read_settings_file(file.path);
  std::optional<SettingsError> wrong;
  SettingsBook::Ids changed;
  if (file.error.empty()) {
    const Lock lock(shared.mutex);
    wrong = shared.book.take_file(file, changed);
  }
  SettingsBook::notify(element, changed);
  const std::string reason = wrong ? "key " + wrong->message() : file.error;
  if (!reason.empty())
    GST_ELEMENT_ERROR(element, RESOURCE, SETTINGS,
                      ("The settings file \"%s\" of property settings-location cannot be used: %s.",
                       file.path.c_str(), reason.c_str()),
                      ("property settings-location, value \"%s\": %s", file.path.c_str(), reason.c_str()));
  return reason.empty();
}

/// A snapshot of the book, its window fitted to the frame, and what of it the segmenter has. Used by the
/// streaming thread alone, or while there is none.
class FrameSettings {
 public:
  const ElementSettings& values() const { return values_; }

  /// Reads the file of settings-location and takes the first snapshot. False after an error was posted.
  bool start(GstElement* element, Shared& shared) {
    if (!read_file(element, shared))
      return false;
    {
      const Lock lock(shared.mutex);
      shared.book.forget_told();
    }
    sequence_ = 0;
    const auto error = take(element, shared);
    if (error) {
      GST_ELEMENT_ERROR(element, LIBRARY, SETTINGS,
                        ("Property %s cannot be %s: %s.", error->property.c_str(), error->value.c_str(),
                         error->reason.c_str()),
                        ("property %s, value %s, rule: %s", error->property.c_str(), error->value.c_str(),
                         error->reason.c_str()));
      return false;
    }
    misfit_.again();
    line_.again();
    return true;
  }
  /// Takes properties that changed since the last frame, and fits them to the frame. Contradictory values are
  /// reported, and the previous ones are kept.
  void update(GstElement* element, Shared& shared, const GstVideoInfo& info) {
    const auto error = take(element, shared);
    if (error)
      GST_ELEMENT_WARNING(element, LIBRARY, SETTINGS,
                          ("Property %s cannot be %s: %s. The previous values are kept.",
                           error->property.c_str(), error->value.c_str(), error->reason.c_str()),
                          ("property %s, value %s, rule: %s", error->property.c_str(), error->value.c_str(),
                           error->reason.c_str()));
    fit_window(element, GST_VIDEO_INFO_WIDTH(&info), GST_VIDEO_INFO_HEIGHT(&info));
    check_vanishing_row(element, GST_VIDEO_INFO_HEIGHT(&info));
  }
  /// Gives the segmenter its settings when they changed. A frame that is not learnable is scored all the
  /// same.
  void configure(Segmenter& segmenter, bool learnable) {
    if (configured_ == learnable)
      return;
    Settings wanted = fitted_;
    wanted.learning = wanted.learning && learnable;
    segmenter.configure(wanted);
    configured_ = learnable;
  }

 private:
  /// Takes the values of the book if they are others. Returns what is wrong with them: then the previous ones
  /// are kept.
  std::optional<SettingsError> take(GstElement* element, Shared& shared) {
    Lock lock(shared.mutex);
    if (sequence_ == shared.book.sequence())
      return std::nullopt;
    sequence_ = shared.book.sequence();
    auto error = shared.book.error();
    if (error)
      return error;
    values_ = shared.book.settings();
    request_.reset(); // not fitted yet
    const std::string unused = shared.book.take_unused();
    lock.unlock();
    if (!unused.empty())
      GST_ELEMENT_WARNING(element, LIBRARY, SETTINGS,
                          ("Properties without effect: %s. The %s pipeline does not use them.",
                           unused.c_str(), values_.core.free_space ? "default" : "paper's"),
                          ("properties %s", unused.c_str()));
    return error;
  }
  /// Moves and cuts a window that does not fit the frame: a stream may shrink at any time.
  void fit_window(GstElement* element, int width, int height) {
    const Settings& set = values_.core;
    const WindowRequest request{
        set.window_width, set.window_height, set.window_bottom, set.window_x, width, height};
    if (request_ == request)
      return;
    request_ = request;
    configured_.reset();
    fitted_ = with_fitting_window(set, width, height);
    if (fitted_ != set && misfit_.first(request))
      TERRAINSEG_POST_WARNING(
          element, LIBRARY, SETTINGS,
          window_warning(request, fitted_, " Use window-rect for a window that scales with the frame."));
  }
  void check_vanishing_row(GstElement* element, int height) {
    const int row = values_.core.vanishing_row;
    if (row < height || !line_.first({row, height}))
      return;
    GST_ELEMENT_WARNING(element, LIBRARY, SETTINGS,
                        ("vanishing-row = %d is below the last of %d rows and is ignored: set the row of the "
                         "frame at which level ground would end.",
                         row, height),
                        ("property vanishing-row, value %d", row));
  }

  ElementSettings values_;
  std::uint64_t sequence_ = 0;           ///< of values_; 0 = of none
  Settings fitted_;                      ///< with a window that fits the frame
  std::optional<WindowRequest> request_; ///< that it was made from; nothing: of older values
  std::optional<bool> configured_;       ///< the segmenter has it, and whether it may learn
  Once<WindowRequest> misfit_;
  Once<std::pair<int, int>> line_; ///< row and height of a vanishing line below the frame
};

} // namespace terrainseg
