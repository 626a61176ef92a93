// SPDX-License-Identifier: LGPL-2.1-or-later
// The element `terrainmcapsink`: video and terrain metadata as an MCAP recording.
#pragma once

#include <gst/gst.h>

G_BEGIN_DECLS
GST_ELEMENT_REGISTER_DECLARE(terrainmcapsink)
G_END_DECLS
