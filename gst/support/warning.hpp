// SPDX-License-Identifier: LGPL-2.1-or-later
// What an element warns of.
#pragma once

#include <gst/gst.h>

#include <string>

namespace terrainseg {

/// The texts of a warning on the bus. The element itself posts it: what headers and rooms post is in the log
/// without the element's category, where `GST_DEBUG=terrain*` does not find it.
struct Warning {
  std::string text, debug;
};

/// Posts it as GST_ELEMENT_WARNING does, from the element's own file and so under its category.
#define TERRAINSEG_POST_WARNING(element, domain, code, warning)                                              \
  do {                                                                                                       \
    const terrainseg::Warning& to_post = (warning);                                                          \
    GST_ELEMENT_WARNING((element), domain, code, ("%s", to_post.text.c_str()),                               \
                        ("%s", to_post.debug.c_str()));                                                      \
  } while (false)

} // namespace terrainseg
