// SPDX-License-Identifier: LGPL-2.1-or-later
#include "base/stage_clock.hpp"

namespace terrainseg {

const char* name_of(Stage stage) {
  constexpr const char* names[stage_count] = {"pyramid", "features", "prefilter", "clustering", "update",
                                              "horizon", "scoring",  "boundary",  "mask"};
  return names[static_cast<int>(stage)];
}

} // namespace terrainseg
