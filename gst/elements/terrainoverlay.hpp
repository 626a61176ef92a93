// SPDX-License-Identifier: LGPL-2.1-or-later
// The element `terrainoverlay`: draws what the metadata of a frame says onto it.
#pragma once

#include <gst/gst.h>

G_BEGIN_DECLS
GST_ELEMENT_REGISTER_DECLARE(terrainoverlay)
G_END_DECLS
