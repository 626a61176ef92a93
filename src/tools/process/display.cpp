// SPDX-License-Identifier: LGPL-2.1-or-later
#include "tools/process/display.hpp"

#include <glib.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdio>

namespace terrainseg::process {
namespace {

constexpr double plain_interval = 5;
constexpr double rate_span = 4; // seconds
constexpr int widest_bar = 30;
constexpr int narrowest_bar = 8;

std::string number(const char* format, double value) {
  char text[G_ASCII_DTOSTR_BUF_SIZE];
  return g_ascii_formatd(text, sizeof text, format, value);
}

std::string figures(const Moment& moment) {
  std::string text = std::to_string(moment.frames) + " frames  " + number("%.1f", moment.fps) + " fps";
  // Before some of it is done the estimate would only jump.
  if (moment.whole_permille >= 5)
    text += "  " + duration_text(moment.seconds * (1000 - moment.whole_permille) / moment.whole_permille) +
            " left";
  return text;
}

std::string position(const Moment& moment) {
  std::string text(1, '[');
  text += std::to_string(std::min(moment.done + 1, moment.inputs));
  text += '/';
  text += std::to_string(moment.inputs);
  return text += "] ";
}

std::string percent(const Moment& moment) {
  if (moment.permille < 0)
    return "  ?";
  const std::string text = std::to_string(moment.permille / 10);
  return std::string(3 - std::min<std::size_t>(3, text.size()), ' ') + text;
}

/// Terminal columns are counted as code points: right for most names, never splits one.
int columns_of(const std::string& text) {
  return static_cast<int>(std::count_if(text.begin(), text.end(), [](char c) { return (c & 0xc0) != 0x80; }));
}

/// The last `columns` code points, marked when something was cut.
std::string tail_of(const std::string& text, int columns) {
  if (columns_of(text) <= columns)
    return text;
  std::size_t begin = text.size();
  for (int kept = 0; begin > 0 && kept < columns - 1;) {
    --begin;
    kept += (text[begin] & 0xc0) != 0x80;
  }
  return text.substr(begin).insert(0, 1, '~');
}

/// Control characters in a file name must not drive the terminal.
std::string harmless(std::string text) {
  for (char& letter : text)
    if (static_cast<unsigned char>(letter) < 0x20 || letter == 0x7f)
      letter = '?';
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
  return position(moment) + harmless(moment.name) + ": " + percent(moment) + " %  " + figures(moment);
}

std::string bar_line(const Moment& moment, int columns) {
  const std::string head = position(moment);
  const std::string tail = percent(moment) + " %  " + figures(moment);
  const int fixed = columns_of(head) + columns_of(tail) + 5; // blanks and the bar's ends
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

Display::Display(bool quiet) : quiet_(quiet), terminal_(isatty(STDERR_FILENO) == 1) {}

Display::~Display() {
  clear();
}

double Display::interval() const {
  return terminal_ ? 0.1 : 0.25;
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
    if (next_plain_ > 0) // short runs need no line
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
