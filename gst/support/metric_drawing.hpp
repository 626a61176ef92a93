// SPDX-License-Identifier: LGPL-2.1-or-later
// Metres as marks on a frame and as a map: what the painter draws, worked out.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "exchange/metric_estimate.hpp"
#include "painter/metric_marks.hpp"

namespace terrainseg {

/// Keeps its buffers: nothing is allocated while sizes stay.
class MetricDrawing {
 public:
  /// Marks for a frame of that size, valid until the next call; with the map in that style only.
  MetricMarks make(const Estimate& estimate, const MetricEstimate& metric, OverlayStyle style,
                   int frame_width, int frame_height);

 private:
  static constexpr std::size_t bins = 1024; ///< directions of half a turn ahead

  void add(const MetricMark& mark);
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
  std::array<MetricMark, most_ticks + 16> marks_{};
  std::size_t count_ = 0;
  int side_ = 0;
  std::vector<Place> places_;
  std::vector<std::uint8_t> map_;
  std::array<float, bins> reach_{}; ///< metres of each direction; NaN unknown, below 0 = not in view
};

} // namespace terrainseg
