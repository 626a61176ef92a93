// SPDX-License-Identifier: LGPL-2.1-or-later
// Section 4.2 and figure 11: training pixels from a range sensor against those of the window.
#include <algorithm>
#include <cmath>
#include <optional>

#include <opencv2/imgproc.hpp>

#include "lab/eval/charts.hpp"
#include "lab/eval/engines.hpp"
#include "lab/eval/figures.hpp"
#include "lab/eval/paper_parts.hpp"
#include "lab/eval/table.hpp"
#include "lab/reference/training_pixels.hpp"

namespace terrainseg::eval {

namespace {

using reference::FloorProfile;

constexpr double tolerance = 0.08;     // of the floor's depth
constexpr std::size_t start_shots = 5; // in which a and b are fitted
constexpr double near_limit = 2.5;     // metres, where one value is wanted

/// What z < d_th means; the text allows all three.
enum class RangeChoice { nearer_only, floor_at_start, floor_each_frame };
constexpr RangeChoice choices[] = {RangeChoice::nearer_only, RangeChoice::floor_at_start,
                                   RangeChoice::floor_each_frame};
constexpr const char* choice_names[] = {"z < d_th alone, as printed", "a, b fitted at start",
                                        "a, b fitted to every frame"};

struct Overlap {
  double window = 0, range = 0, both = 0;
};

cv::Mat from_range(const cv::Mat& depth, RangeChoice choice, const FloorProfile& start,
                   const std::optional<FloorProfile>& now, double limit) {
  if (choice == RangeChoice::nearer_only)
    return (depth > 0) & (depth < limit * 1000);
  const FloorProfile& floor = choice == RangeChoice::floor_at_start ? start : now.value_or(start);
  return reference::floor_pixels(depth, floor, tolerance, limit);
}

/// a and b from the first shots: the median of each.
std::optional<FloorProfile> profile_at_start(const Sequence& sequence, const cv::Rect& window) {
  std::vector<double> a, b;
  for (std::size_t i = 0; i < std::min(start_shots, sequence.size()); ++i)
    if (const auto fit = reference::fit_floor(sequence.read(i).depth, window, tolerance)) {
      a.push_back(fit->a);
      b.push_back(fit->b);
    }
  if (a.empty())
    return std::nullopt;
  return FloorProfile{spread_of(a)->median, spread_of(b)->median};
}

std::string compare_training(const Context& context, const Sequence& sequence) {
  reference::WindowPlace place;
  place.bottom = sequence.window_bottom;
  const cv::Rect window = reference::window_in(sequence.read(0).picture.size(), place);
  const auto start = profile_at_start(sequence, window);
  if (!start)
    return sequence.name + ": no floor in the depth of its first frames.\n";

  std::vector<double> limits;
  for (int tenths = 11; tenths <= 31; ++tenths)
    limits.push_back(tenths / 10.0);
  std::vector<std::vector<Overlap>> overlaps(std::size(choices), std::vector<Overlap>(limits.size()));
  std::vector<double> distances, centre_distances;
  double pure[1 + std::size(choices)] = {}, counted[1 + std::size(choices)] = {};

  Settings paper = Settings::of(Preset::paper), standard = Settings::of(Preset::standard);
  paper.window_bottom = standard.window_bottom = sequence.window_bottom;
  constexpr int ways = 3; // window, a and b at start, a and b of every frame
  std::vector<std::unique_ptr<Engine>> subjects;
  for (int way = 0; way < ways; ++way) {
    subjects.push_back(make_reference(sequence.window_bottom));
    subjects.push_back(make_filter(paper, sequence.fps, PixelFormat::BGR));
    subjects.push_back(make_filter(standard, sequence.fps));
  }
  std::vector<Counts> scores(subjects.size());

  for (std::size_t i = 0; i < sequence.size(); ++i) {
    const Sample shot = sequence.read(i);
    cv::Mat chosen;
    reference::window_pixels(shot.picture.bgr(), window, 1, chosen);
    const auto now = reference::fit_floor(shot.depth, window, tolerance);
    for (std::size_t s = 0; s < std::size(choices); ++s)
      for (std::size_t k = 0; k < limits.size(); ++k) {
        const cv::Mat range = from_range(shot.depth, choices[s], *start, now, limits[k]);
        Overlap& overlap = overlaps[s][k];
        overlap.window += cv::countNonZero(chosen);
        overlap.range += cv::countNonZero(range);
        overlap.both += cv::countNonZero(chosen & range);
      }

    const cv::Mat ground = (shot.labels == 1) | (shot.labels == 2), known = shot.labels != 255;
    const auto count_pure = [&](std::size_t which, const cv::Mat& pixels) {
      pure[which] += cv::countNonZero(pixels & ground);
      counted[which] += cv::countNonZero(pixels & known);
    };
    count_pure(0, chosen);
    for (std::size_t s = 0; s < std::size(choices); ++s)
      count_pure(1 + s, from_range(shot.depth, choices[s], *start, now, near_limit));

    const cv::Mat at_start = from_range(shot.depth, RangeChoice::floor_at_start, *start, now, near_limit);
    const cv::Mat each = from_range(shot.depth, RangeChoice::floor_each_frame, *start, now, near_limit);
    if (cv::countNonZero(each) > 0 && cv::countNonZero(chosen) > 0) {
      cv::Mat distance;
      cv::distanceTransform(each == 0, distance, cv::DIST_L2, cv::DIST_MASK_PRECISE);
      for (int y = window.y; y < window.y + window.height; ++y)
        for (int x = window.x; x < window.x + window.width; ++x)
          if (chosen.at<std::uint8_t>(y, x))
            distances.push_back(distance.at<float>(y, x));
      const cv::Moments a = cv::moments(chosen, true), b = cv::moments(each, true);
      centre_distances.push_back(std::hypot(a.m10 / a.m00 - b.m10 / b.m00, a.m01 / a.m00 - b.m01 / b.m00));
    }
    const cv::Mat* training[ways] = {nullptr, &at_start, &each};
    for (std::size_t k = 0; k < subjects.size(); ++k) {
      const cv::Mat* pixels = training[k / 3];
      // Where the sensor sees no floor the original had nothing to learn from either.
      const bool usable = pixels && cv::countNonZero(*pixels) > 0;
      scores[k] += count_pixels(
          subjects[k]->look(shot.picture, i, usable ? cv::Mat1b(*pixels) : cv::Mat1b()).mask, shot.labels);
    }
  }

  Table curve({"d_th, m", "precision / recall, z < d_th alone", "a, b at start", "a, b each frame"});
  std::vector<Curve> curves;
  for (std::size_t s = 0; s < std::size(choices); ++s)
    curves.push_back({choice_names[s], {}, false});
  for (std::size_t k = 0; k < limits.size(); ++k) {
    std::vector<std::string> row{number(limits[k], 1)};
    for (std::size_t s = 0; s < std::size(choices); ++s) {
      const Overlap& o = overlaps[s][k];
      const double precision = o.window > 0 ? 100 * o.both / o.window : 0,
                   recall = o.range > 0 ? 100 * o.both / o.range : 0;
      row.push_back(o.range > 0 ? number(precision, 1) + " / " + number(recall, 1) : "none");
      if (o.range > 0)
        curves[s].points.emplace_back(recall, precision);
    }
    if (k % 2 == 0)
      curve.add(row);
  }
  save_chart(
      context.out + "/figure11.chart.json",
      {"Window pixels against range pixels, d_th from 1.1 to 3.1 m", "recall %", "precision %", "", curves});

  Table purity({"training pixels", "of them ground, %", "pixels a frame"});
  const char* purity_names[] = {"window, within 1 sigma", choice_names[0], choice_names[1], choice_names[2]};
  for (std::size_t s = 0; s < std::size(purity_names); ++s)
    purity.add({std::string(purity_names[s]) + (s > 0 ? ", d_th = 2.5 m" : ""),
                counted[s] > 0 ? number(100 * pure[s] / counted[s], 1) : "none",
                number(counted[s] / static_cast<double>(sequence.size()), 0)});

  Table effect({"learned from", "unmodified", "paper preset", "default"});
  const char* way_names[ways] = {"window", "depth, a and b at start", "depth, a and b each frame"};
  for (std::size_t way = 0; way < ways; ++way) {
    std::vector<std::string> row{way_names[way]};
    for (std::size_t k = 0; k < 3; ++k)
      row.push_back(number(scores[3 * way + k].error(), 1) + " / " +
                    number(scores[3 * way + k].unsafe_share(), 1));
    effect.add(row);
  }
  const Spread apart = spread_of(distances).value_or(Spread()),
               centres = spread_of(centre_distances).value_or(Spread());
  return "### " + sequence.name + "\n\nFitted at start: a = " + number(start->a, 2) +
         " m, b = " + number(start->b, 2) + " per frame height.\n\n" + curve.text() +
         "\nChart: figure11.png (draw_charts.py).\n\n" + purity.text() +
         "\nPosition difference, pixels: a window pixel and the nearest range pixel, median " +
         number(apart.median, 1) + ", 99th percentile " + number(apart.p99, 1) + ", largest " +
         number(apart.largest, 1) + "; the centres of both sets, median " + number(centres.median, 1) +
         ", largest " + number(centres.largest, 1) + ".\n\nError / unsafe, %, by what is learned from:\n\n" +
         effect.text();
}

} // namespace

std::string training_pixels(const Context& context) {
  std::string text = "## Training pixels from depth (section 4.2, figure 11)\n\n";
  bool any = false;
  for (const Sequence& sequence : paper_sequences(context.data, context.selection)) {
    if (sequence.read(0).depth.empty())
      continue;
    context.tell("training pixels: " + sequence.name);
    text += compare_training(context, sequence);
    any = true;
  }
  return any ? text
             : text + "Left out: nothing here has depth. It needs a sequence with `depth/` (16-bit "
                      "millimetres).\n";
}

} // namespace terrainseg::eval
