// SPDX-License-Identifier: LGPL-2.1-or-later
#include "lab/eval/metres.hpp"

#include <algorithm>
#include <cmath>
#include <fstream>
#include <iostream>
#include <limits>
#include <map>
#include <numbers>
#include <stdexcept>

#include "lab/eval/options.hpp"
#include "lab/eval/parallel.hpp"
#include "lab/eval/statistics.hpp"
#include "lab/eval/table.hpp"
#include "metric/free_space_ranges.hpp"
#include "metric/pose.hpp"
#include "terrainseg/segmenter.hpp"

namespace terrainseg::eval {
namespace {

using Attitude = MetricCase::Attitude;

constexpr double half_a_degree = std::numbers::pi / 360;
/// So far that every measured column has its number: the filter's own limit hides what is doubtful.
constexpr double no_limit = 1000;
/// Of a column whose end the labels leave open by more than this share of its range nothing is said.
constexpr double doubtful_end = 0.1;
constexpr unsigned first_seed = 101; // places that no test and no tuning has looked at

metric::Camera camera_of(const scene::View& view, int width, int height) {
  metric::Camera camera;
  camera.width = width;
  camera.height = height;
  camera.fx = camera.fy = view.focal;
  camera.cx = view.center_x;
  camera.cy = view.center_y;
  return camera;
}

metric::Pose pose_of(const scene::View& view, std::int64_t time) {
  metric::Pose pose;
  pose.time = time;
  pose.roll = view.roll;
  pose.pitch = view.pitch;
  pose.height = view.height;
  return pose;
}

/// As in a measurement by hand: the vehicle stands.
metric::Mount standing_mount(const MetricDrive& drive) {
  scene::Settings still = drive.scene;
  still.motion = scene::Motion::still;
  const scene::View view = scene::Renderer(still, drive.width, drive.height).view_of(0);
  metric::Mount mount;
  mount.height = view.height;
  mount.pitch = view.pitch;
  mount.roll = view.roll;
  return mount;
}

std::int64_t time_of(std::size_t frame) {
  return static_cast<std::int64_t>(frame) * 1'000'000'000 / scene::frames_per_second;
}

/// The attitudes that come in while a drive is driven.
class Attitudes {
 public:
  Attitudes(const scene::Renderer& renderer, const MetricDrive& drive) : mount_(standing_mount(drive)) {
    for (std::size_t i = 0; i <= drive.warm_up + drive.frames; ++i) {
      const metric::Pose pose = pose_of(renderer.view_of(i), time_of(i));
      every_.add(pose);
      if (i % 2 == 0)
        every_second_.add(pose);
    }
  }
  /// Nothing where no pose is near enough.
  std::optional<metric::Mount> at(std::size_t frame, Attitude attitude) const {
    if (attitude == Attitude::mount)
      return mount_;
    const auto pose = (attitude == Attitude::slow_pose ? every_second_ : every_).at(time_of(frame));
    if (!pose)
      return std::nullopt;
    metric::Mount mount = metric::with_pose(mount_, *pose);
    mount.pitch += attitude == Attitude::too_low    ? half_a_degree
                   : attitude == Attitude::too_high ? -half_a_degree
                                                    : 0;
    return mount;
  }

 private:
  metric::Mount mount_;
  metric::PoseTrack every_, every_second_;
};

/// The filter once for each attitude, for it is told where that has the ground's vanishing line.
class Filters {
 public:
  explicit Filters(const metric::Camera& camera) : camera_(camera) {}
  void process(Frame frame, const Attitudes& attitudes, std::size_t number) {
    for (const MetricCase& it : metric_cases) {
      if (it.true_boundary)
        continue;
      const auto mount = attitudes.at(number, it.attitude);
      frame.vanishing_row = mount ? metric::vanishing_row_q8(*mount, camera_) : std::nullopt;
      const auto [filter, made] = filters_.try_emplace(it.attitude, Settings());
      if (const Status status = filter->second.process(frame); !status.ok())
        throw std::runtime_error(status.message());
    }
  }
  const Estimate& of(MetricCase::Attitude attitude) const { return filters_.at(attitude).estimate(); }

 private:
  metric::Camera camera_;
  std::map<MetricCase::Attitude, Segmenter> filters_;
};

/// Rows and ranges of a picture's columns by its labels; NaN where they leave it open.
struct Truth {
  std::vector<std::uint16_t> rows;
  std::vector<double> ranges;
};

Truth truth_of(const GrayView& labels, const scene::View& view) {
  Truth truth;
  for (int x = 0; x < labels.width; ++x) {
    const TrueEnd end = true_end(labels, x);
    const double range = ground_range(view, x, end.row - 0.5);
    const bool open = ground_range(view, x, end.seen - 0.5) > range * (1 + doubtful_end);
    truth.rows.push_back(static_cast<std::uint16_t>(end.row));
    truth.ranges.push_back(open || end.row == labels.height ? std::numeric_limits<double>::quiet_NaN()
                                                            : range);
  }
  return truth;
}

/// Every mask column is a picture's column.
void add_frame(MetricErrors& errors, metric::FreeSpaceRanges& ranges, const Truth& truth,
               const Filters& filters, const Attitudes& attitudes, std::size_t frame) {
  for (std::size_t i = 0; i < metric_cases.size(); ++i) {
    const MetricCase& it = metric_cases[i];
    const auto mount = attitudes.at(frame, it.attitude);
    if (!mount)
      continue;
    const Estimate* filter = it.true_boundary ? nullptr : &filters.of(it.attitude);
    const metric::RangeColumns& read =
        filter ? ranges.measure(filter->boundary, (filter->flags & flag_unknown) != 0, *mount, no_limit)
               : ranges.measure(truth.rows, false, *mount, no_limit);
    for (std::size_t column = 0; column < truth.ranges.size(); ++column)
      errors[i].add(truth.ranges[column], read.ranges[column]);
  }
}

std::string cell_of(const std::optional<RangeFigures>& figures) {
  if (!figures)
    return "-";
  const auto percent = [](double value) {
    return std::isinf(value) ? std::string("free") : number(value, 1);
  };
  return percent(figures->median) + " / " + percent(figures->p90) + " / " + number(figures->too_long, 1);
}

std::string table_of(const MetricErrors& errors) {
  std::vector<std::string> head{"error of the range, median / 90th percentile / read > 20 % too long, %"};
  for (std::size_t span = 0; span < RangeErrors::spans; ++span)
    head.push_back(RangeErrors::name(span));
  Table table(head);
  for (std::size_t i = 0; i < metric_cases.size(); ++i) {
    std::vector<std::string> row{metric_cases[i].name};
    for (std::size_t span = 0; span < RangeErrors::spans; ++span)
      row.push_back(cell_of(errors[i].figures(span)));
    table.add(row);
  }
  std::vector<std::string> columns{"columns"};
  for (std::size_t span = 0; span < RangeErrors::spans; ++span) {
    const auto figures = errors[0].figures(span);
    columns.push_back(std::to_string(figures ? figures->columns : 0));
  }
  table.add(columns);
  return table.text();
}

void write_csv(std::ostream& out, const char* motion, const MetricErrors& errors) {
  for (std::size_t i = 0; i < metric_cases.size(); ++i)
    for (std::size_t span = 0; span < RangeErrors::spans; ++span)
      if (const auto f = errors[i].figures(span))
        out << motion << ",\"" << metric_cases[i].name << "\"," << RangeErrors::name(span) << ','
            << f->columns << ',' << number(f->median, 2) << ',' << number(f->p90, 2) << ','
            << number(f->too_long, 2) << '\n';
}

struct MotionName {
  scene::Motion motion;
  const char* name;
};

std::vector<MetricDrive> drives_of(scene::Motion motion, int places) {
  std::vector<MetricDrive> drives;
  for (const auto kind : {scene::Kind::road, scene::Kind::trail, scene::Kind::corridor, scene::Kind::plain})
    for (int i = 0; i < places; ++i) {
      MetricDrive drive;
      drive.scene.kind = kind;
      drive.scene.motion = motion;
      drive.scene.seed = first_seed + static_cast<unsigned>(i);
      drives.push_back(drive);
    }
  return drives;
}

MetricErrors measure_all(const std::vector<MetricDrive>& drives) {
  std::vector<MetricErrors> parts(drives.size());
  for_each_in_parallel(drives.size(),
                       [&](std::size_t item, std::size_t) { parts[item] = measure(drives[item]); });
  MetricErrors all;
  for (const MetricErrors& part : parts)
    for (std::size_t i = 0; i < all.size(); ++i)
      all[i].add(part[i]);
  return all;
}

} // namespace

double ground_range(const scene::View& view, double u, double v) {
  struct Axis {
    double ahead, left, up;
  };
  const double pitch_cos = std::cos(view.pitch), pitch_sin = std::sin(view.pitch);
  const double roll_cos = std::cos(view.roll), roll_sin = std::sin(view.roll);
  const Axis forward{pitch_cos, 0, -pitch_sin}, level_down{-pitch_sin, 0, -pitch_cos};
  // The picture's right side and its lower edge turn about the forward axis; level, its right is -left.
  const Axis right{level_down.ahead * roll_sin, -roll_cos, level_down.up * roll_sin};
  const Axis down{level_down.ahead * roll_cos, roll_sin, level_down.up * roll_cos};
  const double x = (u - view.center_x) / view.focal, y = (v - view.center_y) / view.focal;
  const Axis ray{forward.ahead + x * right.ahead + y * down.ahead, x * right.left + y * down.left,
                 forward.up + x * right.up + y * down.up};
  if (ray.up >= 0)
    return std::numeric_limits<double>::infinity();
  return view.height / -ray.up * std::hypot(ray.ahead, ray.left);
}

TrueEnd true_end(const GrayView& labels, int column) {
  TrueEnd end{labels.height, labels.height};
  for (int y = labels.height - 1; y >= 0; --y) {
    const int label = labels.plane.row(y)[column];
    if (label == scene::not_traversable || label == scene::sky)
      break;
    end.seen = y;
    if (label != scene::not_labelled)
      end.row = y;
  }
  return end;
}

MetricErrors measure(const MetricDrive& drive) {
  scene::Renderer renderer(drive.scene, drive.width, drive.height);
  scene::Picture picture(PixelFormat::I420, drive.width, drive.height);
  const Attitudes attitudes(renderer, drive);
  Filters filters(camera_of(renderer.view_of(0), drive.width, drive.height));
  metric::FreeSpaceRanges ranges;
  MetricErrors errors;
  for (std::size_t i = 0; i < drive.warm_up + drive.frames; ++i) {
    renderer.render(i, picture);
    filters.process(picture.frame(), attitudes, i);
    if (i < drive.warm_up || (i - drive.warm_up) % drive.step != 0)
      continue;
    const scene::View view = renderer.view_of(i);
    ranges.adapt(camera_of(view, drive.width, drive.height), drive.width, drive.height,
                 {0, 0, drive.width, drive.height}, drive.width);
    add_frame(errors, ranges, truth_of(picture.labels(), view), filters, attitudes, i);
  }
  return errors;
}

void run_metres(const std::vector<std::string>& words) {
  const MetresOptions options = parse_metres_options(words);
  std::ofstream csv;
  if (!options.csv.empty()) {
    csv.open(options.csv);
    csv << "motion,case,range,columns,median %,90th percentile %,over 20 % too long %\n";
  }
  for (const MotionName& it :
       {MotionName{scene::Motion::straight, "straight"}, MotionName{scene::Motion::bumpy, "bumpy"}}) {
    const MetricErrors errors = measure_all(drives_of(it.motion, options.places));
    std::cout << "\n### " << it.name << "\n\n" << table_of(errors);
    write_csv(csv, it.name, errors);
  }
  if (!options.csv.empty() && !csv.flush())
    throw std::runtime_error(options.csv + ": cannot be written");
}

} // namespace terrainseg::eval
