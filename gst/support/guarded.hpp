// SPDX-License-Identifier: LGPL-2.1-or-later
// Catches exceptions, which must not leave a virtual function of GObject.
#pragma once

#include <exception>
#include <gst/gst.h>

namespace terrainseg {

/// The name of an element for users: its factory's, or its type's for a derived class without a factory.
inline const char* name_of_kind(GstElement* element) {
  GstElementFactory* factory = gst_element_get_factory(element);
  return factory ? gst_plugin_feature_get_name(factory) : G_OBJECT_TYPE_NAME(element);
}

/// Runs `body`. If it throws (mostly out of memory), the element posts an error with the exception's text,
/// and `failed` is returned.
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
