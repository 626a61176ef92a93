// SPDX-License-Identifier: LGPL-2.1-or-later
// The standard segmentation metadata, where GStreamer has it (1.26).
#pragma once

#ifdef TERRAINSEG_ANALYTICS

#include <gst/gst.h>

#include "support/buffers.hpp"
#include "terrainseg/estimate.hpp"

namespace terrainseg {

/// Attaches the estimate as GstAnalytics semantic segmentation: region 0 is the rest, region 1 is
/// traversable.
class AnalyticsWriter {
 public:
  /// `estimate.mask` must be readable. False when there is no memory or GStreamer refuses.
  bool attach(GstBuffer* buffer, const Estimate& estimate);
  void drop() { pool_.drop(); }

 private:
  MaskPool pool_;
};

} // namespace terrainseg

#endif
