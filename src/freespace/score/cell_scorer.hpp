// SPDX-License-Identifier: LGPL-2.1-or-later
// Scores the cells of a frame.
#pragma once

#include "freespace/score/coherence.hpp"
#include "freespace/score/geodesic.hpp"
#include "freespace/score/local_reference.hpp"
#include "freespace/score/scores.hpp"
#include "freespace/score/terrain_tables.hpp"

namespace terrainseg {

struct View;

class CellScorer {
 public:
  /// Colour and texture speak for and against a cell; its distance from the trusted ground and upright
  /// edges speak against it.
  /// `trusted` are the window's cells that vouch for the ground: none where what is in front has not been
  /// looked at.
  Scores score(const View& view, const Vouched& trusted, bool continued, CellScores& average,
               TerrainTables& tables, const Terrain& terrain);

 private:
  UprightCoherence coherence_;
  LocalReference local_reference_;
  ColorSteps steps_;
  GeodesicPenalty geodesic_;
  CellPenalties penalty_;
  CellScores score_;
};

} // namespace terrainseg
