// SPDX-License-Identifier: LGPL-2.1-or-later
#include "lab/eval/ramp_baseline.hpp"

#include <algorithm>
#include <cmath>

#include <opencv2/imgproc.hpp>

#include "lab/eval/sequence.hpp"

namespace terrainseg::eval {
namespace {

constexpr int scale = 4;
constexpr int row_steps = 14, slope_steps = 11; // rows 0.30 to 0.69 by 0.03, slopes -0.10 to 0.40 by 0.05

/// Per column and row: wrong pixels of that column when everything from this row on is called ground.
struct Profile {
  cv::Mat1i wrong; ///< one column per column of the label, height + 1 rows
  int known = 0;
};

Profile profile_of(const cv::Mat1b& label) {
  Profile p{cv::Mat1i(label.rows + 1, label.cols, 0), 0};
  for (int x = 0; x < label.cols; ++x) {
    int ground_above = 0, rest_below = 0;
    for (int y = 0; y < label.rows; ++y) {
      p.known += label(y, x) != label_none;
      rest_below += label(y, x) == label_obstacle || label(y, x) == label_sky;
    }
    for (int y = 0; y <= label.rows; ++y) {
      p.wrong(y, x) = ground_above + rest_below;
      if (y == label.rows)
        break;
      ground_above += label(y, x) == label_terrain || label(y, x) == label_ground;
      rest_below -= label(y, x) == label_obstacle || label(y, x) == label_sky;
    }
  }
  return p;
}

double error_of(const Profile& p, double row, double slope) {
  const int height = p.wrong.rows - 1, width = p.wrong.cols;
  long long wrong = 0;
  for (int x = 0; x < width; ++x) {
    const double edge = (row + slope * std::abs(static_cast<double>(x) / width - 0.5) * 2) * height;
    wrong += p.wrong(std::clamp(static_cast<int>(std::ceil(edge)), 0, height), x);
  }
  return p.known > 0 ? 100.0 * static_cast<double>(wrong) / p.known : 0;
}

} // namespace

double best_ramp_error(const std::vector<cv::Mat1b>& labels) {
  std::vector<Profile> profiles;
  for (const cv::Mat1b& label : labels) {
    cv::Mat1b small;
    cv::resize(label, small, {std::max(label.cols / scale, 1), std::max(label.rows / scale, 1)}, 0, 0,
               cv::INTER_NEAREST);
    profiles.push_back(profile_of(small));
  }
  double best = 100;
  for (int r = 0; r < row_steps; ++r)
    for (int s = 0; s < slope_steps; ++s) {
      double sum = 0;
      for (const Profile& p : profiles)
        sum += error_of(p, 0.30 + 0.03 * r, -0.10 + 0.05 * s);
      best = std::min(best, sum / static_cast<double>(std::max<std::size_t>(profiles.size(), 1)));
    }
  return best;
}

} // namespace terrainseg::eval
