// SPDX-License-Identifier: LGPL-2.1-or-later
// The properties of terrainseg that are settings: the core's table and the element's own, presets, a settings
// file, and which of them were set explicitly.
#pragma once

#include <gst/gst.h>

#include <array>
#include <bitset>
#include <optional>
#include <string>
#include <vector>

#include "support/overlay_properties.hpp"
#include "terrainseg/settings.hpp"

namespace terrainseg {

/// Appends rectangles to a GstValueArray as the property ignore-regions has them: <<x, y, width, height>,
/// ...>.
void put_regions(const std::vector<Rectangle>& regions, GValue* array);

/// When the learned terrain is forgotten by itself.
enum class ResetOn : std::uint8_t { never, stream, discont, per_stream };

/// A settings file: a key file with the group [terrainseg] whose keys are the names of properties.
struct SettingsFile {
  struct Entry {
    std::string name, value; ///< the value as gst-launch would take it
  };
  std::string path;
  std::vector<Entry> entries; ///< in the order of the file
  std::string error;          ///< why it cannot be read; empty when it could
};

SettingsFile read_settings_file(const std::string& path);

/// Everything the streaming thread looks at, as one value that is copied when it changed.
struct ElementSettings {
  Settings core;
  Preset preset = Preset::standard;
  std::string window_rect; ///< as it was set; the core has it in fixed point
  bool overlay = false;
  OverlaySettings drawing;
  bool post_messages = false;
  bool analytics = true;
  ResetOn reset_on = ResetOn::stream;
  std::string model_location;
  std::string settings_location;
  std::string camera_info, mount; ///< both together give metres
  double range_max = 0;           ///< metres, 0 = where the expected error reaches 20 %
  std::string start_time;         ///< wall clock of PTS 0
  std::string veto_roi_types;     ///< types of regions of interest that are vetoes
};

/// The values of all properties. Not locked: the owner holds the object lock around every call.
///
/// What holds for a property is what was set explicitly, else what the settings file says, else what the
/// preset says.
class SettingsBook {
 public:
  static constexpr std::size_t capacity = 96;
  /// A set of properties by their ids.
  using Ids = std::bitset<capacity>;

  /// Installs all properties that set() and get() know; their ids are 1 .. last_id().
  static void install(GObjectClass* object_class);
  static guint last_id();
  /// Tells that properties changed. Not with the object lock held.
  static void notify(gpointer object, const Ids& changed);

  /// Returns the properties that changed.
  Ids set(guint id, const GValue* value);
  void get(guint id, GValue* value) const;
  /// Gives a property back to the preset as if it had never been set; nullptr = all of them. False when there
  /// is none of that name.
  bool unset(const char* name, Ids& changed);
  /// Takes the values of a settings file instead of those of the previous file. On an error nothing changes.
  std::optional<SettingsError> take_file(const SettingsFile& file, Ids& changed);

  const ElementSettings& settings() const { return settings_; }
  /// Counts changes.
  std::uint64_t sequence() const { return sequence_; }
  /// The first thing that is wrong with the values, which the owner reports before it uses them.
  std::optional<SettingsError> error() const;
  /// Names of the properties that were set although the running pipeline does not use them, each once until
  /// forget_told(). Switching off a stage that does not run is not reported.
  std::string take_unused();
  void forget_told() { told_.reset(); }

 private:
  enum class Layer : std::uint8_t { file, user };

  std::array<double, capacity> shown() const;
  template <class Change> Ids changed_by(Change change);
  Ids pinned() const { return explicit_ | from_file_; }
  void apply(guint id, const GValue* value, Layer layer);
  void apply_stages(guint flags, Layer layer);
  void store(guint id, const GValue* value);
  void choose_preset();
  void set_ignore_regions(const GValue* value);
  void give_back(guint id);
  std::optional<SettingsError> apply_entry(const SettingsFile::Entry& entry);

  ElementSettings settings_;
  Ids explicit_;                          ///< set by the user, whatever file and preset say
  Ids from_file_;                         ///< set by the settings file, whatever the preset says
  Ids told_;                              ///< by take_unused()
  std::array<double, capacity> as_set_{}; ///< fractions as they were set, which fixed point would round
  std::optional<SettingsError> regions_error_, rect_error_;
  std::uint64_t sequence_ = 1;
};

} // namespace terrainseg
