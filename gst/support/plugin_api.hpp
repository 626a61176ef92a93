// SPDX-License-Identifier: LGPL-2.1-or-later
// Information for the documentation tools about a class.
#pragma once

#include <gst/gst.h>

namespace terrainseg {

/// Marks the enumerations and flags of a class's properties as plugin API, so that they are documented. Call
/// at the end of class_init.
inline void mark_enums_as_plugin_api(GObjectClass* object_class) {
  guint count = 0;
  GParamSpec** specs = g_object_class_list_properties(object_class, &count);
  for (guint i = 0; i < count; ++i)
    if (specs[i]->owner_type == G_OBJECT_CLASS_TYPE(object_class) &&
        (G_IS_PARAM_SPEC_ENUM(specs[i]) || G_IS_PARAM_SPEC_FLAGS(specs[i])))
      gst_type_mark_as_plugin_api(specs[i]->value_type, static_cast<GstPluginAPIFlags>(0));
  g_free(specs);
}

} // namespace terrainseg
