// SPDX-License-Identifier: LGPL-2.1-or-later
#include "support/metric_drawing.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace terrainseg {
namespace {

constexpr float not_in_view = -1;
constexpr double farthest_shown = 15; ///< range of the map in metres; farther details are too small
constexpr int largest_side = 480;
/// Positions of the numbers along the boundary, as fractions of it.
constexpr double numbered[] = {0.1, 0.3, 0.5, 0.7, 0.9};

int decimetres_of(double metres) {
  return static_cast<int>(std::lround(std::clamp(metres, 0.0, 9999.0) * 10));
}

/// Metres from the vehicle to the upper edge of the map, and between two rings.
struct Scale {
  double shown, ring;
};
Scale scale_for(double range_max) {
  constexpr Scale scales[] = {{1, 0.5}, {2, 0.5}, {3, 1}, {5, 1}, {7, 2}, {10, 2}, {farthest_shown, 5}};
  for (const Scale& scale : scales)
    if (range_max <= scale.shown)
      return scale;
  return scales[std::size(scales) - 1];
}

/// Row of the drawn frame for a row of the boundary.
int row_of(int boundary_row, const Estimate& e, int height) {
  return static_cast<int>(std::int64_t{boundary_row} * height / std::max(e.frame_height, 1));
}

} // namespace

/// Only on free ground: beyond the boundary a mark would be on an obstacle.
void MetricDrawing::add_ticks(const Estimate& e, const MetricEstimate& m, int width, int height) {
  const int apart = 2 * metric_digit_height(height);
  int last = height + apart;
  for (const RangeTick& tick : m.ticks) {
    const int x = static_cast<int>(tick.column * static_cast<float>(width));
    const int y = static_cast<int>(tick.row * static_cast<float>(height));
    const auto columns = static_cast<std::int64_t>(e.boundary.size());
    const double at = tick.column * e.frame_width - e.mask_region.x;
    const auto column = std::clamp<std::int64_t>(
        static_cast<std::int64_t>(at * static_cast<double>(columns) / std::max(e.mask_region.width, 1)), 0,
        columns - 1);
    const int end = row_of(e.boundary[static_cast<std::size_t>(column)], e, height);
    if (y < end + apart / 2 || last - y < apart)
      continue;
    marks_.push_back({MetricMark::Kind::tick, x, y, decimetres_of(tick.range)});
    last = y;
  }
}

void MetricDrawing::add_boundary(const Estimate& e, const MetricEstimate& m, int width, int height) {
  for (const double share : numbered) {
    const auto column = static_cast<std::size_t>(share * static_cast<double>(m.ranges.size()));
    if (!std::isfinite(m.ranges[column]))
      continue;
    const double x = e.mask_region.x + (static_cast<double>(column) + 0.5) * e.mask_region.width /
                                           static_cast<double>(m.ranges.size());
    marks_.push_back({MetricMark::Kind::boundary, static_cast<int>(x * width / std::max(e.frame_width, 1)),
                      row_of(e.boundary[column], e, height), decimetres_of(m.ranges[column])});
  }
}

void MetricDrawing::size_map(int side) {
  if (side == side_)
    return;
  side_ = side;
  map_.resize(static_cast<std::size_t>(side) * side);
  places_.resize(map_.size());
  for (int y = 0; y < side; ++y)
    for (int x = 0; x < side; ++x) {
      const double ahead = side - 1 - y, left = (side - 1) / 2.0 - x;
      const double turn = 0.5 - std::atan2(left, ahead) / std::numbers::pi; // 0 = left .. 1 = right
      places_[static_cast<std::size_t>(y) * side + x] = {
          static_cast<float>(std::hypot(ahead, left)),
          static_cast<std::uint16_t>(std::clamp(turn * bins, 0.0, bins - 1.0))};
    }
}

/// The shortest range of each direction; between two columns with a gap, the shorter of both.
void MetricDrawing::fill_bins(const MetricEstimate& m) {
  reach_.fill(not_in_view);
  int before = -1;
  float range_before = 0;
  for (std::size_t i = 0; i < m.ranges.size(); ++i) {
    if (std::isnan(m.bearings[i]) || !(std::abs(m.bearings[i]) < std::numbers::pi / 2)) {
      before = -1;
      continue;
    }
    const double turn = 0.5 - m.bearings[i] / std::numbers::pi;
    const int bin = static_cast<int>(std::clamp(turn * bins, 0.0, bins - 1.0));
    const float range = m.ranges[i];
    const auto least = [](float a, float b) {
      return std::isnan(a) || std::isnan(b) ? a + b : std::min(a, b);
    };
    const int first = before < 0 ? bin : std::min(before, bin),
              last = before < 0 ? bin : std::max(before, bin);
    for (int k = first; k <= last; ++k) {
      float& reach = reach_[static_cast<std::size_t>(k)];
      const float here = before < 0 ? range : least(range, range_before);
      reach = reach == not_in_view ? here : least(reach, here);
    }
    before = bin;
    range_before = range;
  }
}

/// Where free ground ends sideways, as along a wall.
void MetricDrawing::edge_sideways() {
  constexpr int thick = 2;
  for (int y = 0; y < side_; ++y) {
    std::uint8_t* const row = map_.data() + static_cast<std::size_t>(y) * side_;
    for (int x = 0; x < side_; ++x) {
      const Place& place = places_[static_cast<std::size_t>(y) * side_ + x];
      if (row[x] != map_outside || !std::isfinite(reach_[place.bin]) || reach_[place.bin] == not_in_view)
        continue;
      for (int near = std::max(x - thick, 0); near <= std::min(x + thick, side_ - 1); ++near)
        if (row[near] == map_free)
          row[x] = map_obstacle;
    }
  }
}

void MetricDrawing::draw_map(const MetricEstimate& m, MetricMarks& out) {
  fill_bins(m);
  const Scale scale = scale_for(m.range_max);
  const auto per_pixel = static_cast<float>(scale.shown / (side_ - 1));
  const auto ring = static_cast<float>(scale.ring), edge = 2.5F * per_pixel;
  const auto vehicle = static_cast<float>(side_) / 24;
  for (std::size_t i = 0; i < map_.size(); ++i) {
    const float distance = places_[i].distance, metres = distance * per_pixel;
    const float reach = reach_[places_[i].bin];
    const bool on_ring = metres - ring * std::floor(metres / ring) < per_pixel && metres > ring / 2;
    map_[i] = distance < vehicle                         ? map_vehicle
              : reach == not_in_view                     ? on_ring ? map_ring : map_outside
              : std::isnan(reach)                        ? map_unknown
              : metres >= reach && metres < reach + edge ? map_obstacle
              : on_ring                                  ? map_ring
              : metres < reach                           ? map_free
                                                         : map_outside;
  }
  edge_sideways();
  out.map = {{map_.data(), side_}, side_, side_};
  add_ring_labels(scale.ring, scale.shown, out);
}

/// Half of them on the left, where they hide little.
void MetricDrawing::add_ring_labels(double ring, double shown, const MetricMarks& out) {
  const double pixels = (side_ - 1) / shown, diagonal = std::numbers::sqrt2 / 2;
  if (ring * pixels * diagonal < 2 * metric_digit_height(side_ * 5 / 2))
    return;
  for (int number = 1; number * ring < shown; ++number) {
    const double metres = number * ring;
    const int aside = static_cast<int>(metres * pixels * diagonal);
    marks_.push_back({MetricMark::Kind::ring, out.map_x + side_ / 2 - aside, out.map_y + side_ - 1 - aside,
                      decimetres_of(metres)});
  }
}

MetricMarks MetricDrawing::make(const Estimate& e, const MetricEstimate& m, OverlayStyle style, int width,
                                int height) {
  marks_.clear();
  marks_.reserve(most_ticks + 16); // all there can be: only the first frame allocates
  MetricMarks out;
  if (e.boundary.size() != m.ranges.size() || m.ranges.empty())
    return out;
  add_ticks(e, m, width, height);
  add_boundary(e, m, width, height);
  if (style == OverlayStyle::map) {
    const int side = std::clamp(std::min(width, height) * 2 / 5, 16, largest_side);
    const int gap = std::max(height / 60, 1);
    out.map_x = width - side - gap;
    out.map_y = gap;
    size_map(side);
    draw_map(m, out);
  }
  out.marks = marks_;
  return out;
}

void MetricDrawing::draw(const MutableFrame& frame, const Estimate& e, const MetricEstimate* m,
                         const PaintStyle& style) {
  paint(frame, e, style);
  if (m)
    paint_metres(frame, make(e, *m, style.style, frame.width, frame.height), style);
}

} // namespace terrainseg
