// SPDX-License-Identifier: LGPL-2.1-or-later
// One colour model of the unmodified algorithm: a Gaussian with a full covariance (paper, section 3.4, as in
// its reference [7], Dahlkamp et al. 2006). Colours are B, G, R in 8-bit units.
#pragma once

#include <Eigen/Dense>

namespace terrainseg::reference {

struct Gaussian {
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero(); ///< squared 8-bit units
  double mass = 0;                                      ///< pixels; 0 = a null model
  bool null() const { return mass <= 0; }
};

/// Equation (13): the squared distance between two models in units of their summed covariances. Infinite when
/// the sum is singular.
double separation(const Gaussian& learned, const Gaussian& training);

/// Equations (14) to (16): the average of both by mass. One of the two must have a mass.
Gaussian merged(const Gaussian& learned, const Gaussian& training);

/// (x - mean)^T covariance^-1 (x - mean), prepared for many x: with the Cholesky factor L of the covariance
/// it is |L^-1 (x - mean)|^2, six products instead of twelve.
class Whitening {
 public:
  /// The covariance must be positive definite.
  explicit Whitening(const Gaussian& model);
  double squared_distance(const Eigen::Vector3d& color) const;

  Eigen::Vector3d mean;
  Eigen::Matrix3d inverse_factor; ///< L^-1, lower triangular
};

} // namespace terrainseg::reference
