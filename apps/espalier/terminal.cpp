#include "terminal.hpp"

#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <system_error>

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
  print_note("espalier: {} {}\n", toned_for(STDERR_FILENO, Tone::bad, "error:"), message);
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

Progress::Progress(bool enabled) : enabled_(enabled) {
  const char* term = std::getenv("TERM");
  live_ = enabled && isatty(STDERR_FILENO) != 0 && term != nullptr && std::string_view(term) != "dumb";
  if (!live_) return;
  try {
    painter_ = std::thread([this] { repaint_until_stopped(); });
  } catch (const std::system_error&) {  // no more threads: lines as into a file
    live_ = false;
  }
}

Progress::~Progress() {
  abandon();
  if (!live_) return;
  {
    const std::lock_guard lock(mutex_);
    stop_ = true;
  }
  wake_.notify_all();
  painter_.join();
}

void Progress::begin(std::string phase, double predicted_seconds) {
  {
    const std::lock_guard lock(mutex_);
    phase_ = std::move(phase);
    predicted_ = predicted_seconds;
    start_ = std::chrono::steady_clock::now();
    running_ = true;
  }
  wake_.notify_all();
}

void Progress::end(std::string_view outcome) {
  const std::lock_guard lock(mutex_);
  running_ = false;
  if (!enabled_) return;
  print_note("{}{}{}{}\n", live_ ? "\r\x1b[K" : "", phase_, outcome.empty() ? "" : ": ", outcome);
}

void Progress::abandon() {
  const std::lock_guard lock(mutex_);
  if (running_ && live_) print_note("\r\x1b[K");
  running_ = false;
}

void Progress::repaint_until_stopped() {
  std::unique_lock lock(mutex_);
  while (!stop_) {
    if (running_) {
      paint(std::chrono::duration<double>(std::chrono::steady_clock::now() - start_).count());
      wake_.wait_for(lock, std::chrono::milliseconds(100));
    } else {
      wake_.wait(lock, [this] { return running_ || stop_; });
    }
  }
}

void Progress::paint(double elapsed) const {
  constexpr int width = 24;
  std::string bar;
  if (predicted_ > 0) {
    const int filled = static_cast<int>(width * std::min(1.0, elapsed / predicted_));
    bar = fmt::format("  [{:=<{}}{:{}}] of about {}", "", filled, "", width - filled, duration(predicted_));
  }
  print_note("\r\x1b[K{} ... {:.1f} s{}", phase_, elapsed, bar);
  std::fflush(stderr);
}

}  // namespace espalier::cli
