// SPDX-License-Identifier: LGPL-2.1-or-later
#include "freespace/score/likelihood.hpp"

#include <algorithm>
#include <cstdlib>
#include <limits>
#include <numeric>

#include "base/fixed_log.hpp"
#include "base/tuning.hpp"
#include "freespace/look/color_bins.hpp"

namespace terrainseg {
namespace {

TERRAINSEG_TUNED(int, likelihood, colors_per_bin_log2, luma_bin_shift + 2 * chroma_bin_shift);

TERRAINSEG_TUNED(int, likelihood, score_limit, 48); ///< 1.5 nats: no cell outweighs two neighbours
/// What a colour says from which on it speaks for ground in any light. With 0 dusk is 1.3 points less safe,
/// with 16 places in the sun a little worse.
TERRAINSEG_TUNED(int, likelihood, speaks_for_ground, 10);
/// Of ground that is joined to the window: Mars 15.3 -> 7.1 % wrong. A wall that has come into the
/// window is like itself, too, but not yet like the ground: it vouches for no more than that.
TERRAINSEG_TUNED(int, likelihood, least_of_vouched, 24);

TERRAINSEG_TUNED(std::uint64_t, likelihood, frame_weight,
                 1 << 20); ///< what one frame adds to a histogram in all
constexpr std::uint64_t histogram_limit = std::uint64_t{1} << 30;

/// Least probability of a bin under the mixture, log2 Q8.
TERRAINSEG_TUNED(int, likelihood, least_positive, -3968);
/// In favour of the terrain, log2 Q8: "the rest of the frame" is ground for the most part, so the plain ratio
/// sits near 0 on the ground itself. Flat from 3 to 4.5 octaves; without it the mean error of five sequences
/// is 8.4 in place of 5.5.
TERRAINSEG_TUNED(int, likelihood, rest_is_ground, 950);
/// The same where a range sensor or a large window has taught most of the ground: the rest is the rest then.
/// From depth, indoors, all of it makes 9.6 % of what is not ground traversable, this 1.0.
TERRAINSEG_TUNED(int, likelihood, rest_of_taught, 300);
/// Shares of the picture, Q8, between which one goes over into the other; a usual window takes 5 to 12.
TERRAINSEG_TUNED(int, likelihood, little_taught, 32);
TERRAINSEG_TUNED(int, likelihood, much_taught, 64);
/// Of a training model, log2 Q8: a fifth. Flat from an eighth to a half; without it single frames after a
/// jump of the scene lose their ground altogether (off-road 11.6 in place of 10.8 % with forgetting by >> 6).
TERRAINSEG_TUNED(int, likelihood, training_share, -619);
/// Of a model in the other light, log2 Q8: half of its share. Flat from a quarter to all of it.
TERRAINSEG_TUNED(int, likelihood, other_light_share, -256);
/// A negative bin holds at least a 10000th of all.
TERRAINSEG_TUNED(std::uint64_t, likelihood, negative_floor, 10000);
/// 0.385 of the ratio in nats, 32 = 1 nat, from log2 Q8 (Q16).
TERRAINSEG_TUNED(int, likelihood, color_weight, 2180);
/// Colour may lie: it never outweighs texture, and one cell never outweighs its neighbours.
TERRAINSEG_TUNED(int, likelihood, color_limit, 26);
/// What lies as far from every model in chroma, |U| + |V| in normalised grey levels, lies in no other light:
/// a car or a box as smooth as the road. From 104 to 136 flat but for India (8.3, 8.0 % wrong); with 88 roads
/// in the sun are 12.2 % wrong in place of 11.4, with 72 roads by day 10.8 in place of 8.7, for their verges.
TERRAINSEG_TUNED(int, likelihood, other_chroma, 136);
TERRAINSEG_TUNED(std::int8_t, likelihood, no_ground,
                 -128); ///< of such a colour: no texture, 127 at most, makes up for it
/// 1.6 of the ratio.
TERRAINSEG_TUNED(int, likelihood, texture_weight, 9086);
TERRAINSEG_TUNED(std::uint64_t, likelihood, texture_floor, 1000);

std::uint64_t total_of(std::span<const std::uint32_t> histogram) {
  return std::accumulate(histogram.begin(), histogram.end(), std::uint64_t{0});
}

void fade(std::vector<std::uint32_t>& histogram, int shift) {
  if (shift > 0)
    for (std::uint32_t& h : histogram)
      h -= h >> shift;
  // Without forgetting counts would run over after some hours; halving keeps their proportions.
  if (total_of(histogram) > histogram_limit)
    for (std::uint32_t& h : histogram)
      h >>= 1;
}

// Where an end is repeated a sum holds three times the histogram at most.
static_assert(3 * (histogram_limit + (std::uint64_t{1} << 27)) < (std::uint64_t{1} << 32));

std::uint64_t smoothed(std::span<const std::uint32_t> histogram, int bin) {
  constexpr int weights[5] = {1, 2, 3, 2, 1};
  std::uint64_t sum = 0;
  for (int k = -2; k <= 2; ++k)
    sum += std::uint64_t{histogram[std::clamp(bin + k, 0, texture_bins - 1)]} * weights[k + 2];
  return sum;
}

// In favour of the terrain, log2 Q8, when `taught_q8` of the picture was taught as terrain.
int favour(int taught_q8) {
  return rest_of_taught + (rest_is_ground - rest_of_taught) *
                              std::clamp(much_taught - taught_q8, 0, much_taught - little_taught) /
                              (much_taught - little_taught);
}

} // namespace

void mark_lessons(const Grid& grid, std::span<const Cell> window, std::span<const Cell> kept,
                  std::span<const std::uint8_t> joined, Negatives negatives, const GridCurve& last,
                  std::vector<Lesson>& lessons) {
  lessons.assign(grid.size(), Lesson::against);
  if (negatives == Negatives::split && last.size() == static_cast<std::size_t>(grid.width))
    for (int j = 0; j < grid.width; ++j)
      for (int i = last[static_cast<std::size_t>(j)]; i < grid.height; ++i)
        lessons[grid.at(i, j)] = Lesson::against_little;
  for (std::size_t i = 0; i < joined.size(); ++i)
    if (joined[i])
      lessons[i] = Lesson::terrain;
  for (std::size_t i = 0; i < grid.size(); ++i)
    if (grid.ignored[i])
      lessons[i] = Lesson::nothing;
  for (const Cell& cell : window)
    lessons[grid.at(cell.y, cell.x)] = Lesson::nothing;
  for (const Cell& cell : kept)
    lessons[grid.at(cell.y, cell.x)] = Lesson::terrain;
}

void score_cells(const Grid& grid, const CellBins& cells, const LikelihoodTables& tables,
                 const CellPenalties& penalty, const Vouched& vouched, const Columns& ahead,
                 CellScores& score) {
  score.resize(grid.size());
  int least = least_of_vouched;
  if (!vouched.seeds.empty()) {
    int sum = 0;
    for (const Cell& seed : vouched.seeds) {
      const std::size_t i = grid.at(seed.y, seed.x);
      sum += tables.color[cells.color[i]] + tables.texture[cells.texture[i]];
    }
    least = std::clamp(sum / static_cast<int>(vouched.seeds.size()), -score_limit, least_of_vouched);
  }
  for (int row = 0; row < grid.height; ++row)
    for (int column = 0; column < grid.width; ++column) {
      const std::size_t i = grid.at(row, column);
      const bool any_light = column >= ahead.first && column < ahead.end;
      const std::int8_t color = (any_light ? tables.any_light : tables.color)[cells.color[i]];
      const int doubt = any_light && color >= speaks_for_ground ? penalty[i] / 2 : penalty[i],
                lowest = !vouched.cells.empty() && vouched.cells[i] ? least : -score_limit;
      const int evidence = std::clamp(color + tables.texture[cells.texture[i]] - doubt, lowest, score_limit);
      score[i] = static_cast<std::int16_t>(grid.ignored[i] ? 0 : 16 * evidence);
    }
}

void learn_histograms(const CellBins& cells, const std::vector<Lesson>& lessons, int forget_shift,
                      Terrain& learned) {
  learned.negative_colors.resize(color_bins);
  learned.terrain_texture.resize(texture_bins);
  learned.negative_texture.resize(texture_bins);
  for (auto* histogram : {&learned.negative_colors, &learned.terrain_texture, &learned.negative_texture})
    fade(*histogram, forget_shift);
  std::uint64_t inside = 0, outside = 0;
  for (const Lesson lesson : lessons) {
    inside += lesson == Lesson::terrain;
    outside += lesson == Lesson::against || lesson == Lesson::against_little;
  }
  const auto share = [](std::uint64_t count) {
    return static_cast<std::uint32_t>(
        std::max<std::uint64_t>(frame_weight / std::max<std::uint64_t>(count, 1), 4));
  };
  const std::uint32_t add_inside = share(inside), add_outside = share(outside);
  for (std::size_t i = 0; i < lessons.size(); ++i) {
    if (lessons[i] == Lesson::terrain) {
      learned.terrain_texture[cells.texture[i]] += add_inside;
    } else if (lessons[i] != Lesson::nothing) {
      const std::uint32_t add = lessons[i] == Lesson::against_little ? add_outside >> 2 : add_outside;
      learned.negative_colors[cells.color[i]] += add;
      learned.negative_texture[cells.texture[i]] += add;
    }
  }
}

// All models with their share of the mass, log2 Q8.
template <typename Weigh>
void Likelihood::each_model(const Terrain& learned, std::span<const TerrainModel> training, int favour,
                            const Weigh& weigh) {
  std::uint64_t mass = 0;
  for (const TerrainModel& model : learned.models)
    mass += model.mass;
  for (const TerrainModel& model : learned.models)
    if (model.mass > 0)
      weigh(model, log2_q8(model.mass) - log2_q8(mass) + favour);
  for (const TerrainModel& model : training)
    weigh(model, training_share + favour);
}

// The heaviest density of the mixture at each bin's centre.
void Likelihood::weigh_for(const Terrain& learned, std::span<const TerrainModel> training, int favour) {
  positive_.fill(least_positive);
  each_model(learned, training, favour,
             [this](const TerrainModel& model, int share) { weigh_model(model, share); });
}

// The same where the ground may also lie in the other light: on top of weigh_for().
void Likelihood::weigh_other_light(const Terrain& learned, std::span<const TerrainModel> training,
                                   int favour) {
  each_model(learned, training, favour, [this](const TerrainModel& model, int share) {
    weigh_model(in_other_light(model), share + other_light_share);
  });
}

void Likelihood::weigh_model(const TerrainModel& model, int log_share) {
  constexpr int half_log_two_pi = 339; // log2(2 pi) / 2, Q8
  int scale = log_share + colors_per_bin_log2 * 256 - 3 * half_log_two_pi;
  std::array<std::array<std::int32_t, chroma_bins>, 3> term{};
  for (int c = 0; c < 3; ++c) {
    const int shift = c == 0 ? luma_bin_shift : chroma_bin_shift;
    const std::int64_t variance = std::max<std::uint32_t>(model.variance[c], 256);
    scale -= (log2_q8(static_cast<std::uint64_t>(variance)) - 8 * 256) / 2;
    for (int bin = 0; bin < 256 >> shift; ++bin) {
      const std::int64_t d = ((bin << shift) + (1 << shift >> 1)) * 256 - model.mean[c];
      // d^2 / 2 variance nats as log2 Q8: d^2 is Q16, variance Q8; log2(e) / 2 = 47274 / 65536.
      const std::int64_t fall = (d * d / variance * 47274) >> 16;
      term[c][bin] = static_cast<std::int32_t>(-std::min<std::int64_t>(fall, 1 << 20));
    }
  }
  for (int l = 0; l < luma_bins; ++l)
    for (int u = 0; u < chroma_bins; ++u) {
      const std::int32_t base = scale + term[0][l] + term[1][u];
      std::int32_t* row = &positive_[static_cast<std::size_t>(l * chroma_bins + u) * chroma_bins];
      for (int v = 0; v < chroma_bins; ++v)
        row[v] = std::max(row[v], base + term[2][v]);
    }
}

void Likelihood::weigh_against(const Terrain& learned, Negatives negatives) {
  if (negatives == Negatives::off || learned.negative_colors.size() != color_bins) {
    negative_.fill(-log2_q8(color_bins));
    return;
  }
  blur_colors(learned.negative_colors, half_blurred_, blurred_);
  const std::uint64_t total = std::max<std::uint64_t>(total_of(blurred_), 1), floor = total / negative_floor;
  const int log_total = log2_q8(total);
  for (int i = 0; i < color_bins; ++i)
    negative_[i] = log2_q8(blurred_[i] + floor) - log_total;
}

void Likelihood::compare(std::array<std::int8_t, color_bins>& table) const {
  for (int i = 0; i < color_bins; ++i)
    table[i] = static_cast<std::int8_t>(
        std::clamp(((positive_[i] - negative_[i]) * color_weight) >> 16, -color_limit, color_limit));
}

// Of the colours that speak against the terrain as much as any those that are no shade of it either.
void Likelihood::refuse_other_chroma(const Terrain& learned, std::span<const TerrainModel> training,
                                     LikelihoodTables& tables) {
  constexpr std::size_t chromas = std::size_t{chroma_bins} * chroma_bins;
  std::array<int, chromas> nearest{};
  nearest.fill(std::numeric_limits<int>::max());
  each_model(learned, training, 0, [&](const TerrainModel& model, int /*share*/) {
    std::array<std::array<int, chroma_bins>, 2> away{};
    for (std::size_t c = 0; c < 2; ++c)
      for (int bin = 0; bin < chroma_bins; ++bin)
        away[c][static_cast<std::size_t>(bin)] =
            std::abs(((bin << chroma_bin_shift) + (1 << chroma_bin_shift >> 1)) * 256 - model.mean[c + 1]);
    for (std::size_t u = 0; u < chroma_bins; ++u)
      for (std::size_t v = 0; v < chroma_bins; ++v)
        nearest[u * chroma_bins + v] = std::min(nearest[u * chroma_bins + v], away[0][u] + away[1][v]);
  });
  std::array<std::int8_t, chromas> least{};
  std::transform(nearest.begin(), nearest.end(), least.begin(),
                 [](int distance) { return distance > other_chroma << 8 ? no_ground : std::int8_t{0}; });
  for (auto* table : {&tables.color, &tables.any_light})
    for (std::size_t luma = 0; luma < color_bins; luma += chromas)
      for (std::size_t c = 0; c < chromas; ++c) {
        std::int8_t& worth = (*table)[luma + c];
        worth = worth == -color_limit ? std::min(worth, least[c]) : worth;
      }
}

void Likelihood::build(const Terrain& learned, std::span<const TerrainModel> training, int taught_q8,
                       const Settings& settings, LikelihoodTables& tables) {
  weigh_for(learned, training, favour(taught_q8));
  weigh_against(learned, settings.negatives);
  compare(tables.color);
  if (settings.light_ahead) {
    weigh_other_light(learned, training, favour(taught_q8));
    compare(tables.any_light);
  }
  if (settings.vivid_colors)
    refuse_other_chroma(learned, training, tables);

  tables.texture.fill(0);
  if (!settings.texture || learned.terrain_texture.size() != texture_bins ||
      learned.negative_texture.size() != texture_bins)
    return;
  const std::uint64_t total_for = std::max<std::uint64_t>(total_of(learned.terrain_texture) * 9, 1),
                      total_against = std::max<std::uint64_t>(total_of(learned.negative_texture) * 9, 1);
  for (int i = 0; i < texture_bins; ++i) {
    const int ratio = log2_q8(smoothed(learned.terrain_texture, i) + total_for / texture_floor) -
                      log2_q8(total_for) -
                      log2_q8(smoothed(learned.negative_texture, i) + total_against / texture_floor) +
                      log2_q8(total_against);
    tables.texture[i] = static_cast<std::int8_t>(std::clamp((ratio * texture_weight) >> 16, -127, 127));
  }
}

} // namespace terrainseg
