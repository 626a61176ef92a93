// SPDX-License-Identifier: LGPL-2.1-or-later
// The element `terrainros2sink`: terrain metadata and video as ROS 2 topics over DDS.
#pragma once

#include <gst/gst.h>

G_BEGIN_DECLS
GST_ELEMENT_REGISTER_DECLARE(terrainros2sink)
G_END_DECLS
