// SPDX-License-Identifier: LGPL-2.1-or-later
// Computes the scores of a frame's cells.
#pragma once

#include "freespace/score/coherence.hpp"
#include "freespace/score/geodesic.hpp"
#include "freespace/score/likelihood.hpp"
#include "freespace/score/scores.hpp"

namespace terrainseg {

struct View;

class CellScorer {
 public:
  /// Colour and texture give evidence for and against ground; the distance from the trusted ground and
  /// upright edges give evidence against it. `trusted` are the window's cells that vouch for the ground;
  /// empty when the window was not examined.
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
