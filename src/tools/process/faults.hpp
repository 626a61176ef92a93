// SPDX-License-Identifier: LGPL-2.1-or-later
// The one table that sorts errors: which may pass by themselves (exit code 75), and which last (1).
#pragma once

#include <gst/gst.h>

#include <string>

#include "tools/process/cause.hpp"

namespace terrainseg::process {

/// What is wrong, for people and for scripts; no cause: nothing is wrong.
struct Fault {
  Cause cause = Cause::none;
  std::string text;
};

/// Of an errno while writing: Cause::disk where it may pass, Cause::unwritable where it lasts.
Cause cause_of_writing(int error);
/// Of an errno while reading an input: Cause::missing where it may pass, Cause::unsupported where it lasts.
Cause cause_of_reading(int error);
Cause cause_of_reading(const GError* error); ///< of G_FILE_ERROR
/// "cannot WHAT PATH: the system's words", with the cause of writing.
Fault cannot(const std::string& what, const std::string& path, int error);

/// Of an error message of the source: of the element that reads, or of one that demuxes or decodes.
Cause cause_in_source(GstMessage* error);
/// Of an error message of an element behind the source; `writes`: it writes an output.
Cause cause_behind_source(GstMessage* error, bool writes);

} // namespace terrainseg::process
