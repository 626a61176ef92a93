// SPDX-License-Identifier: LGPL-2.1-or-later
#include "freespace/score/terrain_tables.hpp"

namespace terrainseg {

void TerrainTables::learned(const TrainingModels& training, int taught_q8) {
  training_ = training;
  taught_q8_ = taught_q8;
  old_ = true;
}

void TerrainTables::rely_on_memory() {
  old_ |= training_.count > 0;
  training_.count = 0;
}

void TerrainTables::forget() {
  training_.count = 0;
  taught_q8_ = 0;
  old_ = true;
}

const LikelihoodTables& TerrainTables::of(const Terrain& terrain, const Settings& settings) {
  if (old_)
    likelihood_.build(terrain, training_.span(), taught_q8_, settings, tables_);
  old_ = false;
  return tables_;
}

} // namespace terrainseg
