// SPDX-License-Identifier: LGPL-2.1-or-later
// A separate plugin, so that the main one does not depend on Cyclone DDS.
#include <gst/gst.h>

#include "support/elements.hpp"
#include "support/meta.hpp"
#include "terrainseg_config.h"

namespace {

gboolean plugin_init(GstPlugin* plugin) {
  return terrainseg::register_metas() && GST_ELEMENT_REGISTER(terrainros2sink, plugin);
}

} // namespace

GST_PLUGIN_DEFINE(GST_VERSION_MAJOR, GST_VERSION_MINOR, terrainros2,
                  "Terrain metadata as ROS 2 topics over DDS", plugin_init, TERRAINSEG_VERSION, "LGPL",
                  "terrainseg", TERRAINSEG_ORIGIN)
