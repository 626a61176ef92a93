// SPDX-License-Identifier: LGPL-2.1-or-later
#include <gst/gst.h>

#include "support/elements.hpp"
#include "support/meta.hpp"
#include "terrainseg_config.h"

namespace {

gboolean plugin_init(GstPlugin* plugin) {
  return terrainseg::register_metas() && GST_ELEMENT_REGISTER(terrainseg, plugin) &&
         GST_ELEMENT_REGISTER(terrainextract, plugin) && GST_ELEMENT_REGISTER(terraincombine, plugin) &&
         GST_ELEMENT_REGISTER(terrainoverlay, plugin) && GST_ELEMENT_REGISTER(terrainscenesrc, plugin) &&
         GST_ELEMENT_REGISTER(terrainstamp, plugin);
}

} // namespace

GST_PLUGIN_DEFINE(GST_VERSION_MAJOR, GST_VERSION_MINOR, terrainseg,
                  "Learns the appearance of the ground ahead of a rover and labels what is traversable",
                  plugin_init, TERRAINSEG_VERSION, "LGPL", "terrainseg", TERRAINSEG_ORIGIN)
