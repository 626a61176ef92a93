// SPDX-License-Identifier: LGPL-2.1-or-later
// Attaches an estimate and the boundary in metres to a buffer as metadata, and reads them.
#pragma once

#include <gst/gst.h>
#include <gst/video/video.h>

#include <array>
#include <cstdint>
#include <optional>
#include <span>

#include "exchange/metric_estimate.hpp"
#include "support/buffers.hpp"
#include "support/video_frame.hpp"
#include "terrainseg/estimate.hpp"

namespace terrainseg {

/// Attaches `estimate` to `buffer` (writable) as GstTerrainSegMeta. Replaces a meta of the same `instance`;
/// "" is the instance without a name. `instance` must be static or interned. The pixels of estimate.mask are
/// in `mask`, a GRAY8 buffer with a GstVideoMeta; the rows of estimate.boundary in `boundary`, uint16 little-
/// endian; `confidence_map` is a GRAY8 buffer like the mask. The meta takes its own references. Returns false
/// if the meta is not registered.
bool attach(GstBuffer* buffer, const Estimate& estimate, GstBuffer* mask, GstBuffer* boundary,
            const char* instance = "", GstBuffer* confidence_map = nullptr);

/// Returns a new, uninitialised GRAY8 buffer of `width` x `height` with a GstVideoMeta and rows without
/// padding, for attach(); nullptr if memory is exhausted.
GstBuffer* new_mask_buffer(int width, int height);
/// Returns a buffer with these rows for attach(); nullptr if memory is exhausted.
GstBuffer* new_boundary_buffer(std::span<const std::uint16_t> rows);

/// Metadata that was read. Any program can write metadata, so it is validated.
class MetaReader {
 public:
  /// Returns false if the buffer has no metadata, or invalid metadata: see error().
  explicit operator bool() const { return valid_; }
  /// The error in the metadata; nullptr if there is no metadata or it is valid.
  const char* error() const { return error_; }

 protected:
  bool valid_ = false;
  const char* error_ = nullptr;
};

/// Reads the metadata of a buffer. Holds references to and mappings of mask, boundary and confidence map, so
/// estimate() is valid until it is destroyed, even if the buffer is freed earlier.
class EstimateReader : public MetaReader {
 public:
  /// Reads the estimate of the filter with that name; "" = the last attached one of any filter.
  explicit EstimateReader(GstBuffer* buffer, const char* source = "");

  const Estimate& estimate() const { return estimate_; }
  GstBuffer* mask() const { return mask_ ? mask_->buffer() : nullptr; } ///< nullptr without a mask

 private:
  const char* read(const GstStructure* fields);

  Estimate estimate_;
  std::optional<MappedMask> mask_, confidence_map_;
  ValueReader<std::uint16_t> boundary_;
};

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
class MetricReader : public MetaReader {
 public:
  /// Reads the metres of the filter with that name; "" = the last attached ones of any filter.
  explicit MetricReader(GstBuffer* buffer, const char* source = "");

  const MetricEstimate& metric() const { return metric_; }

 private:
  const char* read(const GstStructure* fields);

  MetricEstimate metric_;
  std::array<ValueReader<float>, 5> columns_; ///< ranges, bearings, low, high, and the ticks
  std::array<RangeTick, most_ticks> ticks_{};
};

} // namespace terrainseg
