// SPDX-License-Identifier: LGPL-2.1-or-later
// The stages that Segmenter::stage_times() measures.
#pragma once

#include <cstdint>

#include "terrainseg/export.hpp"

namespace terrainseg {

/// What stage_times() tells apart, in the order of the default pipeline.
enum class Stage : std::uint8_t {
  pyramid,    ///< the octave pyramid, and in the paper's pipeline the level that trains
  features,   ///< colour, texture and exposure of the cells, their bins, which of them are joined; nothing in
              ///< the paper's pipeline
  prefilter,  ///< the window: its cells, their pre-filter, whether they are foreign
  clustering, ///< training models
  update,     ///< of what is learned: the mixture, the histograms
  horizon,    ///< the paper's
  scoring,    ///< of the cells: likelihood ratios, penalties, averaging over frames
  boundary,   ///< and what follows from it: re-estimation, ground behind, doubtful ground, refinement, odd
              ///< spots, what motion tells, reach, the horizon's row
  mask        ///< written, how much of it is traversable, and how sure it is of each cell
};
inline constexpr int stage_count = 9;
TERRAINSEG_API const char* name_of(Stage stage);

} // namespace terrainseg
