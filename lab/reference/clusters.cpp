// SPDX-License-Identifier: LGPL-2.1-or-later
#include "lab/reference/clusters.hpp"

#include <algorithm>
#include <cstring>
#include <limits>
#include <random>

namespace terrainseg::reference {

namespace {

constexpr std::size_t block = 512; // pixels whose distances stay in the first-level cache

double square(double v) {
  return v * v;
}

/// Squared distance of pixels [first, first + count) from a centre.
inline __attribute__((always_inline)) void distances(const TrainingColors& colors, std::size_t first,
                                                     std::size_t count, const Eigen::Vector3d& centre,
                                                     double* __restrict out) {
  const double* b = colors.channel[0].data() + first;
  const double* g = colors.channel[1].data() + first;
  const double* r = colors.channel[2].data() + first;
  const double cb = centre[0], cg = centre[1], cr = centre[2];
  for (std::size_t i = 0; i < count; ++i)
    out[i] = square(b[i] - cb) + square(g[i] - cg) + square(r[i] - cr);
}

Eigen::Vector3d color_at(const TrainingColors& colors, std::size_t i) {
  return {colors.channel[0][i], colors.channel[1][i], colors.channel[2][i]};
}

/// The standard library's distributions differ between implementations; the engine itself does not.
double uniform(std::mt19937& random) {
  return random() / 4294967296.0;
}

std::vector<Eigen::Vector3d> first_centres(const TrainingColors& colors, int k, std::uint32_t seed) {
  const std::size_t n = colors.size();
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (int c = 0; c < 3; ++c)
    for (double v : colors.channel[c])
      mean[c] += v;
  std::vector<Eigen::Vector3d> centres{mean / static_cast<double>(n)};

  std::mt19937 random(seed);
  std::vector<double> nearest(n), distance(n);
  distances(colors, 0, n, centres[0], nearest.data());
  while (static_cast<int>(centres.size()) < k) {
    double total = 0;
    for (double d : nearest)
      total += d;
    if (total <= 0)
      break; // every pixel is a centre already
    double left = uniform(random) * total;
    std::size_t drawn = 0;
    while (drawn + 1 < n && (left -= nearest[drawn]) >= 0)
      ++drawn;
    centres.push_back(color_at(colors, drawn));
    distances(colors, 0, n, centres.back(), distance.data());
    for (std::size_t i = 0; i < n; ++i)
      nearest[i] = std::min(nearest[i], distance[i]);
  }
  return centres;
}

struct Sums {
  double count = 0;
  Eigen::Vector3d color = Eigen::Vector3d::Zero();
};

/// Adds up the colours of each centre's pixels among `count` pixels, four at a time.
inline __attribute__((always_inline)) void add_owned(const TrainingColors& colors, std::size_t first,
                                                     std::size_t count, const double* owner, Sums* sums,
                                                     std::size_t centres) {
  using Four = double __attribute__((vector_size(4 * sizeof(double))));
  const auto load = [](const double* from, Four& four) { std::memcpy(&four, from, sizeof four); };
  const auto total = [](const Four& four) { return four[0] + four[1] + four[2] + four[3]; };
  const double* channel[3] = {colors.channel[0].data() + first, colors.channel[1].data() + first,
                              colors.channel[2].data() + first};
  const std::size_t whole = count & ~std::size_t{3};
  for (std::size_t k = 0; k < centres; ++k) {
    const double name = static_cast<double>(k);
    Four n{}, b{}, g{}, r{};
    for (std::size_t i = 0; i < whole; i += 4) {
      Four owners, blue, green, red;
      load(owner + i, owners);
      load(channel[0] + i, blue);
      load(channel[1] + i, green);
      load(channel[2] + i, red);
      const Four mine = owners == name ? Four{1, 1, 1, 1} : Four{};
      n += mine;
      b += mine * blue;
      g += mine * green;
      r += mine * red;
    }
    sums[k].count += total(n);
    sums[k].color += Eigen::Vector3d(total(b), total(g), total(r));
  }
  for (std::size_t i = whole; i < count; ++i) {
    Sums& sum = sums[static_cast<std::size_t>(owner[i])];
    sum.count += 1;
    sum.color += Eigen::Vector3d(channel[0][i], channel[1][i], channel[2][i]);
  }
}

/// Assigns every pixel to its nearest centre; says whether any assignment changed.
inline __attribute__((always_inline)) bool assign_plain(const TrainingColors& colors,
                                                        const std::vector<Eigen::Vector3d>& centres,
                                                        std::vector<std::uint8_t>& members,
                                                        std::vector<Sums>& sums) {
  bool changed = false;
  double least[block], distance[block], owner[block];
  for (Sums& sum : sums)
    sum = {};
  for (std::size_t first = 0; first < colors.size(); first += block) {
    const std::size_t count = std::min(block, colors.size() - first);
    distances(colors, first, count, centres[0], least);
    std::fill_n(owner, count, 0.0);
    for (std::size_t k = 1; k < centres.size(); ++k) {
      distances(colors, first, count, centres[k], distance);
      for (std::size_t i = 0; i < count; ++i) {
        const bool nearer = distance[i] < least[i];
        least[i] = nearer ? distance[i] : least[i];
        owner[i] = nearer ? static_cast<double>(k) : owner[i];
      }
    }
    add_owned(colors, first, count, owner, sums.data(), sums.size());
    std::uint8_t* before = members.data() + first;
    for (std::size_t i = 0; i < count; ++i) {
      const auto now = static_cast<std::uint8_t>(static_cast<int>(owner[i]));
      changed |= before[i] != now;
      before[i] = now;
    }
  }
  return changed;
}

bool assign_portable(const TrainingColors& colors, const std::vector<Eigen::Vector3d>& centres,
                     std::vector<std::uint8_t>& members, std::vector<Sums>& sums) {
  return assign_plain(colors, centres, members, sums);
}

#if defined(__x86_64__)
__attribute__((target("avx2"))) bool assign_avx2(const TrainingColors& colors,
                                                 const std::vector<Eigen::Vector3d>& centres,
                                                 std::vector<std::uint8_t>& members,
                                                 std::vector<Sums>& sums) {
  return assign_plain(colors, centres, members, sums);
}
#endif

bool assign(const TrainingColors& colors, const std::vector<Eigen::Vector3d>& centres,
            std::vector<std::uint8_t>& members, std::vector<Sums>& sums) {
#if defined(__x86_64__)
  if (__builtin_cpu_supports("avx2"))
    return assign_avx2(colors, centres, members, sums);
#endif
  return assign_portable(colors, centres, members, sums);
}

} // namespace

void TrainingColors::clear() {
  for (auto& values : channel)
    values.clear();
}

void TrainingColors::reserve(std::size_t count) {
  for (auto& values : channel)
    values.reserve(count);
}

void TrainingColors::push_back(double b, double g, double r) {
  channel[0].push_back(b);
  channel[1].push_back(g);
  channel[2].push_back(r);
}

void gather(const cv::Mat& bgr, const cv::Mat& mask, TrainingColors& colors) {
  CV_Assert(bgr.type() == CV_8UC3 && mask.type() == CV_8UC1 && bgr.size() == mask.size());
  colors.clear();
  colors.reserve(static_cast<std::size_t>(cv::countNonZero(mask)));
  for (int y = 0; y < bgr.rows; ++y) {
    const auto* pixel = bgr.ptr<cv::Vec3b>(y);
    const auto* wanted = mask.ptr<std::uint8_t>(y);
    for (int x = 0; x < bgr.cols; ++x)
      if (wanted[x])
        colors.push_back(pixel[x][0], pixel[x][1], pixel[x][2]);
  }
}

Clustering cluster(const TrainingColors& colors, int k, int max_iterations, std::uint32_t seed) {
  CV_Assert(k >= 1 && k <= 255 && max_iterations >= 1);
  Clustering result;
  if (colors.size() == 0)
    return result;
  std::vector<Eigen::Vector3d> centres = first_centres(colors, k, seed);
  std::vector<Sums> sums(centres.size());
  result.members.assign(colors.size(), 255);
  for (int iteration = 0; iteration < max_iterations && assign(colors, centres, result.members, sums);
       ++iteration)
    for (std::size_t j = 0; j < centres.size(); ++j)
      if (sums[j].count > 0)
        centres[j] = sums[j].color / sums[j].count;

  std::vector<Gaussian> all(centres.size());
  for (std::size_t j = 0; j < all.size(); ++j) {
    all[j].mass = sums[j].count;
    if (sums[j].count > 0)
      all[j].mean = sums[j].color / sums[j].count;
  }
  for (std::size_t i = 0; i < colors.size(); ++i) {
    Gaussian& owner = all[result.members[i]];
    const Eigen::Vector3d off = color_at(colors, i) - owner.mean;
    owner.covariance.noalias() += off * off.transpose();
  }
  std::vector<std::uint8_t> place(all.size(), 0);
  for (std::size_t j = 0; j < all.size(); ++j) {
    if (all[j].null())
      continue;
    all[j].covariance /= all[j].mass;
    place[j] = static_cast<std::uint8_t>(result.clusters.size());
    result.clusters.push_back(all[j]);
  }
  for (std::uint8_t& member : result.members)
    member = place[member];
  return result;
}

} // namespace terrainseg::reference
