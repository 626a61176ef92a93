// SPDX-License-Identifier: LGPL-2.1-or-later
#include "reference/scoring.hpp"

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

struct RowBuffers {
  explicit RowBuffers(int width) : b(width), g(width), r(width), least(width) {}
  std::vector<double> b, g, r, least;
};

inline __attribute__((always_inline)) void score_row_plain(const std::uint8_t* __restrict bgr, int width,
                                                           const Kernel* models, std::size_t count,
                                                           double* __restrict b, double* __restrict g,
                                                           double* __restrict r, double* __restrict least) {
  for (int x = 0; x < width; ++x) {
    b[x] = bgr[3 * x];
    g[x] = bgr[3 * x + 1];
    r[x] = bgr[3 * x + 2];
    least[x] = std::numeric_limits<double>::infinity();
  }
  for (std::size_t m = 0; m < count; ++m) {
    const Kernel k = models[m];
    for (int x = 0; x < width; ++x) {
      const double u = k.l00 * b[x] - k.o0;
      const double v = k.l10 * b[x] + k.l11 * g[x] - k.o1;
      const double w = k.l20 * b[x] + k.l21 * g[x] + k.l22 * r[x] - k.o2;
      const double d = u * u + v * v + w * w;
      least[x] = d < least[x] ? d : least[x];
    }
  }
}

void score_row_portable(const std::uint8_t* bgr, int width, const Kernel* models, std::size_t count,
                        RowBuffers& row) {
  score_row_plain(bgr, width, models, count, row.b.data(), row.g.data(), row.r.data(), row.least.data());
}

#if defined(__x86_64__)
// Four doubles at a time where the processor has them. Fused multiplication is left out: the sums stay the
// bits of the portable version.
__attribute__((target("avx2"))) void score_row_avx2(const std::uint8_t* bgr, int width, const Kernel* models,
                                                    std::size_t count, RowBuffers& row) {
  score_row_plain(bgr, width, models, count, row.b.data(), row.g.data(), row.r.data(), row.least.data());
}
#endif

using ScoreRow = void (*)(const std::uint8_t*, int, const Kernel*, std::size_t, RowBuffers&);

ScoreRow best_score_row() {
#if defined(__x86_64__)
  if (__builtin_cpu_supports("avx2"))
    return score_row_avx2;
#endif
  return score_row_portable;
}

/// Calls use(y, squared distances of the row) for every row.
template <typename Use> void for_each_row(const cv::Mat& bgr, const std::vector<Gaussian>& models, Use use) {
  CV_Assert(bgr.type() == CV_8UC3);
  const std::vector<Kernel> kernels(models.begin(), models.end());
  const ScoreRow score_row = best_score_row();
  RowBuffers row(bgr.cols);
  for (int y = 0; y < bgr.rows; ++y) {
    score_row(bgr.ptr<std::uint8_t>(y), bgr.cols, kernels.data(), kernels.size(), row);
    use(y, row.least.data());
  }
}

} // namespace

void label_pixels(const cv::Mat& bgr, const std::vector<Gaussian>& models, double threshold, cv::Mat& mask) {
  mask.create(bgr.size(), CV_8UC1);
  const double limit = threshold * threshold;
  for_each_row(bgr, models, [&](int y, const double* squared) {
    auto* out = mask.ptr<std::uint8_t>(y);
    for (int x = 0; x < bgr.cols; ++x)
      out[x] = squared[x] <= limit ? 255 : 0;
  });
}

void score_pixels(const cv::Mat& bgr, const std::vector<Gaussian>& models, cv::Mat& squared_distance) {
  squared_distance.create(bgr.size(), CV_32FC1);
  for_each_row(bgr, models, [&](int y, const double* squared) {
    std::copy_n(squared, bgr.cols, squared_distance.ptr<float>(y));
  });
}

void clean_up(cv::Mat& mask, int dilations, int erosions) {
  if (dilations > 0)
    cv::dilate(mask, mask, cv::Mat(), {-1, -1}, dilations);
  if (erosions > 0)
    cv::erode(mask, mask, cv::Mat(), {-1, -1}, erosions);
}

void keep_connected(cv::Mat& mask, const cv::Mat& training) {
  CV_Assert(mask.size() == training.size() && mask.type() == CV_8UC1 && training.type() == CV_8UC1);
  cv::Mat areas;
  const int count = cv::connectedComponents(mask, areas, 8, CV_32S);
  std::vector<std::uint8_t> kept(static_cast<std::size_t>(count), 0);
  for (int y = 0; y < mask.rows; ++y) {
    const auto* area = areas.ptr<int>(y);
    const auto* trains = training.ptr<std::uint8_t>(y);
    for (int x = 0; x < mask.cols; ++x)
      if (trains[x])
        kept[static_cast<std::size_t>(area[x])] = 255;
  }
  kept[0] = 0; // the background
  for (int y = 0; y < mask.rows; ++y) {
    const auto* area = areas.ptr<int>(y);
    auto* out = mask.ptr<std::uint8_t>(y);
    for (int x = 0; x < mask.cols; ++x)
      out[x] = kept[static_cast<std::size_t>(area[x])];
  }
}

} // namespace terrainseg::reference
