// SPDX-License-Identifier: LGPL-2.1-or-later
#include "freespace/score/likelihood.hpp"

#include <algorithm>
#include <cstdlib>
#include <limits>
#include <numeric>

#include "base/fixed.hpp"
#include "base/tuning.hpp"
#include "freespace/look/color_bins.hpp"

namespace terrainseg {
namespace {

/// Inverse of the largest share of the grid's width; the usual window has 30 %. With two fifths the Karlsruhe
/// streets have 0.25 points more error, because it includes objects at the sides; with the whole width 1.5
/// points more.
TERRAINSEG_TUNED(int, light_ahead, widest_part, 3);
/// Brighter models are in the sun: the middle of luma. The error is nearly constant from 90 to 130.
TERRAINSEG_TUNED(int, light_ahead, sunlit, 128 << 8);
constexpr int most = 255 << 8;

} // namespace

Columns columns_ahead(const Rectangle& window, int grid_width) {
  const int width = std::min(window.width, std::max(grid_width / widest_part, 1)),
            first = window.x + (window.width - width) / 2;
  return {std::clamp(first, 0, grid_width), std::clamp(first + width, 0, grid_width)};
}

TerrainModel in_other_light(const TerrainModel& model) {
  TerrainModel other = model;
  other.mean[0] = static_cast<std::uint16_t>(model.mean[0] >= sunlit ? model.mean[0] / 2
                                                                     : std::min(2 * model.mean[0], most));
  other.variance[0] = 2 * model.variance[0];
  return other;
}

namespace {

constexpr int colors_per_bin_log2 = luma_bin_shift + 2 * chroma_bin_shift;

TERRAINSEG_TUNED(int, likelihood, score_limit, 48); ///< 1.5 nats: no cell outweighs two neighbours
/// Smallest score of ground that is connected to the window: reduces the error on Mars from 15.3 to 7.1 %. A
/// wall that has entered the window is similar to itself too, but not yet to the ground; its cells get no
/// more than the mean score of the seeds.
TERRAINSEG_TUNED(int, likelihood, least_of_vouched, 24);

constexpr std::uint64_t frame_weight = 1 << 20; ///< total weight of one frame in a histogram
constexpr std::uint64_t histogram_limit = std::uint64_t{1} << 30;

/// Smallest probability of a bin under the mixture, log2 Q8.
TERRAINSEG_TUNED(int, likelihood, least_positive, -3968);
/// Bias towards the terrain, log2 Q8. Most of "the rest of the frame" is ground, so the plain ratio is near 0
/// on the ground itself. The error is nearly constant from 3 to 4.5 octaves; without the bias the mean error
/// of five sequences is 8.4 % instead of 5.5 %.
TERRAINSEG_TUNED(int, likelihood, rest_is_ground, 950);
/// The bias when a range sensor or a large window covers most of the ground, so that the rest is not ground.
/// With training from depth indoors, the full bias labels 9.6 % of the non-ground as traversable, this one
/// 1.0 %.
TERRAINSEG_TUNED(int, likelihood, rest_of_taught, 300);
/// Learned shares of the picture, Q8, between which the bias changes from one to the other. The usual window
/// has 5 to 12.
TERRAINSEG_TUNED(int, likelihood, little_taught, 32);
TERRAINSEG_TUNED(int, likelihood, much_taught, 64);
/// Share of a training model, log2 Q8: a fifth. The error is nearly constant from an eighth to a half.
/// Without it single frames after a sudden change of the scene lose all ground (off-road 11.6 % instead of
/// 10.8 % with forgetting by >> 6).
TERRAINSEG_TUNED(int, likelihood, training_share, -619);
/// Share of a model in the other light relative to its own, log2 Q8: a half. The error is nearly constant
/// from a quarter to all of it.
TERRAINSEG_TUNED(int, likelihood, other_light_share, -256);
/// Inverse of the smallest share of a bin of colours of the rest, and of textures.
TERRAINSEG_TUNED(std::uint64_t, likelihood, smallest_share, 10000);
/// 0.385 of the log ratio in nats, 32 = 1 nat, from log2 Q8 (Q16).
TERRAINSEG_TUNED(int, likelihood, color_weight, 2180);
/// Colour alone can be misleading: it never outweighs texture, and one cell never outweighs its neighbours.
TERRAINSEG_TUNED(int, likelihood, color_limit, 26);
/// Largest chroma distance |U| + |V| from the nearest model, in normalised grey levels, that another light
/// can explain. Beyond it the colour is that of an obstacle, such as a car or a box as smooth as the road.
/// The error is nearly constant from 104 to 136 except for India (8.3 %, 8.0 %). With 88 sunlit roads have
/// 12.2 % error instead of 11.4 %, with 72 roads by day have 10.8 % instead of 8.7 %, because of their
/// verges.
TERRAINSEG_TUNED(int, likelihood, other_chroma, 136);
constexpr std::int8_t no_ground = -128; ///< score of such a colour, which texture cannot compensate
/// 1.6 of the log ratio.
TERRAINSEG_TUNED(int, likelihood, texture_weight, 9086);

std::uint64_t total_of(std::span<const std::uint32_t> histogram) {
  return std::accumulate(histogram.begin(), histogram.end(), std::uint64_t{0});
}

void fade(std::vector<std::uint32_t>& histogram, int shift) {
  if (shift > 0)
    for (std::uint32_t& h : histogram)
      h -= h >> shift;
  // Without forgetting the counts would overflow after some hours. Halving keeps their proportions.
  if (total_of(histogram) > histogram_limit)
    for (std::uint32_t& h : histogram)
      h >>= 1;
}

// With repeated ends a sum is at most three times the histogram.
static_assert(3 * (histogram_limit + (std::uint64_t{1} << 27)) < (std::uint64_t{1} << 32));

std::uint64_t smoothed(std::span<const std::uint32_t> histogram, int bin) {
  constexpr int weights[5] = {1, 2, 3, 2, 1};
  std::uint64_t sum = 0;
  for (int k = -2; k <= 2; ++k)
    sum += std::uint64_t{histogram[std::clamp(bin + k, 0, texture_bins - 1)]} * weights[k + 2];
  return sum;
}

// The bias towards the terrain, log2 Q8, when the share `taught_q8` of the picture was learned as terrain.
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
  // These loops are auto-vectorised.
  if (negatives == Negatives::split && last.size() == static_cast<std::size_t>(grid.width))
    for (int i = 0; i < grid.height; ++i) {
      Lesson* const row = &lessons[grid.at(i, 0)];
      for (int j = 0; j < grid.width; ++j)
        row[j] = last[j] <= i ? Lesson::against_little : Lesson::against;
    }
  for (std::size_t i = 0; i < joined.size(); ++i)
    lessons[i] = joined[i] ? Lesson::terrain : lessons[i];
  for (std::size_t i = 0; i < grid.size(); ++i)
    lessons[i] = grid.ignored[i] ? Lesson::nothing : lessons[i];
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
      // Halved for a colour with the largest evidence for the ground in any light.
      const int doubt = any_light && color == color_limit ? penalty[i] / 2 : penalty[i],
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

// The models with their shares of the mass; a training model has a fixed one.
void Likelihood::weigh_for(const Terrain& learned, std::span<const TerrainModel> training, int favour) {
  std::uint64_t mass = 0;
  for (const TerrainModel& model : learned.models)
    mass += model.mass;
  models_ = 0;
  const auto weigh = [&](const TerrainModel& model, int share) {
    own_[models_] = terms_of(model, share + favour);
    if (light_ahead_)
      other_[models_] = terms_of(in_other_light(model), share + favour + other_light_share);
    ++models_;
  };
  for (const TerrainModel& model : learned.models)
    if (model.mass > 0)
      weigh(model, log2_q8(model.mass) - log2_q8(mass));
  for (const TerrainModel& model : training)
    weigh(model, training_share);
}

Likelihood::Terms Likelihood::terms_of(const TerrainModel& model, int log_share) {
  constexpr int half_log_two_pi = 339; // log2(2 pi) / 2, Q8
  int scale = log_share + colors_per_bin_log2 * 256 - 3 * half_log_two_pi;
  Terms terms;
  // Returns the distance of a bin's centre from the mean, Q8.
  const auto away = [&](std::size_t c, std::size_t bin, int shift) {
    return ((static_cast<int>(bin) << shift) + (1 << shift >> 1)) * 256 - model.mean[c];
  };
  const auto fill = [&](std::size_t c, int shift, auto& term) {
    const std::int64_t variance = std::max<std::uint32_t>(model.variance[c], 256);
    scale -= (log2_q8(static_cast<std::uint64_t>(variance)) - 8 * 256) / 2;
    for (std::size_t bin = 0; bin < term.size(); ++bin) {
      const std::int64_t d = away(c, bin, shift);
      // d^2 / (2 variance) nats as log2 Q8: d^2 is Q16, variance Q8; log2(e) / 2 = 47274 / 65536.
      const std::int64_t fall = (d * d / variance * 47274) >> 16;
      term[bin] = static_cast<std::int32_t>(-std::min<std::int64_t>(fall, 1 << 20));
    }
  };
  fill(0, luma_bin_shift, terms.luma);
  fill(1, chroma_bin_shift, terms.u);
  fill(2, chroma_bin_shift, terms.v);
  for (std::int32_t& term : terms.luma)
    term += scale;
  for (std::size_t bin = 0; bin < chroma_bins; ++bin) {
    terms.away_u[bin] = std::abs(away(1, bin, chroma_bin_shift));
    terms.away_v[bin] = std::abs(away(2, bin, chroma_bin_shift));
  }
  return terms;
}

void Likelihood::weigh_against(const Terrain& learned, Negatives negatives) {
  if (negatives == Negatives::off || learned.negative_colors.size() != color_bins) {
    blurred_.fill(0);
    floor_ = 1;
    log_total_ = log2_q8(color_bins);
    return;
  }
  blur_colors(learned.negative_colors, {}, half_blurred_, blurred_);
  const std::uint64_t total = std::max<std::uint64_t>(total_of(blurred_), 1);
  floor_ = total / smallest_share;
  log_total_ = log2_q8(total);
}

void Likelihood::compute(std::uint16_t color, LikelihoodTables& tables) const {
  const std::size_t l = color >> 8, u = color >> 4 & 15, v = color & 15;
  std::int32_t positive = least_positive;
  const auto raise = [&](const std::array<Terms, 2 * max_models>& models) {
    for (std::size_t m = 0; m < models_; ++m)
      positive = std::max(positive, models[m].luma[l] + models[m].u[u] + models[m].v[v]);
  };
  const int negative = log2_q8(blurred_[color] + floor_) - log_total_;
  int refused = 0;
  if (vivid_colors_) {
    // A colour with the largest evidence against the terrain whose chroma is far from that of every model.
    int nearest = std::numeric_limits<int>::max();
    for (std::size_t m = 0; m < models_; ++m)
      nearest = std::min(nearest, own_[m].away_u[u] + own_[m].away_v[v]);
    refused = nearest > other_chroma << 8 ? no_ground : 0;
  }
  const auto ratio = [&] {
    const int worth = std::clamp(((positive - negative) * color_weight) >> 16, -color_limit, color_limit);
    return static_cast<std::int8_t>(worth == -color_limit ? std::min(worth, refused) : worth);
  };
  raise(own_);
  tables.color[color] = ratio();
  if (!light_ahead_)
    return;
  raise(other_);
  tables.any_light[color] = ratio();
}

void Likelihood::compute(std::span<const std::uint16_t> colors, LikelihoodTables& tables) {
  for (const std::uint16_t color : colors)
    if (!computed_[color]) {
      computed_[color] = true;
      compute(color, tables);
    }
}

void Likelihood::build(const Terrain& learned, std::span<const TerrainModel> training, int taught_q8,
                       const Settings& settings, LikelihoodTables& tables) {
  light_ahead_ = settings.light_ahead;
  vivid_colors_ = settings.vivid_colors;
  weigh_for(learned, training, favour(taught_q8));
  weigh_against(learned, settings.negatives);
  computed_.fill(false);

  tables.texture.fill(0);
  if (!settings.texture || learned.terrain_texture.size() != texture_bins ||
      learned.negative_texture.size() != texture_bins)
    return;
  const std::uint64_t total_for = std::max<std::uint64_t>(total_of(learned.terrain_texture) * 9, 1),
                      total_against = std::max<std::uint64_t>(total_of(learned.negative_texture) * 9, 1);
  for (int i = 0; i < texture_bins; ++i) {
    const int ratio = log2_q8(smoothed(learned.terrain_texture, i) + total_for / smallest_share) -
                      log2_q8(total_for) -
                      log2_q8(smoothed(learned.negative_texture, i) + total_against / smallest_share) +
                      log2_q8(total_against);
    tables.texture[i] = static_cast<std::int8_t>(std::clamp((ratio * texture_weight) >> 16, -127, 127));
  }
}

void TerrainTables::learned(const TrainingModels& training, int taught_q8) {
  training_ = training;
  taught_q8_ = taught_q8;
  old_ = true;
}

void TerrainTables::rely_on_memory() {
  old_ |= training_.count > 0;
  training_.count = 0;
}

void TerrainTables::forget() {
  training_.count = 0;
  taught_q8_ = 0;
  old_ = true;
}

const LikelihoodTables& TerrainTables::of(const Terrain& terrain, const Settings& settings,
                                          std::span<const std::uint16_t> colors) {
  if (old_)
    likelihood_.build(terrain, training_.span(), taught_q8_, settings, tables_);
  old_ = false;
  likelihood_.compute(colors, tables_);
  return tables_;
}

} // namespace terrainseg
