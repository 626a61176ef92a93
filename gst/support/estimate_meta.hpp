// SPDX-License-Identifier: LGPL-2.1-or-later
// An estimate as metadata of a buffer, and back.
#pragma once

#include <gst/gst.h>
#include <gst/video/video.h>

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "support/buffer_pool.hpp"
#include "support/video_frame.hpp"
#include "terrainseg/estimate.hpp"

namespace terrainseg {

/// Attaches `estimate` to `buffer` (writable) as GstTerrainSegMeta, instead of one of the same `instance`
/// that it already has; "" is the name of those that have none. `instance` is never freed. `mask` is the
/// GRAY8 buffer with a GstVideoMeta and `boundary` the uint16 little-endian rows that hold what estimate.mask
/// and estimate.boundary show, `confidence_map` a GRAY8 buffer like the mask; the meta takes references of
/// its own. False when the meta is not registered.
bool attach(GstBuffer* buffer, const Estimate& estimate, GstBuffer* mask, GstBuffer* boundary,
            const char* instance = "", GstBuffer* confidence_map = nullptr);

/// A new GRAY8 buffer of `width` x `height` with its GstVideoMeta, rows without padding, not initialised:
/// what attach() wants as a mask. nullptr when there is no memory.
GstBuffer* new_mask_buffer(int width, int height);
/// Gives `buffer`, of width * height bytes, the GstVideoMeta of a mask with rows without padding.
GstVideoMeta* describe_mask(GstBuffer* buffer, int width, int height);
/// Writes rows as the metadata has them: uint16 little-endian, 2 * rows.size() bytes.
void write_boundary(std::span<const std::uint16_t> rows, guint8* bytes);
/// A new buffer with these rows (tests, fuzzers and benchmarks make such), or one of a pool: what attach()
/// wants as a boundary. nullptr when there is no memory.
GstBuffer* new_boundary_buffer(std::span<const std::uint16_t> rows);
OwnedBuffer boundary_buffer(SmallPool& pool, std::span<const std::uint16_t> rows);

/// Reads the metadata of a buffer. Holds references and mappings of mask, boundary and confidence map until
/// it is destroyed, so that estimate() stays valid even when the buffer goes away before.
class EstimateReader {
 public:
  /// Reads the estimate of the filter of that name; "" is the last one that was attached, by whomever.
  explicit EstimateReader(GstBuffer* buffer, const char* source = "");
  ~EstimateReader();
  EstimateReader(const EstimateReader&) = delete;
  EstimateReader& operator=(const EstimateReader&) = delete;

  /// False when the buffer carries no metadata, or metadata that makes no sense (a program can write
  /// anything): see error().
  explicit operator bool() const { return valid_; }
  /// What was wrong with the metadata; nullptr when there was none to read or nothing was wrong.
  const char* error() const { return error_; }
  const Estimate& estimate() const { return estimate_; }
  GstBuffer* mask() const { return mask_; }         ///< nullptr when the meta has none
  GstBuffer* boundary() const { return boundary_; } ///< nullptr when the meta has none

 private:
  const char* read(const GstStructure* fields);
  const char* map_mask();
  const char* map_boundary();

  Estimate estimate_;
  GstBuffer* mask_ = nullptr;
  GstBuffer* boundary_ = nullptr;
  GstBuffer* confidence_map_ = nullptr;
  std::optional<MappedMask> mask_map_, confidence_map_map_;
  GstMapInfo boundary_map_{};
  std::vector<std::uint16_t> host_order_; ///< where the boundary cannot be read in place
  bool valid_ = false;
  const char* error_ = nullptr;
};

} // namespace terrainseg
