// SPDX-License-Identifier: LGPL-2.1-or-later
// A property with the name of a terrainseg instance.
#pragma once

#include <gst/gst.h>

#include <atomic>

namespace terrainseg {

/// The name as an interned string, which any thread may read without a lock; "" = none. Interned names are
/// never freed; programs set only a few.
class NameProperty {
 public:
  void set(const GValue* value) {
    const gchar* text = g_value_get_string(value);
    name_ = text && *text ? g_intern_string(text) : "";
  }
  void get(GValue* value) const {
    const char* name = name_;
    g_value_set_static_string(value, *name ? name : nullptr);
  }
  const char* name() const { return name_; }

  static void install(GObjectClass* object_class, guint id, const char* name, const char* nick,
                      const char* blurb) {
    g_object_class_install_property(
        object_class, id,
        g_param_spec_string(name, nick, blurb, nullptr,
                            static_cast<GParamFlags>(G_PARAM_READWRITE | G_PARAM_STATIC_STRINGS |
                                                     GST_PARAM_MUTABLE_PLAYING)));
  }
  /// For an element that reads metadata.
  static void install_source(GObjectClass* object_class, guint id) {
    install(object_class, id, "source", "Source",
            "Name (property instance) of the terrainseg element whose metadata is used; none = the metadata "
            "attached last");
  }

 private:
  std::atomic<const char*> name_ = "";
};

} // namespace terrainseg
