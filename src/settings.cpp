// SPDX-License-Identifier: LGPL-2.1-or-later
#include "terrainseg/settings.hpp"

namespace terrainseg {

Settings Settings::of(Preset preset) {
  Settings settings;
  if (preset == Preset::standard)
    return settings;
  settings.power_of_two_window = true;
  settings.window_sigma_q8 = 256;
  settings.pyramid_levels = 5;
  settings.bit_shift = 3;
  settings.training_models = 3;
  settings.mass_cap = 64;
  settings.forget_shift = 0;
  settings.threshold_q8 = 768;
  settings.horizon = HorizonMode::paper;
  settings.texture = settings.exposure = settings.row_prior = false;
  settings.local_reference = settings.geodesic = settings.second_look = false;
  settings.free_space = settings.ground_behind = settings.refine = false;
  settings.negatives = Negatives::off;
  settings.temporal = Temporal::off;
  settings.doubtful = -96;
  return settings;
}

namespace {

struct Check {
  const char* property;
  int value, low, high;
};

} // namespace

std::optional<SettingsError> validate(const Settings& s) {
  const Check checks[] = {
      {"window-width", s.window_width, 0, 32767},
      {"window-height", s.window_height, 0, 32767},
      {"window-bottom", s.window_bottom, 0, 32767},
      {"window-x", s.window_x, -1, 32767},
      {"window-sigma (Q8)", s.window_sigma_q8, 0, 1024},
      {"pyramid-levels", s.pyramid_levels, -1, max_pyramid_levels},
      {"bit-shift", s.bit_shift, 0, 7},
      {"training-models", s.training_models, 1, max_models},
      {"learned-models", s.learned_models, 1, max_models},
      {"match-threshold (Q8)", s.match_threshold_q8, 0, 16 * 256},
      {"mass-cap", s.mass_cap, 0, 1 << 20},
      {"forget-shift", s.forget_shift, 0, 15},
      {"threshold (Q8)", s.threshold_q8, 0, 16 * 256},
      {"caution", s.caution, -32, 32},
      {"doubtful", s.doubtful, -96, 96},
      {"mask-level", s.mask_level, 0, max_mask_level},
      {"blocked-below", s.blocked_below, 0, 1000},
      {"n-threads", s.n_threads, 0, max_threads},
  };
  for (const Check& c : checks)
    if (c.value < c.low || c.value > c.high)
      return SettingsError{c.property, std::to_string(c.value),
                           "outside " + std::to_string(c.low) + ".." + std::to_string(c.high)};
  if (s.learned_models <= s.training_models)
    return SettingsError{"learned-models", std::to_string(s.learned_models),
                         "must be above training-models = " + std::to_string(s.training_models)};
  return std::nullopt;
}

} // namespace terrainseg
