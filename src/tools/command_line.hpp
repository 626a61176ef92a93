// SPDX-License-Identifier: LGPL-2.1-or-later
// Command-line parsing for the tools, on top of GLib's options.
#pragma once

#include <glib.h>

#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

namespace terrainseg::tools {

/// An invalid command line.
class UsageError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

struct FreeContext {
  void operator()(GOptionContext* context) const { g_option_context_free(context); }
};
using OptionContext = std::unique_ptr<GOptionContext, FreeContext>;

/// A list for GLib to write; owns its strings.
struct Words {
  Words() = default;
  ~Words() { g_strfreev(list); }
  Words(const Words&) = delete;
  Words& operator=(const Words&) = delete;
  std::vector<std::string> all() const {
    return list ? std::vector<std::string>(list, list + g_strv_length(list)) : std::vector<std::string>();
  }
  char** list = nullptr;
};

/// A string for GLib to write; owns it.
struct Word {
  Word() = default;
  ~Word() { g_free(text); }
  Word(const Word&) = delete;
  Word& operator=(const Word&) = delete;
  std::string value(const std::string& otherwise = "") const { return text ? text : otherwise; }
  char* text = nullptr;
};

/// Parses the arguments; throws UsageError.
inline void parse(GOptionContext* context, const std::vector<std::string>& words, const char* name) {
  g_autoptr(GStrvBuilder) builder = g_strv_builder_new();
  g_strv_builder_add(builder, name);
  for (const std::string& word : words)
    g_strv_builder_add(builder, word.c_str());
  g_auto(GStrv) strv = g_strv_builder_end(builder);
  g_autoptr(GError) error = nullptr;
  if (!g_option_context_parse_strv(context, &strv, &error))
    throw UsageError(error->message);
}

} // namespace terrainseg::tools
