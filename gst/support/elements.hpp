// SPDX-License-Identifier: LGPL-2.1-or-later
// The elements, for the plugins that register them.
#pragma once

#include <gst/gst.h>

G_BEGIN_DECLS
GST_ELEMENT_REGISTER_DECLARE(terraincombine)  // video and KLV units back to video with the metadata
GST_ELEMENT_REGISTER_DECLARE(terrainextract)  // one mask, JSON line or KLV unit for each frame's metadata
GST_ELEMENT_REGISTER_DECLARE(terrainmcapsink) // video and terrain metadata as an MCAP recording
GST_ELEMENT_REGISTER_DECLARE(terrainoverlay)  // draws the metadata of a frame onto it
GST_ELEMENT_REGISTER_DECLARE(terrainros2sink) // terrain metadata and video as ROS 2 topics over DDS
GST_ELEMENT_REGISTER_DECLARE(terrainscenesrc) // a rendered rover's view with its truth as metadata
GST_ELEMENT_REGISTER_DECLARE(terrainseg)      // learns the ground ahead and attaches what it knows
GST_ELEMENT_REGISTER_DECLARE(terrainstamp)    // the precision time of each picture in encoded video
G_END_DECLS
