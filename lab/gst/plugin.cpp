// SPDX-License-Identifier: LGPL-2.1-or-later
// A plugin of its own: the main one needs no OpenCV.
#include <gst/gst.h>

#include "lab/gst/terrainreference.hpp"
#include "support/meta.hpp"
#include "terrainseg_config.h"

namespace {

gboolean plugin_init(GstPlugin* plugin) {
  return terrainseg::register_metas() && GST_ELEMENT_REGISTER(terrainreference, plugin);
}

} // namespace

GST_PLUGIN_DEFINE(GST_VERSION_MAJOR, GST_VERSION_MINOR, terrainreference,
                  "The unmodified terrain learning algorithm, to compare terrainseg with", plugin_init,
                  TERRAINSEG_VERSION, "LGPL", "terrainseg", TERRAINSEG_ORIGIN)
