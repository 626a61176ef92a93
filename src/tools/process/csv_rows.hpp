// SPDX-License-Identifier: LGPL-2.1-or-later
// A frame's metadata as a row of the CSV.
#pragma once

#include <gst/gst.h>

#include <string>

namespace terrainseg::process {

/// Names of the columns, with the line's end.
extern const char* const csv_header;

/// Puts the row of a frame and its estimate in place of what `row` holds. Columns of the boundary are lists
/// in one field, a number for each, with spaces in between: metres and radians, `inf` = free, `nan` =
/// unknown. They and the time of day are empty where there is none.
void make_csv_row(std::string& row, GstBuffer* frame, const GstStructure* estimate);

} // namespace terrainseg::process
