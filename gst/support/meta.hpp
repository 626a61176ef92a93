// SPDX-License-Identifier: LGPL-2.1-or-later
// Registers, removes and scales the custom metas of the plugin: GstTerrainSegMeta, GstTerrainMetricMeta,
// GstTerrainTrainingMeta, GstTerrainVetoMeta, GstTerrainTruthMeta.
#pragma once

#include <gst/gst.h>

#include <algorithm>

namespace terrainseg {

/// Registers the metas that are not registered yet. Only plugin_init calls it; consumers look the metas up.
/// Returns false if GStreamer refuses.
bool register_metas();

/// Removes the custom metas `name` of the filter `instance` from a buffer; "" = filters without a name.
void remove_metas(GstBuffer* buffer, const char* name, const char* instance);

/// How the coordinates of one axis change when a picture is scaled from one size to another.
struct Axis {
  int from, to;
  int edge(int position) const {
    return static_cast<int>(std::min<guint64>(gst_util_uint64_scale_int(position, to, from), G_MAXINT));
  }
  int row(int position) const {
    return std::min(static_cast<int>(gst_util_uint64_scale_int_round(position, to, from)), to - 1);
  }
};

} // namespace terrainseg
