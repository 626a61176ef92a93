// SPDX-License-Identifier: LGPL-2.1-or-later
// The training window and the ignored regions, edited with a pointer in a video window downstream.
#pragma once

#include <gst/gst.h>

namespace terrainseg {

struct Shared;

/// Takes a navigation event in pixels of the element's frames (elements that scale have rewritten it): sets
/// properties of `element`, notifies, and posts the message terrainseg-region.
void edit_regions(GstElement* element, Shared& shared, GstEvent* event);

} // namespace terrainseg
