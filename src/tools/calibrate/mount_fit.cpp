// SPDX-License-Identifier: LGPL-2.1-or-later
#include "tools/calibrate/mount_fit.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <numeric>
#include <stdexcept>
#include <string>
#include <tuple>
#include <utility>

namespace terrainseg::calibrate {
namespace {

using metric::Camera, metric::GroundProjection, metric::ImagePoint, metric::Mount;

constexpr double degree = std::numbers::pi / 180;
constexpr double steepest = 80 * degree;
constexpr int most_rounds = 100;
constexpr int starts = 24; ///< number of initial heights
constexpr double worst_fit = 1 * degree;
constexpr double worst_height = 0.2;         ///< maximum standard deviation, share of the height
constexpr double worst_pitch = 5 * degree;   ///< maximum standard deviation for one row of error
constexpr double useful_roll = 1.5 * degree; ///< maximum standard deviation with which roll is fitted

enum Parameter : int { log_height, pitch, roll };
using Values = std::array<double, 3>;
using Matrix = std::array<Values, 3>;

/// Inverse of a symmetric matrix.
struct Inverse {
  Matrix entries{};
  double condition = 0; ///< ratio of the smallest to the largest eigenvalue
};

/// Of the first `size` rows and columns, from eigenvalues by Jacobi's rotations. Directions whose eigenvalue
/// is lost in rounding are left out.
Inverse inverse_of(Matrix m, std::size_t size) {
  Matrix vectors{{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}}; // columns; the eigenvalues become the diagonal of m
  for (int sweep = 0; sweep < 30; ++sweep)
    for (std::size_t p = 0; p < 2; ++p)
      for (std::size_t q = p + 1; q < 3; ++q) {
        if (m[p][q] == 0)
          continue;
        const double theta = (m[q][q] - m[p][p]) / (2 * m[p][q]);
        const double t = std::copysign(1.0, theta) / (std::abs(theta) + std::hypot(theta, 1.0));
        const double c = 1 / std::hypot(t, 1.0), s = t * c;
        const auto rotate = [c, s](double& a, double& b) {
          std::tie(a, b) = std::pair(c * a - s * b, s * a + c * b);
        };
        for (std::size_t k = 0; k < 3; ++k)
          rotate(m[k][p], m[k][q]);
        for (std::size_t k = 0; k < 3; ++k)
          rotate(m[p][k], m[q][k]);
        for (std::size_t k = 0; k < 3; ++k)
          rotate(vectors[k][p], vectors[k][q]);
      }
  Inverse inverse;
  const double most = std::max({std::abs(m[0][0]), std::abs(m[1][1]), std::abs(m[2][2])});
  double least = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < 3; ++i) {
    double share = 0; // fixed parameters have rows and columns of zeros, and so eigenvalues of zero
    for (std::size_t row = 0; row < size; ++row)
      share += vectors[row][i] * vectors[row][i];
    if (share < 0.5)
      continue;
    least = std::min(least, std::abs(m[i][i]));
    if (std::abs(m[i][i]) <= 1e-16 * most)
      continue;
    for (std::size_t a = 0; a < size; ++a)
      for (std::size_t b = 0; b < size; ++b)
        inverse.entries[a][b] += vectors[a][i] * vectors[b][i] / m[i][i];
  }
  inverse.condition = most > 0 ? least / most : 0;
  return inverse;
}

std::string name_of(std::size_t index, const MeasuredPoint& point) {
  char text[96];
  std::snprintf(text, sizeof text, "point %zu (column %g, row %g, %g m)", index + 1, point.u, point.v,
                point.distance);
  return text;
}

/// Searches the mount from which given points are seen.
class Search {
 public:
  Search(const Camera& camera, std::span<const MeasuredPoint> points, const Known& known,
         std::vector<int> free)
      : points_(points), free_(std::move(free)), start_roll_(known.roll.value_or(0)) {
    for (std::size_t i = 0; i < points.size(); ++i) {
      const MeasuredPoint& p = points[i];
      if (p.u < -0.5 || p.v < -0.5 || p.u > camera.width - 0.5 || p.v > camera.height - 0.5)
        throw std::runtime_error(name_of(i, p) + " lies outside the picture of " +
                                 std::to_string(camera.width) + "x" + std::to_string(camera.height) +
                                 ": read pixels in a picture of that size, or name the picture with --frame");
      const auto ray = metric::undistort(camera, p.u, p.v);
      if (!ray)
        throw std::runtime_error(
            name_of(i, p) + " is outside the valid range of the lens model: take one nearer to the middle");
      rays_.push_back(*ray);
    }
  }

  struct Found {
    Values at{};
    double cost = std::numeric_limits<double>::infinity(); ///< sum of squared residuals, radians
  };

  Found from(double height) const {
    Found now;
    now.at = {std::log(height), 0, start_roll_};
    double mean = 0;
    for (std::size_t i = 0; i < rays_.size(); ++i)
      mean += std::atan2(height, points_[i].distance) - descent(mount_at(now.at), rays_[i]);
    now.at[pitch] = std::clamp(mean / static_cast<double>(rays_.size()), -steepest, steepest);
    now.cost = cost(now.at);
    double damping = 1e-3;
    for (int round = 0; round < most_rounds && damping < 1e12; ++round) {
      Found next = now;
      const auto jacobian = slopes(now.at);
      const auto errors_now = errors(now.at);
      Matrix normal = normal_of(jacobian);
      Values gradient{};
      for (std::size_t i = 0; i < free_.size(); ++i) {
        normal[i][i] *= 1 + damping;
        for (std::size_t k = 0; k < errors_now.size(); ++k)
          gradient[i] += jacobian[k][i] * errors_now[k];
      }
      const Inverse inverse = inverse_of(normal, free_.size());
      double step = 0;
      for (std::size_t i = 0; i < free_.size(); ++i) {
        double part = 0;
        for (std::size_t k = 0; k < free_.size(); ++k)
          part += inverse.entries[i][k] * gradient[k];
        next.at[free_[i]] -= part;
        step = std::hypot(step, part);
      }
      next.cost = sound(next.at) ? cost(next.at) : std::numeric_limits<double>::infinity();
      if (next.cost < now.cost) {
        const bool settled = step < 1e-13;
        now = next;
        damping /= 10;
        if (settled)
          break;
      } else {
        damping *= 10;
      }
    }
    return now;
  }

  /// One standard deviation of each free parameter for errors of `sigma` radians; infinite if the points do
  /// not determine it.
  Values deviations(const Values& at, double sigma) const {
    Values out{};
    const Inverse inverse = inverse_of(normal_of(slopes(at)), free_.size());
    for (std::size_t i = 0; i < free_.size(); ++i)
      out[free_[i]] = inverse.condition < 1e-12 ? std::numeric_limits<double>::infinity()
                                                : sigma * std::sqrt(std::max(inverse.entries[i][i], 0.0));
    return out;
  }

  double root_mean_square(const Found& found) const {
    return std::sqrt(found.cost / static_cast<double>(rays_.size()));
  }
  /// Uses the residuals as the reading error, but at least `least`.
  double reading_error(const Found& found, double least) const {
    const double over = static_cast<double>(rays_.size()) - static_cast<double>(free_.size());
    return over > 0 ? std::max(least, std::sqrt(found.cost / over)) : least;
  }
  static Mount mount_at(const Values& at) {
    return {.height = std::exp(at[log_height]), .pitch = at[pitch], .roll = at[roll]};
  }
  const std::vector<ImagePoint>& rays() const { return rays_; }

 private:
  static bool sound(const Values& at) {
    return std::abs(at[log_height]) < 8 && std::abs(at[pitch]) <= steepest && std::abs(at[roll]) <= steepest;
  }
  std::vector<double> errors(const Values& at) const {
    const Mount mount = mount_at(at);
    std::vector<double> out;
    for (std::size_t i = 0; i < rays_.size(); ++i)
      out.push_back(descent(mount, rays_[i]) - std::atan2(mount.height, points_[i].distance));
    return out;
  }
  double cost(const Values& at) const {
    const auto all = errors(at);
    return std::inner_product(all.begin(), all.end(), all.begin(), 0.0);
  }
  /// A row per point, a column per free parameter.
  std::vector<Values> slopes(const Values& at) const {
    constexpr double step = 1e-6;
    std::vector<Values> out(rays_.size());
    for (std::size_t i = 0; i < free_.size(); ++i) {
      Values low = at, high = at;
      low[free_[i]] -= step;
      high[free_[i]] += step;
      const auto before = errors(low), after = errors(high);
      for (std::size_t k = 0; k < out.size(); ++k)
        out[k][i] = (after[k] - before[k]) / (2 * step);
    }
    return out;
  }
  static Matrix normal_of(const std::vector<Values>& jacobian) {
    Matrix out{};
    for (const Values& row : jacobian)
      for (std::size_t a = 0; a < 3; ++a)
        for (std::size_t b = 0; b < 3; ++b)
          out[a][b] += row[a] * row[b];
    return out;
  }

  std::span<const MeasuredPoint> points_;
  std::vector<int> free_;
  double start_roll_;
  std::vector<ImagePoint> rays_;
};

/// All local minima about as good as the best, ordered by height.
std::vector<Search::Found> candidates(const Search& search, std::span<const MeasuredPoint> points,
                                      const Known& known, double one_row) {
  if (known.height)
    return {search.from(*known.height)};
  const auto [near, far] = std::ranges::minmax_element(points, {}, &MeasuredPoint::distance);
  std::vector<Search::Found> found;
  found.reserve(starts);
  const double low = std::log(near->distance / 50), high = std::log(far->distance * 10);
  for (int i = 0; i < starts; ++i)
    found.push_back(search.from(std::exp(low + (high - low) * i / (starts - 1))));
  const double best = search.root_mean_square(*std::ranges::min_element(found, {}, &Search::Found::cost));
  std::erase_if(found,
                [&](const Search::Found& f) { return search.root_mean_square(f) > best + one_row / 2; });
  std::ranges::sort(found, {}, [](const Search::Found& f) { return f.at[log_height]; });
  return found;
}

void check_points(std::span<const MeasuredPoint> points, const Known& known) {
  if (known.height && !(*known.height > 0 && *known.height <= 1000))
    throw std::runtime_error("the height must be above 0 and at most 1000 m");
  if (points.size() < (known.height ? 1u : 2u))
    throw std::runtime_error(known.height
                                 ? "a point is needed beside the height: --point COLUMN,ROW,METRES"
                                 : "two points are needed, one near and one at least twice as far: --point "
                                   "COLUMN,ROW,METRES (one suffices with --height)");
}

/// The point with the largest deviation from the others.
std::string suspect(const MountFit& fit, std::span<const MeasuredPoint> points) {
  const auto off = [](const Residual& residual) { return std::abs(residual.rows); };
  const auto worst = std::ranges::max_element(fit.residuals, {}, off);
  const auto index = static_cast<std::size_t>(worst - fit.residuals.begin());
  char text[64];
  std::snprintf(text, sizeof text, " is off by %.0f rows", off(*worst));
  return name_of(index, points[index]) + text;
}

/// The residuals of the points for a mount.
std::vector<Residual> residuals_of(Mount at_lens, const Search& search, std::span<const MeasuredPoint> points,
                                   double one_row) {
  at_lens.x = at_lens.y = 0;
  const GroundProjection ground(at_lens);
  std::vector<Residual> residuals;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const ImagePoint& ray = search.rays()[i];
    Residual r;
    r.rows = (descent(at_lens, ray) - std::atan2(at_lens.height, points[i].distance)) / one_row;
    if (const auto point = ground(ray))
      r.measured = std::hypot(point->x, point->y);
    residuals.push_back(r);
  }
  return residuals;
}

Mount mount_of(const Values& at, const Known& known) {
  Mount mount = Search::mount_at(at);
  mount.height = known.height.value_or(mount.height);
  mount.yaw = known.yaw;
  mount.x = known.x;
  mount.y = known.y;
  return mount;
}

/// Throws if the points do not determine a mount.
void check_fit(const MountFit& fit, double spread, std::span<const MeasuredPoint> points) {
  const bool vague =
      !(fit.height_error < worst_height * fit.mount.height) || !(fit.pitch_error < worst_pitch);
  if (spread > worst_fit)
    throw std::runtime_error("the points fit no mount: " + suspect(fit, points) +
                             "; check columns, rows and metres, and that the calibration is this camera's");
  if (vague)
    throw std::runtime_error(
        "the points do not determine height and pitch: take one near the lower edge and one at "
        "least twice as far, or measure the height of the lens and state --height");
  if (std::string flaw = metric::flaw_of(fit.mount); !flaw.empty())
    throw std::runtime_error("the points give an impossible mount: " + flaw);
}

/// Fits the given free parameters; nothing if they include roll and the points do not determine it.
std::optional<MountFit> fit_with(const std::vector<int>& free, const Camera& camera,
                                 std::span<const MeasuredPoint> points, const Known& known) {
  const double one_row = 1 / camera.fy;
  const Search search(camera, points, known, free);
  const auto found = candidates(search, points, known, one_row);
  const Search::Found& best = found.front();
  const Values deviation = search.deviations(best.at, search.reading_error(best, one_row));
  MountFit fit;
  fit.roll_found = std::ranges::count(free, roll) > 0;
  if (fit.roll_found && !(deviation[roll] < useful_roll))
    return std::nullopt;
  fit.mount = mount_of(best.at, known);
  fit.height_error = deviation[log_height] * fit.mount.height;
  fit.pitch_error = deviation[pitch];
  fit.roll_error = deviation[roll];
  fit.root_mean_square = search.root_mean_square(best) / one_row;
  fit.residuals = residuals_of(fit.mount, search, points, one_row);
  check_fit(fit, search.root_mean_square(best), points);
  // The next higher one; for others the near point would be behind the camera.
  for (std::size_t i = 1; i < found.size() && !fit.other_height && !known.height; ++i)
    if (const double other = std::exp(found[i].at[log_height]); other > fit.mount.height * 1.05)
      fit.other_height = other;
  fit.mount.pitch_error = std::max(fit.mount.pitch_error, fit.pitch_error);
  return fit;
}

} // namespace

double descent(const Mount& mount, const ImagePoint& ray) {
  const GroundProjection ground(mount);
  return std::atan2(-ground.along(2, ray), std::hypot(ground.along(0, ray), ground.along(1, ray)));
}

MountFit fit_mount(const metric::Camera& camera, std::span<const MeasuredPoint> points, const Known& known) {
  check_points(points, known);
  std::vector<int> free = known.height ? std::vector<int>{pitch} : std::vector<int>{log_height, pitch};
  // Roll is fitted if there are enough points and they determine it. If the height is free too, one more
  // point than unknowns is needed, because each of the two possible heights would have its own roll.
  const std::size_t for_roll = free.size() + (known.height ? 1 : 2);
  if (!known.roll && points.size() >= for_roll) {
    std::vector<int> with_roll = free;
    with_roll.push_back(roll);
    if (auto fit = fit_with(with_roll, camera, points, known))
      return *std::move(fit);
  }
  return *fit_with(free, camera, points, known); // a fit without roll always exists
}

} // namespace terrainseg::calibrate
