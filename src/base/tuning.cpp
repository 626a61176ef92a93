// SPDX-License-Identifier: LGPL-2.1-or-later
#include "base/tuning.hpp"

#ifdef TERRAINSEG_TUNABLE

#include <algorithm>

namespace terrainseg::tuning {
namespace {

// Created on first use, because source files register their constants before main() in any order.
std::vector<Knob>& registry() {
  static std::vector<Knob> all;
  return all;
}

std::vector<Table*>& tables() {
  static std::vector<Table*> all;
  return all;
}

void fill_tables() {
  for (Table* table : tables())
    table->fill();
}

} // namespace

void Table::join() {
  tables().push_back(this);
}

const std::vector<Knob>& knobs() {
  return registry();
}

bool set(std::string_view name, std::int64_t value) {
  const auto knob = std::find_if(registry().begin(), registry().end(),
                                 [&](const Knob& candidate) { return candidate.name == name; });
  if (knob == registry().end())
    return false;
  knob->assign(knob->number, value);
  fill_tables();
  return true;
}

void reset() {
  for (const Knob& knob : registry())
    knob.assign(knob.number, knob.standard);
  fill_tables();
}

void add(const Knob& knob) {
  registry().push_back(knob);
}

} // namespace terrainseg::tuning

#endif
