// SPDX-License-Identifier: LGPL-2.1-or-later
// Writes a frame's metadata as a CSV row.
#pragma once

#include <gst/gst.h>

#include <string>

namespace terrainseg::process {

/// The names of the columns, with line end.
extern const char* const csv_header;

/// Replaces `row` by the row of a frame. Columns of the boundary are lists in one field, separated by spaces:
/// metres and radians, `inf` = free, `nan` = unknown. They and the time of day are empty if unknown.
void make_csv_row(std::string& row, GstBuffer* frame, const GstStructure* estimate);

} // namespace terrainseg::process
