// SPDX-License-Identifier: LGPL-2.1-or-later
// The part of the element that any thread may touch.
#pragma once

#include <gst/gst.h>

#include <atomic>

#include "elements/terrainseg/events.hpp"
#include "elements/terrainseg/learned_terrain.hpp"
#include "elements/terrainseg/settings_book.hpp"
#include "elements/terrainseg/statistics.hpp"
#include "support/mutex.hpp"
#include "support/properties.hpp"
#include "support/warnings.hpp"

// The category that all of the element's sources log and post under: GST_DEBUG=terrainseg:5.
GST_DEBUG_CATEGORY_EXTERN(terrainseg_debug);
#define GST_CAT_DEFAULT terrainseg_debug

namespace terrainseg {

struct Shared {
  InternedName instance;
  std::atomic<bool> navigation = false;
  std::atomic<int> frame_width = 0, frame_height = 0; ///< of the caps
  LearnedTerrain learned;                             ///< locks by itself

  Mutex mutex; ///< held for copies only, never while a frame is processed
  SettingsBook book TERRAINSEG_GUARDED_BY(mutex);
  Statistics statistics TERRAINSEG_GUARDED_BY(mutex);
  RegionDrawer drawer TERRAINSEG_GUARDED_BY(mutex);
  Once<> pose_flaw TERRAINSEG_GUARDED_BY(mutex); ///< of this start
};

} // namespace terrainseg
