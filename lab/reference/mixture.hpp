// SPDX-License-Identifier: LGPL-2.1-or-later
// The learned models and the rules by which training models change them (equations (13) to (17)).
#pragma once

#include <cstddef>
#include <vector>

#include "lab/reference/gaussian.hpp"

namespace terrainseg::reference {

class Mixture {
 public:
  /// `capacity` null models (n, above 0).
  explicit Mixture(std::size_t capacity);

  /// One frame's training models, heaviest first whatever their order here. Each is merged into the nearest
  /// learned model whose separation is `match_threshold` or less; without one it fills a null slot; without a
  /// null slot it replaces the learned model of least mass. No model's mass grows beyond `mass_cap` pixels.
  void learn(std::vector<Gaussian> training, double match_threshold, double mass_cap);

  /// All slots, null ones included.
  const std::vector<Gaussian>& models() const { return models_; }
  /// The models that score: those whose mass is at least `share` of the heaviest. Empty while all are null.
  std::vector<Gaussian> heaviest(double share) const;
  bool empty() const;

 private:
  std::vector<Gaussian> models_;
};

} // namespace terrainseg::reference
