// SPDX-License-Identifier: LGPL-2.1-or-later
#include "lab/reference/mixture.hpp"

#include <algorithm>
#include <limits>

namespace terrainseg::reference {

namespace {

bool lighter(const Gaussian& a, const Gaussian& b) {
  return a.mass < b.mass;
}

} // namespace

Mixture::Mixture(std::size_t capacity) : models_(capacity) {}

void Mixture::learn(std::vector<Gaussian> training, double match_threshold, double mass_cap) {
  std::stable_sort(training.begin(), training.end(),
                   [](const Gaussian& a, const Gaussian& b) { return lighter(b, a); });
  for (const Gaussian& seen : training) {
    if (seen.null())
      continue;
    Gaussian* nearest = nullptr;
    double least = std::numeric_limits<double>::infinity();
    for (Gaussian& model : models_) {
      if (model.null())
        continue;
      const double distance = separation(model, seen);
      if (distance <= match_threshold && distance < least) {
        least = distance;
        nearest = &model;
      }
    }
    if (nearest)
      *nearest = merged(*nearest, seen);
    else {
      // A null model has mass 0, so the lightest slot is a null one as long as there is any: equation (17).
      nearest = &*std::min_element(models_.begin(), models_.end(), lighter);
      *nearest = seen;
    }
    nearest->mass = std::min(nearest->mass, mass_cap);
  }
}

std::vector<Gaussian> Mixture::heaviest(double share) const {
  std::vector<Gaussian> chosen;
  const double limit = share * std::max_element(models_.begin(), models_.end(), lighter)->mass;
  for (const Gaussian& model : models_)
    if (!model.null() && model.mass >= limit)
      chosen.push_back(model);
  return chosen;
}

bool Mixture::empty() const {
  return std::all_of(models_.begin(), models_.end(), [](const Gaussian& model) { return model.null(); });
}

} // namespace terrainseg::reference
