// SPDX-License-Identifier: LGPL-2.1-or-later
// The boundary in metres as metadata of a buffer (GstTerrainMetricMeta), and back.
#pragma once

#include <gst/gst.h>

#include <array>
#include <vector>

#include "exchange/metric_estimate.hpp"
#include "support/buffer_pool.hpp"

namespace terrainseg {

/// Attaches metres to buffers, in memory that comes back when the frames are gone.
class MetricWriter {
 public:
  /// Attaches `metric` to `buffer` (writable), instead of that of the same `instance`, which is never freed;
  /// "" is none. False when the meta is not registered or there is no memory.
  bool attach(GstBuffer* buffer, const MetricEstimate& metric, const char* instance = "");
  void drop() { pool_.drop(); }

 private:
  SmallPool pool_;
};

/// Reads the metres of a buffer. Holds references and mappings until it is destroyed, so that metric() stays
/// valid even when the buffer goes away before.
class MetricReader {
 public:
  /// Reads the metres that belong to the estimate of the filter of that name; "" is the last that was
  /// attached.
  explicit MetricReader(GstBuffer* buffer, const char* source = "");
  ~MetricReader();
  MetricReader(const MetricReader&) = delete;
  MetricReader& operator=(const MetricReader&) = delete;

  /// False when the buffer carries no metres, or such that make no sense (a program can write anything): see
  /// error().
  explicit operator bool() const { return valid_; }
  /// What was wrong with the metadata; nullptr when there was none to read or nothing was wrong.
  const char* error() const { return error_; }
  const MetricEstimate& metric() const { return metric_; }

 private:
  /// A buffer of little-endian floats, mapped for reading.
  struct Column {
    GstBuffer* buffer = nullptr;
    GstMapInfo map{};
    std::vector<float> host_order; ///< where it cannot be read in place
  };
  const char* read(const GstStructure* fields);
  const char* read_ticks(const GstStructure* fields);
  const char* map(Column& column, GstBuffer* buffer, std::span<const float>& values);

  MetricEstimate metric_;
  std::array<Column, 5> columns_; ///< the four of each column, and the ticks
  std::array<RangeTick, most_ticks> ticks_{};
  bool valid_ = false;
  const char* error_ = nullptr;
};

} // namespace terrainseg
