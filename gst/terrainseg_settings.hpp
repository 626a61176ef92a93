// SPDX-License-Identifier: LGPL-2.1-or-later
// The properties of terrainseg that are settings: their table, presets, and which of them were set
// explicitly.
#pragma once

#include <gst/gst.h>

#include <array>
#include <bitset>
#include <optional>
#include <string>

#include "overlay_properties.hpp"
#include "terrainseg/settings.hpp"

namespace terrainseg {

/// When the learned terrain is forgotten by itself.
enum class ResetOn : std::uint8_t { never, stream, discont };

/// Everything the streaming thread looks at, as one value that is copied when it changed.
struct ElementSettings {
  Settings core;
  bool overlay = false;
  OverlaySettings drawing;
  bool post_messages = false;
  bool analytics = true;
  ResetOn reset_on = ResetOn::stream;
  std::string model_location;
};

/// The values of all properties. Not locked: the owner holds the object lock around every call.
class SettingsBook {
 public:
  /// Installs all properties that set() and get() know; their ids are 1 .. last_id().
  static void install(GObjectClass* object_class);
  static guint last_id();

  /// False when there is no such property.
  bool set(guint id, const GValue* value);
  bool get(guint id, GValue* value) const;
  void set_near_clear(bool clear);

  const ElementSettings& settings() const { return settings_; }
  /// Counts changes.
  std::uint64_t sequence() const { return sequence_; }
  /// The first thing that is wrong with the values, which the owner reports before it uses them.
  std::optional<SettingsError> error() const;

 private:
  static constexpr std::size_t capacity = 64;

  void choose_preset(Preset preset);
  void set_ignore_regions(const GValue* value);

  ElementSettings settings_;
  Preset preset_ = Preset::standard;
  std::bitset<capacity> explicit_; ///< by index into the table: set by the user, whatever the preset says
  std::array<double, capacity> as_set_{}; ///< fractions as they were set, which fixed point would round
  std::optional<SettingsError> regions_error_;
  std::uint64_t sequence_ = 1;
};

} // namespace terrainseg
