// SPDX-License-Identifier: LGPL-2.1-or-later
// The tables of what is learned, made anew where that has changed.
#pragma once

#include "freespace/score/likelihood.hpp"
#include "learning/clustering.hpp"

namespace terrainseg {

class TerrainTables {
 public:
  /// A window has taught these models, and so much of the picture (Q8).
  void learned(const TrainingModels& training, int taught_q8);
  /// This frame's window is not learned: only what was learned before counts.
  void rely_on_memory();
  /// The terrain is another one now.
  void forget();

  const LikelihoodTables& of(const Terrain& terrain, const Settings& settings);

 private:
  Likelihood likelihood_;
  LikelihoodTables tables_;
  TrainingModels training_; ///< of the last frame; none where its window was not learned
  int taught_q8_ = 0;
  bool old_ = true;
};

} // namespace terrainseg
