// SPDX-License-Identifier: LGPL-2.1-or-later
#include "lab/eval/table.hpp"

#include <utility>

namespace terrainseg::eval {

Table::Table(std::vector<std::string> head) {
  std::vector<std::string> rule(head.size(), "---");
  rows_ = {std::move(head), std::move(rule)};
}

void Table::add(std::vector<std::string> row) {
  rows_.push_back(std::move(row));
}

std::string Table::text() const {
  std::string text;
  for (const auto& row : rows_) {
    for (const std::string& cell : row)
      text += "| " + cell + " ";
    text += "|\n";
  }
  return text;
}

} // namespace terrainseg::eval
