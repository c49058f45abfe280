#include "common/terminal.hpp"

#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cmath>
#include <cstdio>
#include <cstdlib>

namespace espalier::cli {

namespace {

/// https://no-color.org: any non-empty value of NO_COLOR switches colour off.
bool colour_on(int descriptor) {
  const char* no_color = std::getenv("NO_COLOR");
  if (no_color != nullptr && *no_color != '\0') return false;
  const char* term = std::getenv("TERM");
  return isatty(descriptor) != 0 && term != nullptr && std::string_view(term) != "dumb";
}

std::string_view escape_of(Tone tone) {
  switch (tone) {
    case Tone::plain:
      return "";
    case Tone::strong:
      return "\x1b[1m";
    case Tone::quiet:
      return "\x1b[2m";
    case Tone::good:
      return "\x1b[1;32m";
    case Tone::bad:
      return "\x1b[1;31m";
  }
  return "";
}

std::string toned_for(int descriptor, Tone tone, std::string_view text) {
  if (tone == Tone::plain || !colour_on(descriptor)) return std::string(text);
  return fmt::format("{}{}\x1b[0m", escape_of(tone), text);
}

/// `number` with three significant digits and the prefix of its power of 1000.
std::string with_prefix(double number, std::string_view unit) {
  constexpr std::array<std::string_view, 6> prefixes{"", "k", "M", "G", "T", "P"};
  std::size_t i = 0;
  for (; number >= 999.5 && i + 1 < prefixes.size(); ++i) number /= 1000;
  const int digits = number >= 99.95 ? 0 : (number >= 9.995 ? 1 : 2);
  return fmt::format("{:.{}f} {}{}", number, digits, prefixes[i], unit);
}

int first_output_error = 0;  // of stdout
std::string last_message;    // of print_error()

}  // namespace

void write_to(std::FILE* stream, std::string_view text) {
  errno = 0;
  const bool written = std::fwrite(text.data(), 1, text.size(), stream) == text.size();
  if (!written && stream == stdout && first_output_error == 0) first_output_error = errno != 0 ? errno : EIO;
}

int output_error() {
  errno = 0;
  const bool flushed = std::fflush(stdout) == 0 && std::ferror(stdout) == 0;
  if (!flushed && first_output_error == 0) first_output_error = errno != 0 ? errno : EIO;
  return first_output_error;
}

std::string toned(Tone tone, std::string_view text) { return toned_for(STDOUT_FILENO, tone, text); }

void print_error(std::string_view message) {
  static_cast<void>(output_error());
  last_message = message;
  print_note("espalier: {} {}\n", toned_for(STDERR_FILENO, Tone::bad, "error:"), message);
}

const std::string& last_error() { return last_message; }

bool has_live_line() {
  const char* term = std::getenv("TERM");
  return isatty(STDERR_FILENO) != 0 && term != nullptr && std::string_view(term) != "dumb";
}

void print_hint(std::string_view message) { print_note("          {}\n", message); }

std::string grouped(std::int64_t number) {
  std::string digits = fmt::format("{}", number);
  const std::size_t first = number < 0 ? 1 : 0;
  for (std::size_t at = digits.size(); at > first + 3;) {
    at -= 3;
    digits.insert(at, 1, ',');
  }
  return digits;
}

std::string counted(std::int64_t number, std::string_view one, std::string_view many) {
  return fmt::format("{} {}", grouped(number), number == 1 ? one : many);
}

std::string duration(double seconds) {
  if (!(seconds >= 0)) return "-";
  if (seconds < 0.9995e-3) return fmt::format("{:.0f} us", seconds * 1e6);
  if (seconds < 0.9995) return fmt::format("{:.{}f} ms", seconds * 1e3, seconds < 0.1 ? 2 : 0);
  if (seconds < 120) return fmt::format("{:.2f} s", seconds);
  const auto whole = std::llround(seconds);
  return fmt::format("{} min {} s", whole / 60, whole % 60);
}

std::string rate(double flops_per_second) {
  return flops_per_second > 0 ? with_prefix(flops_per_second, "FLOP/s") : std::string("-");
}

std::string operations(double flops) { return with_prefix(flops, "FLOP"); }

std::string small(double number) { return fmt::format("{:.1e}", number); }

void Table::add(std::vector<std::string> cells, Tone tone) {
  if (cells.size() > align_.size())
    throw std::logic_error("Table::add: a row has more cells than the table has columns");
  rows_.push_back({std::move(cells), tone});
}

std::string Table::text() const {
  std::vector<std::size_t> widths(align_.size(), 0);
  for (const Row& row : rows_) {
    for (std::size_t c = 0; c < row.cells.size(); ++c) widths[c] = std::max(widths[c], row.cells[c].size());
  }
  std::string text;
  for (const Row& row : rows_) {
    std::string line;
    for (std::size_t c = 0; c < row.cells.size(); ++c) {
      const auto& cell = row.cells[c];
      line +=
          "  " + (align_[c] == '<' ? fmt::format("{:<{}}", cell, widths[c]) : fmt::format("{:>{}}", cell, widths[c]));
    }
    line.erase(line.find_last_not_of(' ') + 1);
    text += toned(row.tone, line) + '\n';
  }
  return text;
}

}  // namespace espalier::cli
