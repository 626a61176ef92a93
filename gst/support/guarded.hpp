// SPDX-License-Identifier: LGPL-2.1-or-later
// Keeps exceptions inside: none may cross a virtual function of GObject.
#pragma once

#include <exception>
#include <gst/gst.h>

namespace terrainseg {

/// What users know an element by: its factory's name, or its type's where an application derived one that has
/// no factory.
inline const char* name_of_kind(GstElement* element) {
  GstElementFactory* factory = gst_element_get_factory(element);
  return factory ? gst_plugin_feature_get_name(factory) : G_OBJECT_TYPE_NAME(element);
}

/// Runs `body` so that no exception leaves it (out of memory, mostly): the element posts an error that names
/// it, and `failed` is returned.
template <class Result, class Body> Result guarded(gpointer object, Result failed, Body body) {
  auto* element = GST_ELEMENT(object);
  try {
    return body();
  } catch (const std::exception& error) {
    GST_ELEMENT_ERROR(element, LIBRARY, FAILED, ("%s failed: %s", name_of_kind(element), error.what()),
                      ("exception: %s", error.what()));
  } catch (...) {
    GST_ELEMENT_ERROR(element, LIBRARY, FAILED, ("%s failed", name_of_kind(element)), ("unknown exception"));
  }
  return failed;
}

} // namespace terrainseg
