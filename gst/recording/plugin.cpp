// SPDX-License-Identifier: LGPL-2.1-or-later
// A separate plugin, so that the main one does not depend on zstd.
#include <gst/gst.h>

#include "support/elements.hpp"
#include "support/meta.hpp"
#include "terrainseg_config.h"

namespace {

gboolean plugin_init(GstPlugin* plugin) {
  return terrainseg::register_metas() && GST_ELEMENT_REGISTER(terrainmcapsink, plugin);
}

} // namespace

GST_PLUGIN_DEFINE(GST_VERSION_MAJOR, GST_VERSION_MINOR, terrainmcap,
                  "Records terrain metadata for Foxglove and ROS 2", plugin_init, TERRAINSEG_VERSION, "LGPL",
                  "terrainseg", TERRAINSEG_ORIGIN)
