#include "common/progress.hpp"

#include <fmt/format.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <system_error>

#include "common/terminal.hpp"

namespace espalier::cli {

namespace {

constexpr double kPatience = 2;  // seconds: what is over sooner needs no line

double seconds_between(std::chrono::steady_clock::time_point a, std::chrono::steady_clock::time_point b) {
  return std::chrono::duration<double>(b - a).count();
}

/// Columns of the terminal, as it is now.
std::size_t terminal_width() {
  constexpr std::size_t kUsual = 80;
  winsize size{};
  return ioctl(STDERR_FILENO, TIOCGWINSZ, &size) == 0 && size.ws_col > 0 ? size.ws_col : kUsual;
}

std::string bar(double share) {
  constexpr int kWidth = 20;
  const int filled = static_cast<int>(kWidth * std::clamp(share, 0.0, 1.0));
  return fmt::format("[{:=<{}}{:{}}] {:3.0f} %", "", filled, "", kWidth - filled, 100 * std::clamp(share, 0.0, 1.0));
}

/// "12 of 50 modes"; percent alone where the numbers say nothing.
std::string amount(double done, double total, const std::string& unit) {
  if (unit.empty() || unit == "flops" || unit == "time" || unit == "load factor") return "";
  if (total == 1) return "";
  return total > 0 ? fmt::format("{:.0f} of {:.0f} {}", done, total, unit) : fmt::format("{:.0f} {}", done, unit);
}

/// The time that a prediction leaves: not more digits than it has.
std::string to_go(double seconds) {
  if (!(seconds >= 0) || !std::isfinite(seconds)) return "";
  const double whole = std::ceil(seconds);
  return whole < 120 ? fmt::format("{:.0f} s to go", whole) : fmt::format("{:.0f} min to go", std::ceil(whole / 60));
}

std::string joined(std::initializer_list<std::string> parts) {
  std::string text;
  for (const std::string& part : parts)
    if (!part.empty()) text += (text.empty() ? "" : "  ") + part;
  return text;
}

/// @param since  seconds that have passed since the report
std::string line_of(const ProgressReport& r, const std::string& phase, const std::string& note, double since) {
  const double left = std::isfinite(r.seconds_left) ? std::max(0.0, r.seconds_left - since) : -1;
  const double share = r.total > 0 && r.done > 0 ? r.done / r.total
                       : left >= 0               ? (r.seconds + since) / (r.seconds + r.seconds_left)
                                                 : -1;
  const std::string name = r.phase.empty() ? phase : r.phase;
  std::string inside = r.inside;
  if (!inside.empty() && r.inside_total > 0) inside += fmt::format(" {:.0f} %", 100 * r.inside_done / r.inside_total);
  return joined({name, share >= 0 ? bar(share) : "", amount(r.done, r.total, r.unit), note,
                 inside.empty() ? "" : "(" + inside + ")",
                 share < 0 || left < 0 ? fmt::format("{:.0f} s", r.seconds + since) : to_go(left)});
}

}  // namespace

Progress::Progress(bool enabled, std::string_view command, const ProgressLines::Options& lines)
    : enabled_(enabled), start_(Clock::now()), heard_(start_), lines_(ProgressLines::of_program()) {
  lines_.open(command, lines);
  live_ = enabled && has_live_line() && !lines_.on_stderr();
  if (!live_ && !lines_.open()) return;
  try {
    painter_ = std::thread([this] { repaint_until_stopped(); });
  } catch (const std::system_error&) {  // no more threads: lines as into a file
    live_ = false;
  }
  listener_ = std::make_unique<ProgressListener>([this](const ProgressReport& report) { hear(report); });
}

Progress::~Progress() {
  abandon();
  if (!painter_.joinable()) return;
  {
    const std::lock_guard lock(mutex_);
    stop_ = true;
  }
  wake_.notify_all();
  painter_.join();
}

void Progress::hear(const ProgressReport& report) {
  const std::lock_guard lock(mutex_);
  report_ = report;
  heard_ = Clock::now();
  lines_.write(report_, 0);
}

void Progress::begin(std::string phase, double predicted_seconds) {
  stage_.reset();
  {
    const std::lock_guard lock(mutex_);
    phase_ = std::move(phase);
    note_.clear();
    report_ = {};
    heard_ = Clock::now();
    running_ = true;
  }
  stage_.emplace(phase_, 0, "", predicted_seconds);
  wake_.notify_all();
}

void Progress::end(std::string_view outcome) {
  stage_.reset();
  const std::lock_guard lock(mutex_);
  running_ = false;
  if (!enabled_) return;
  clear();
  print_note("{}{}{}\n", phase_, outcome.empty() ? "" : ": ", outcome);
}

void Progress::abandon() {
  stage_.reset();
  const std::lock_guard lock(mutex_);
  clear();
  running_ = false;
}

void Progress::follow(std::string note) {
  const std::lock_guard lock(mutex_);
  note_ = std::move(note);
  if (running_) return;
  phase_.clear();
  report_ = {};
  heard_ = Clock::now();
  running_ = true;
  wake_.notify_all();
}

void Progress::say(std::string_view line) {
  const std::lock_guard lock(mutex_);
  clear();
  print_note("{}", line);
}

void Progress::clear() {
  if (painted_) print_note("\r\x1b[K");
  painted_ = false;
}

void Progress::repaint_until_stopped() {
  std::unique_lock lock(mutex_);
  while (!stop_) {
    if (live_ && running_ && seconds_between(start_, Clock::now()) > kPatience) paint();
    if (lines_.open() && !report_.phase.empty()) lines_.write(report_, seconds_between(heard_, Clock::now()));
    wake_.wait_for(lock, std::chrono::milliseconds(100), [this] { return stop_; });
  }
}

void Progress::paint() {
  std::string line = line_of(report_, phase_, note_, seconds_between(heard_, Clock::now()));
  line.resize(std::min(line.size(), terminal_width() - 1));  // one that wraps could not be rewritten
  print_note("\r\x1b[K{}", line);
  std::fflush(stderr);
  painted_ = true;
}

}  // namespace espalier::cli
