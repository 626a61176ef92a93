// SPDX-License-Identifier: LGPL-2.1-or-later
// The element `terrainextract`: one mask picture, JSON line or KLV unit for every frame with the metadata.
#pragma once

#include <gst/gst.h>

G_BEGIN_DECLS
GST_ELEMENT_REGISTER_DECLARE(terrainextract)
G_END_DECLS
