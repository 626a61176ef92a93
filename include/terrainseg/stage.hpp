// SPDX-License-Identifier: LGPL-2.1-or-later
// The stages that Segmenter::stage_times() measures.
#pragma once

#include <cstdint>

#include "terrainseg/export.hpp"

namespace terrainseg {

/// The stages that stage_times() measures, in the order of the default pipeline.
enum class Stage : std::uint8_t {
  pyramid,    ///< the octave pyramid; in the paper's pipeline also the level for training
  features,   ///< colour, texture and exposure of the cells, their bins, and the ground connected to the
              ///< window; unused in the paper's pipeline
  prefilter,  ///< the training window: its cells, their pre-filter, the check for obstacles
  clustering, ///< clustering of the training models
  update,     ///< update of the learned models and histograms
  horizon,    ///< the paper's horizon (stage D)
  scoring,    ///< scores of the cells: likelihood ratios, penalties, averaging over frames
  boundary,   ///< the boundary and the stages that depend on it: re-estimation, ground behind obstacles,
              ///< doubtful ground, refinement, odd spots, motion, connected free space, horizon row
  mask        ///< the mask, its traversable share, and the confidence map
};
inline constexpr int stage_count = 9;
TERRAINSEG_API const char* name_of(Stage stage);

} // namespace terrainseg
