// SPDX-License-Identifier: LGPL-2.1-or-later
#include "lab/eval/things.hpp"

#include <algorithm>

#include <opencv2/imgproc.hpp>

#include "lab/eval/sequence.hpp"

namespace terrainseg::eval {
namespace {

constexpr double least_pixels = 40, at_columns = 640;
constexpr double ground_share = 0.8;

/// Pixels around a piece that have a label, and those of them that are ground.
struct Ring {
  int all = 0, ground = 0, above = 0, ground_above = 0;
  bool open() const {
    return above > 0 && ground_above >= ground_share * above && ground >= ground_share * all;
  }
};

Ring ring_of(const cv::Mat1b& labels, const cv::Mat1b& inside, const cv::Rect& box, int top) {
  Ring ring;
  for (int y = 0; y < box.height; ++y)
    for (int x = 0; x < box.width; ++x) {
      const int label = labels(box.y + y, box.x + x);
      if (inside(y, x) == 0 || label == label_obstacle || label == label_none)
        continue;
      const bool is_ground = label == label_terrain || label == label_ground, is_above = box.y + y < top;
      ++ring.all;
      ring.ground += is_ground;
      ring.above += is_above;
      ring.ground_above += is_ground && is_above;
    }
  return ring;
}

bool stands_in_the_open(const cv::Mat1b& labels, const cv::Mat1i& pieces, int piece, const cv::Rect& own) {
  const int reach = std::max({3, own.height / 2, labels.cols / 40});
  const cv::Rect box = cv::Rect(own.x - reach, own.y - reach, own.width + 2 * reach, own.height + 2 * reach) &
                       cv::Rect({0, 0}, labels.size());
  cv::Mat1b grown = pieces(box) == piece;
  cv::dilate(grown, grown, cv::Mat1b::ones(2 * reach + 1, 2 * reach + 1));
  return ring_of(labels, grown, box, own.y).open();
}

} // namespace

Things& Things::operator+=(const Things& other) {
  count += other.count;
  missed += other.missed;
  return *this;
}

double Things::missed_share() const {
  return count > 0 ? 100.0 * missed / count : 0;
}

Things count_things(const cv::Mat1b& labels, const cv::Mat1b& traversable) {
  cv::Mat1i pieces, stats;
  cv::Mat1d centres;
  const int count = cv::connectedComponentsWithStats(labels == label_obstacle, pieces, stats, centres, 8);
  const double least = least_pixels * (labels.cols / at_columns) * (labels.cols / at_columns);
  Things things;
  for (int piece = 1; piece < count; ++piece) {
    const cv::Rect own(stats(piece, cv::CC_STAT_LEFT), stats(piece, cv::CC_STAT_TOP),
                       stats(piece, cv::CC_STAT_WIDTH), stats(piece, cv::CC_STAT_HEIGHT));
    const int area = stats(piece, cv::CC_STAT_AREA);
    if (area < least || own.x == 0 || own.y == 0 || own.x + own.width >= labels.cols ||
        own.y + own.height >= labels.rows || !stands_in_the_open(labels, pieces, piece, own))
      continue;
    ++things.count;
    things.missed += 2 * cv::countNonZero((pieces(own) == piece) & (traversable(own) != 0)) >= area;
  }
  return things;
}

} // namespace terrainseg::eval
