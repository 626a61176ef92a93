// SPDX-License-Identifier: LGPL-2.1-or-later
// Warnings of an element.
#pragma once

#include <gst/gst.h>

#include <string>

namespace terrainseg {

/// The texts of a warning. The element's own file posts it: warnings posted from headers and shared code have
/// no debug category of the element, and `GST_DEBUG=terrain*` does not show them.
struct Warning {
  std::string text, debug;
};

/// Posts it like GST_ELEMENT_WARNING, with file and category of the element.
#define TERRAINSEG_POST_WARNING(element, domain, code, warning)                                              \
  do {                                                                                                       \
    const terrainseg::Warning& to_post = (warning);                                                          \
    GST_ELEMENT_WARNING((element), domain, code, ("%s", to_post.text.c_str()),                               \
                        ("%s", to_post.debug.c_str()));                                                      \
  } while (false)

} // namespace terrainseg
