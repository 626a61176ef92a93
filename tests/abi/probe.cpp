// SPDX-License-Identifier: LGPL-2.1-or-later
// Every type of the public headers, so that their layout is in this object's debug information.
#include <gst/terrainseg/terrainsegmeta.h>

#include "terrainseg/estimate.hpp"
#include "terrainseg/frame.hpp"
#include "terrainseg/segmenter.hpp"
#include "terrainseg/settings.hpp"
#include "terrainseg/settings_table.hpp"
#include "terrainseg/supervision.hpp"
#include "terrainseg/terrain.hpp"

#define SHOWN __attribute__((visibility("default")))

namespace terrainseg::abi {

SHOWN void frames(const Frame*, const MutableFrame*, const FormatLayout*, const Colorimetry*,
                  const Rectangle*) {}
SHOWN void answers(const Estimate*, const ModelSummary*, const GrayView*, Flag) {}
SHOWN void learned(const Terrain*, const ColorSpace*, const TerrainModel*) {}
SHOWN void settings(const Settings*, const SettingsError*, const Setting*, const Choice*, Preset,
                    PipelineKind) {}
SHOWN void filter(const Segmenter*, const Status*, const Counters*, const MaskTarget*, const Supervision*,
                  const Veto*, Stage) {}
SHOWN void metadata(GstTerrainSegFlags, GstTerrainMetricFlags) {}

} // namespace terrainseg::abi
