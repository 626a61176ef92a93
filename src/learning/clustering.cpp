// SPDX-License-Identifier: LGPL-2.1-or-later
#include "learning/clustering.hpp"

#include <algorithm>

#include "coarse/window.hpp"

namespace terrainseg {
namespace {

constexpr int most_rounds = 8;

using Centre = std::array<std::uint16_t, 3>; // Q8, 8-bit units

/// Uniform numbers from a counter (splitmix32).
class Random {
 public:
  explicit Random(std::uint32_t seed) : state_(seed) {}
  std::size_t below(std::size_t limit) {
    state_ += 0x9e3779b9u;
    std::uint32_t z = state_;
    z = (z ^ (z >> 16)) * 0x21f0aaadu;
    z = (z ^ (z >> 15)) * 0x735a2d97u;
    z ^= z >> 15;
    return static_cast<std::size_t>(std::uint64_t{z} * limit >> 32);
  }

 private:
  std::uint32_t state_;
};

struct Centres {
  std::array<Centre, max_models> at{};
  int count = 0;
};

std::int64_t squared_distance(const Color& sample, const Centre& centre) {
  std::int64_t sum = 0;
  for (int c = 0; c < 3; ++c) {
    const std::int64_t d = (std::int64_t{sample[c]} << 8) - centre[c];
    sum += d * d;
  }
  return sum;
}

/// Equation (6). The squared norm has the same minimum as the norm; ties go to the lowest k.
std::uint8_t nearest(const Color& sample, const Centres& centres) {
  int best = 0;
  std::int64_t least = squared_distance(sample, centres.at[0]);
  for (int k = 1; k < centres.count; ++k) {
    const std::int64_t distance = squared_distance(sample, centres.at[k]);
    if (distance < least) {
      least = distance;
      best = k;
    }
  }
  return static_cast<std::uint8_t>(best);
}

Gaussian moments_of(std::span<const Color> samples) {
  MomentSums sums;
  for (const Color& sample : samples)
    sums.add(sample);
  return sums.moments();
}

// The paper initialises "randomly". With centres from the whole colour cube nearly all samples are assigned
// to the first one: 1.01 clusters remain on average, so K = 3 has the effect of K = 1 (measured). Therefore
// the centres are samples.
Centres initial_centres(std::span<const Color> samples, int clusters, std::uint32_t seed) {
  Centres centres;
  centres.count = clusters;
  centres.at[0] = moments_of(samples).mean;
  Random random(seed);
  for (int k = 1; k < clusters; ++k) {
    const Color& sample = samples[random.below(samples.size())];
    for (int c = 0; c < 3; ++c)
      centres.at[k][c] = static_cast<std::uint16_t>(sample[c] << 8);
  }
  return centres;
}

using Clusters = std::array<MomentSums, max_models>;

/// Equation (6) for all samples. Returns true when a sample changed its cluster.
bool assign(std::span<const Color> samples, const Centres& centres, std::span<std::uint8_t> cluster_of,
            Clusters& clusters) {
  clusters = {};
  bool changed = false;
  for (std::size_t i = 0; i < samples.size(); ++i) {
    const std::uint8_t k = nearest(samples[i], centres);
    changed |= k != cluster_of[i];
    cluster_of[i] = k;
    clusters[k].add(samples[i]);
  }
  return changed;
}

/// Equation (7). Removes clusters without samples. Returns true when there was one.
bool move(const Clusters& clusters, Centres& centres) {
  const int before = centres.count;
  centres.count = 0;
  for (int k = 0; k < before; ++k)
    if (clusters[k].count() > 0)
      centres.at[centres.count++] = clusters[k].moments().mean;
  return centres.count != before;
}

} // namespace

TrainingModels cluster(const Grid& grid, std::span<const Cell> cells, const ClusterRule& rule,
                       ClusterScratch& scratch) {
  TrainingModels training;
  scratch.samples.clear();
  for (const Cell& cell : cells) {
    const Color color = grid.color(cell);
    scratch.samples.push_back({bin_centre(color[0], rule.bit_shift[0]),
                               bin_centre(color[1], rule.bit_shift[1]),
                               bin_centre(color[2], rule.bit_shift[2])});
  }
  if (scratch.samples.empty())
    return training;

  scratch.cluster_of.assign(scratch.samples.size(), max_models);
  Centres centres = initial_centres(scratch.samples, rule.clusters, rule.seed);
  Clusters clusters;
  for (int round = 0; round < most_rounds; ++round) {
    const bool changed = assign(scratch.samples, centres, scratch.cluster_of, clusters);
    const bool dropped = move(clusters, centres);
    if (!changed && !dropped)
      break;
  }

  std::array<Gaussian, max_models>& found = training.models;
  for (const MomentSums& sums : clusters)
    if (sums.count() > 0)
      found[static_cast<std::size_t>(training.count++)] = sums.moments();
  // Insertion sort is stable and, unlike std::stable_sort, never allocates.
  for (int i = 1; i < training.count; ++i)
    for (int j = i; j > 0 && found[j].mass > found[j - 1].mass; --j)
      std::swap(found[j], found[j - 1]);
  for (int k = 0; k < training.count; ++k)
    for (int c = 0; c < 3; ++c)
      found[k].variance[c] = std::max(found[k].variance[c], rule.variance_floor[c]);
  return training;
}

} // namespace terrainseg
