// SPDX-License-Identifier: LGPL-2.1-or-later
#include "lab/reference/scoring.hpp"

#include <algorithm>
#include <limits>

#include <opencv2/imgproc.hpp>

namespace terrainseg::reference {

namespace {

/// One model as the inner loop wants it: the six numbers of L^-1 and L^-1 * mean.
struct Kernel {
  double l00, l10, l11, l20, l21, l22;
  double o0, o1, o2;

  explicit Kernel(const Gaussian& model) {
    const Whitening w(model);
    const Eigen::Vector3d offset = w.inverse_factor * w.mean;
    l00 = w.inverse_factor(0, 0);
    l10 = w.inverse_factor(1, 0);
    l11 = w.inverse_factor(1, 1);
    l20 = w.inverse_factor(2, 0);
    l21 = w.inverse_factor(2, 1);
    l22 = w.inverse_factor(2, 2);
    o0 = offset[0];
    o1 = offset[1];
    o2 = offset[2];
  }
};

constexpr int block = 512; // pixels whose channels and distances stay in the first-level cache together

/// Squared distances of `count` pixels, block or less, to the nearest of the models.
inline __attribute__((always_inline)) void score_block_plain(const std::uint8_t* __restrict bgr, int count,
                                                             const std::vector<Kernel>& models,
                                                             double* __restrict least) {
  double b[block], g[block], r[block];
  for (int x = 0; x < count; ++x) {
    b[x] = bgr[3 * x];
    g[x] = bgr[3 * x + 1];
    r[x] = bgr[3 * x + 2];
    least[x] = std::numeric_limits<double>::infinity();
  }
  for (const Kernel& k : models)
    for (int x = 0; x < count; ++x) {
      const double u = k.l00 * b[x] - k.o0;
      const double v = k.l10 * b[x] + k.l11 * g[x] - k.o1;
      const double w = k.l20 * b[x] + k.l21 * g[x] + k.l22 * r[x] - k.o2;
      const double d = u * u + v * v + w * w;
      least[x] = d < least[x] ? d : least[x];
    }
}

void score_block_portable(const std::uint8_t* bgr, int count, const std::vector<Kernel>& models,
                          double* least) {
  score_block_plain(bgr, count, models, least);
}

#if defined(__x86_64__)
// Four doubles at a time where the processor has them. Fused multiplication is left out: the sums stay the
// bits of the portable version.
__attribute__((target("avx2"))) void score_block_avx2(const std::uint8_t* bgr, int count,
                                                      const std::vector<Kernel>& models, double* least) {
  score_block_plain(bgr, count, models, least);
}
#endif

using ScoreBlock = void (*)(const std::uint8_t*, int, const std::vector<Kernel>&, double*);

ScoreBlock best_score_block() {
#if defined(__x86_64__)
  if (__builtin_cpu_supports("avx2"))
    return score_block_avx2;
#endif
  return score_block_portable;
}

} // namespace

void label_pixels(const cv::Mat& bgr, const std::vector<Gaussian>& models, double threshold, cv::Mat& mask) {
  CV_Assert(bgr.type() == CV_8UC3);
  mask.create(bgr.size(), CV_8UC1);
  const std::vector<Kernel> kernels(models.begin(), models.end());
  const ScoreBlock score_block = best_score_block();
  const double limit = threshold * threshold;
  double squared[block];
  for (int y = 0; y < bgr.rows; ++y)
    for (int x = 0; x < bgr.cols; x += block) {
      const int count = std::min(block, bgr.cols - x);
      score_block(bgr.ptr<std::uint8_t>(y, x), count, kernels, squared);
      auto* out = mask.ptr<std::uint8_t>(y, x);
      for (int i = 0; i < count; ++i)
        out[i] = squared[i] <= limit ? 255 : 0;
    }
}

void CleanUp::smooth(cv::Mat& mask, int dilations, int erosions) {
  if (dilations > 0) {
    cv::dilate(mask, other_, cv::Mat(), {-1, -1}, dilations);
    cv::swap(mask, other_);
  }
  if (erosions > 0) {
    cv::erode(mask, other_, cv::Mat(), {-1, -1}, erosions);
    cv::swap(mask, other_);
  }
}

void CleanUp::keep_connected(cv::Mat& mask, const cv::Mat& training) {
  CV_Assert(mask.size() == training.size() && mask.type() == CV_8UC1 && training.type() == CV_8UC1);
  const int count = cv::connectedComponents(mask, areas_, 8, CV_32S);
  kept_.assign(static_cast<std::size_t>(count), 0);
  for (int y = 0; y < mask.rows; ++y) {
    if (cv::countNonZero(training.row(y)) == 0)
      continue;
    const auto* area = areas_.ptr<int>(y);
    const auto* trains = training.ptr<std::uint8_t>(y);
    for (int x = 0; x < mask.cols; ++x)
      if (trains[x])
        kept_[static_cast<std::size_t>(area[x])] = 255;
  }
  kept_[0] = 0; // the background
  for (int y = 0; y < mask.rows; ++y) {
    auto* out = mask.ptr<std::uint8_t>(y);
    if (cv::countNonZero(mask.row(y)) == 0)
      continue;
    const auto* area = areas_.ptr<int>(y);
    for (int x = 0; x < mask.cols; ++x)
      out[x] = kept_[static_cast<std::size_t>(area[x])];
  }
}

} // namespace terrainseg::reference
