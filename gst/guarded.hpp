// SPDX-License-Identifier: LGPL-2.1-or-later
// Keeps exceptions inside: none may cross a virtual function of GObject.
#pragma once

#include <exception>
#include <gst/gst.h>

namespace terrainseg {

/// Runs `body` so that no exception leaves it (out of memory, mostly): the element posts an error that names
/// it, and `failed` is returned.
template <class Result, class Body> Result guarded(gpointer object, Result failed, Body body) {
  auto* element = GST_ELEMENT(object);
  const char* name = gst_plugin_feature_get_name(gst_element_get_factory(element));
  try {
    return body();
  } catch (const std::exception& error) {
    GST_ELEMENT_ERROR(element, LIBRARY, FAILED, ("%s failed: %s", name, error.what()),
                      ("exception: %s", error.what()));
  } catch (...) {
    GST_ELEMENT_ERROR(element, LIBRARY, FAILED, ("%s failed", name), ("unknown exception"));
  }
  return failed;
}

} // namespace terrainseg
