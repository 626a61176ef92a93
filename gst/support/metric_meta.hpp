// SPDX-License-Identifier: LGPL-2.1-or-later
// Attaches the boundary in metres to a buffer as metadata (GstTerrainMetricMeta), and reads it.
#pragma once

#include <gst/gst.h>

#include <array>
#include <span>

#include "exchange/metric_estimate.hpp"
#include "support/buffers.hpp"

namespace terrainseg {

/// Attaches metres to buffers, with pooled memory.
class MetricWriter {
 public:
  /// Attaches `metric` to `buffer` (writable). Replaces a meta of the same `instance`, which must be a static
  /// string; "" = no name. Returns false if the meta is not registered or memory is exhausted.
  bool attach(GstBuffer* buffer, const MetricEstimate& metric, const char* instance = "");
  void drop() { pool_.drop(); }

 private:
  SmallPool pool_;
};

/// Reads the metres of a buffer. Holds references and mappings, so metric() is valid until it is destroyed,
/// even if the buffer is freed earlier.
class MetricReader {
 public:
  /// Reads the metres of the filter with that name; "" = the last attached ones of any filter.
  explicit MetricReader(GstBuffer* buffer, const char* source = "");

  /// Returns false if the buffer has no metres, or invalid ones: see error().
  explicit operator bool() const { return valid_; }
  /// The error in the metadata; nullptr if there is no metadata or it is valid.
  const char* error() const { return error_; }
  const MetricEstimate& metric() const { return metric_; }

 private:
  const char* read(const GstStructure* fields);
  const char* read_ticks(const GstStructure* fields);
  const char* map(ValueReader<float>& column, GstBuffer* buffer, std::span<const float>& values);

  MetricEstimate metric_;
  std::array<ValueReader<float>, 5> columns_; ///< ranges, bearings, low, high, and the ticks
  std::array<RangeTick, most_ticks> ticks_{};
  bool valid_ = false;
  const char* error_ = nullptr;
};

} // namespace terrainseg
