// SPDX-License-Identifier: LGPL-2.1-or-later
#include "tools/process/display.hpp"

#include <glib.h>
#include <sys/ioctl.h>

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "exchange/counted.hpp"
#include "tools/process/handles.hpp"

namespace terrainseg::process {
namespace {

constexpr double plain_interval = 5;
constexpr double rate_span = 4; // seconds
constexpr int widest_bar = 30;
constexpr int narrowest_bar = 8;

/// Percentage, frames, frames per second, time left.
std::string figures(const Moment& moment) {
  char percent[16];
  g_snprintf(percent, sizeof percent, "%3d", moment.permille / 10);
  std::string text = std::string(moment.permille < 0 ? "  ?" : percent) + " %  " +
                     counted(moment.frames, "frame") + "  " + number_text("%.1f", moment.fps) + " fps";
  // The estimate is too unstable at the beginning.
  if (moment.whole_permille >= 5)
    text += "  " + duration_text(moment.seconds * (1000 - moment.whole_permille) / moment.whole_permille) +
            " left";
  return text;
}

std::string position(const Moment& moment) {
  return "[" + std::to_string(std::min(moment.done + 1, moment.inputs)) + "/" +
         std::to_string(moment.inputs) + "] ";
}

/// Length of the UTF-8 character at `text` in bytes, and its width in terminal columns; invalid bytes count
/// as one character each.
struct Character {
  std::size_t bytes = 1;
  int columns = 1;
};

Character character_at(const char* text, std::size_t left) {
  const gunichar code = g_utf8_get_char_validated(text, static_cast<gssize>(left));
  if (code == static_cast<gunichar>(-1) || code == static_cast<gunichar>(-2))
    return {};
  const int columns = g_unichar_iszerowidth(code) ? 0 : g_unichar_iswide(code) ? 2 : 1;
  return {static_cast<std::size_t>(g_utf8_next_char(text) - text), columns};
}

int columns_of(const std::string& text) {
  int columns = 0;
  for (std::size_t at = 0; at < text.size();) {
    const Character character = character_at(text.data() + at, text.size() - at);
    columns += character.columns;
    at += character.bytes;
  }
  return columns;
}

/// The end of the text, limited to `columns`, with a mark if it was cut.
std::string tail_of(const std::string& text, int columns) {
  int left = columns_of(text);
  if (left <= columns)
    return text;
  std::size_t begin = 0;
  while (begin < text.size() && left > columns - 1) {
    const Character character = character_at(text.data() + begin, text.size() - begin);
    left -= character.columns;
    begin += character.bytes;
  }
  return text.substr(begin).insert(0, 1, '~');
}

/// Replaces control characters, which could control the terminal.
std::string harmless(std::string text) {
  std::ranges::replace_if(
      text, [](char letter) { return g_ascii_iscntrl(letter); }, '?');
  return text;
}

} // namespace

double Rate::at(double seconds, std::uint64_t frames) {
  history_.emplace_back(seconds, frames);
  while (history_.size() > 2 && history_[1].first < seconds - rate_span)
    history_.pop_front();
  const auto [begin, before] = history_.front();
  return seconds > begin ? static_cast<double>(frames - before) / (seconds - begin) : 0;
}

std::string duration_text(double seconds) {
  const long whole = std::max(0L, std::lround(seconds));
  char text[48];
  if (whole >= 3600)
    g_snprintf(text, sizeof text, "%ld:%02ld:%02ld", whole / 3600, whole / 60 % 60, whole % 60);
  else
    g_snprintf(text, sizeof text, "%ld:%02ld", whole / 60, whole % 60);
  return text;
}

std::string plain_line(const Moment& moment) {
  return position(moment) + harmless(moment.name) + ": " + figures(moment);
}

std::string bar_line(const Moment& moment, int columns) {
  const std::string head = position(moment), tail = figures(moment);
  const int fixed = columns_of(head) + columns_of(tail) + 5; // spaces and the ends of the bar
  const int free = columns - fixed;
  const std::string name = harmless(moment.name);
  const int bar = std::clamp(free - columns_of(name), narrowest_bar, widest_bar);
  const int name_columns = free - bar;
  std::string line = head;
  if (name_columns >= 4)
    line += tail_of(name, name_columns) + "  ";
  if (free >= narrowest_bar) {
    const int filled = moment.permille < 0 ? 0 : bar * std::min(moment.permille, 1000) / 1000;
    line += '[';
    line.append(static_cast<std::size_t>(filled), '#');
    line.append(static_cast<std::size_t>(bar - filled), '-');
    line += "] ";
  }
  line += tail;
  return columns_of(line) <= columns ? line : line.substr(0, static_cast<std::size_t>(std::max(columns, 0)));
}

void Display::show(const Moment& moment) {
  if (quiet_)
    return;
  if (terminal_) {
    winsize size{};
    const int columns = ioctl(STDERR_FILENO, TIOCGWINSZ, &size) == 0 && size.ws_col > 0 ? size.ws_col : 80;
    std::fprintf(stderr, "\r%s\033[K", bar_line(moment, columns - 1).c_str());
    drawn_ = true;
  } else if (moment.seconds >= next_plain_) {
    if (next_plain_ > 0) // no line for short runs
      std::fprintf(stderr, "%s\n", plain_line(moment).c_str());
    next_plain_ = moment.seconds + plain_interval;
  }
  std::fflush(stderr);
}

void Display::clear() {
  if (drawn_)
    std::fputs("\r\033[K", stderr);
  drawn_ = false;
}

} // namespace terrainseg::process
