// SPDX-License-Identifier: LGPL-2.1-or-later
// A Markdown table that grows row by row.
#pragma once

#include <string>
#include <vector>

namespace terrainseg::eval {

class Table {
 public:
  explicit Table(std::vector<std::string> head);
  void add(std::vector<std::string> row);
  std::string text() const;

 private:
  std::vector<std::vector<std::string>> rows_;
};

} // namespace terrainseg::eval
