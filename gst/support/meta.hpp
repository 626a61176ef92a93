// SPDX-License-Identifier: LGPL-2.1-or-later
// Registers the custom metas of the plugin: GstTerrainSegMeta, GstTerrainMetricMeta,
// GstTerrainTrainingMeta, GstTerrainVetoMeta, GstTerrainTruthMeta.
#pragma once

#include <gst/gst.h>

namespace terrainseg {

/// Registers what is not registered yet; a second call does nothing. Only plugin_init calls it: consumers
/// look the metas up. False when GStreamer refuses.
bool register_metas();

/// Takes the custom metas called `name` off a buffer that the filter of that instance attached; "" is the
/// name of those that have none.
void remove_metas(GstBuffer* buffer, const char* name, const char* instance);

} // namespace terrainseg
