// SPDX-License-Identifier: LGPL-2.1-or-later
#include "lab/reference/gaussian.hpp"

#include <limits>

namespace terrainseg::reference {

double separation(const Gaussian& learned, const Gaussian& training) {
  const Eigen::LLT<Eigen::Matrix3d> factor(learned.covariance + training.covariance);
  if (factor.info() != Eigen::Success)
    return std::numeric_limits<double>::infinity();
  return factor.matrixL().solve(learned.mean - training.mean).squaredNorm();
}

Gaussian merged(const Gaussian& learned, const Gaussian& training) {
  const double mass = learned.mass + training.mass;
  return {(learned.mean * learned.mass + training.mean * training.mass) / mass,
          (learned.covariance * learned.mass + training.covariance * training.mass) / mass, mass};
}

Whitening::Whitening(const Gaussian& model) : mean(model.mean) {
  const Eigen::LLT<Eigen::Matrix3d> factor(model.covariance);
  inverse_factor = factor.matrixL().solve(Eigen::Matrix3d::Identity());
}

double Whitening::squared_distance(const Eigen::Vector3d& color) const {
  return (inverse_factor * (color - mean)).squaredNorm();
}

} // namespace terrainseg::reference
