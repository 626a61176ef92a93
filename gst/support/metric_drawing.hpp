// SPDX-License-Identifier: LGPL-2.1-or-later
// Draws an estimate on a frame, with marks and a map that show its metres.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "exchange/metric_estimate.hpp"
#include "painter/metric_marks.hpp"

namespace terrainseg {

/// Keeps its buffers: allocates only when sizes change.
class MetricDrawing {
 public:
  /// `metric` is nullptr if there are no metres. A map of them only in the style for it.
  void draw(const MutableFrame& frame, const Estimate& estimate, const MetricEstimate* metric,
            const PaintStyle& style);

 private:
  static constexpr std::size_t bins = 1024; ///< directions of the half circle ahead

  MetricMarks make(const Estimate& estimate, const MetricEstimate& metric, OverlayStyle style,
                   int frame_width, int frame_height);
  void add_ticks(const Estimate& estimate, const MetricEstimate& metric, int width, int height);
  void add_boundary(const Estimate& estimate, const MetricEstimate& metric, int width, int height);
  void size_map(int side);
  void fill_bins(const MetricEstimate& metric);
  void edge_sideways();
  void add_ring_labels(double ring, double shown, const MetricMarks& out);
  void draw_map(const MetricEstimate& metric, MetricMarks& out);

  struct Place {
    float distance;    ///< pixels from the vehicle
    std::uint16_t bin; ///< direction, `bins` = behind
  };
  std::vector<MetricMark> marks_;
  int side_ = 0;
  std::vector<Place> places_;
  std::vector<std::uint8_t> map_;
  std::array<float, bins>
      reach_{}; ///< range of each direction in metres; NaN = unknown, negative = not visible
};

} // namespace terrainseg
