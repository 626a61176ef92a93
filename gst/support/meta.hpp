// SPDX-License-Identifier: LGPL-2.1-or-later
// Registers the custom metas of the plugin: GstTerrainSegMeta, GstTerrainMetricMeta,
// GstTerrainTrainingMeta, GstTerrainVetoMeta, GstTerrainTruthMeta.
#pragma once

#include <gst/gst.h>

namespace terrainseg {

/// Registers the metas that are not registered yet. Only plugin_init calls it; consumers look the metas up.
/// Returns false if GStreamer refuses.
bool register_metas();

/// Removes the custom metas `name` of the filter `instance` from a buffer; "" = filters without a name.
void remove_metas(GstBuffer* buffer, const char* name, const char* instance);

} // namespace terrainseg
