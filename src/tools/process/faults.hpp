// SPDX-License-Identifier: LGPL-2.1-or-later
// The table that sorts errors into temporary (exit code 75) and permanent ones (1).
#pragma once

#include <gst/gst.h>

#include <string>

#include "tools/process/cause.hpp"

namespace terrainseg::process {

/// The message and its cause. No cause: no fault.
struct Fault {
  Cause cause = Cause::none;
  std::string text;
};

/// For an errno while writing: Cause::disk if temporary, Cause::unwritable if permanent.
Cause cause_of_writing(int error);
/// For an errno while reading an input: Cause::missing if temporary, Cause::unsupported if permanent.
Cause cause_of_reading(int error);
Cause cause_of_reading(const GError* error); ///< for the domain G_FILE_ERROR
/// "cannot WHAT PATH: text of the errno", with the cause for writing.
Fault cannot(const std::string& what, const std::string& path, int error);

/// For an error message of the source: of the reading element, or of a demuxer or decoder.
Cause cause_in_source(GstMessage* error);
/// For an error message of an element after the source. `writes`: it writes an output.
Cause cause_behind_source(GstMessage* error, bool writes);

} // namespace terrainseg::process
