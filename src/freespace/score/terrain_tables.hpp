// SPDX-License-Identifier: LGPL-2.1-or-later
// Caches the likelihood tables of the terrain and recomputes them when it has changed.
#pragma once

#include "freespace/score/likelihood.hpp"
#include "learning/clustering.hpp"

namespace terrainseg {

class TerrainTables {
 public:
  /// Stores the training models of a learned window, and its share of the picture (Q8).
  void learned(const TrainingModels& training, int taught_q8);
  /// This frame's window is not learned: the tables use the terrain only.
  void rely_on_memory();
  /// The terrain was replaced.
  void forget();

  const LikelihoodTables& of(const Terrain& terrain, const Settings& settings);

 private:
  Likelihood likelihood_;
  LikelihoodTables tables_;
  TrainingModels training_; ///< of the last frame; empty when its window was not learned
  int taught_q8_ = 0;
  bool old_ = true;
};

} // namespace terrainseg
