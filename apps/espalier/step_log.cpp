#include "step_log.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <string_view>

#include "terminal.hpp"

namespace espalier::cli {

namespace {

using Clock = std::chrono::steady_clock;

double seconds(Clock::duration d) { return std::chrono::duration<double>(d).count(); }

}  // namespace

StepLog::StepLog(bool enabled, bool all, double t_begin, double t_end)
    : enabled_(enabled), all_(all), live_(false), t_begin_(t_begin), t_end_(t_end), start_(Clock::now()) {
  const char* term = std::getenv("TERM");
  live_ = enabled && isatty(STDERR_FILENO) != 0 && term != nullptr && std::string_view(term) != "dumb";
  last_line_ = last_paint_ = start_ - std::chrono::hours(1);
}

void StepLog::add(const SimulationStep& step) {
  if (!enabled_) return;
  const auto now = Clock::now();
  const double wait = live_ ? 0.25 : 1.0;
  waiting_ = !all_ && seconds(now - last_line_) < wait;
  if (waiting_) {
    pending_ = step;
  } else {
    clear();
    print(step);
    last_line_ = now;
  }
  if (live_ && seconds(now - last_paint_) > 0.1) {
    paint(step.t);
    last_paint_ = now;
  }
}

void StepLog::search(const SimulationSearch& s) {
  constexpr double kSilence = 5;
  const auto now = Clock::now();
  if (!enabled_ || seconds(now - std::max(last_line_, start_)) < kSilence) return;
  clear();
  print_note(
      "statics: {} steps to load factor {:.6g}, trial at {:.6g}, {} factorizations, {:.1e} of the loads out of "
      "balance\n",
      s.steps, s.load, s.trial, s.factorizations, s.residual);
  last_line_ = now;
}

void StepLog::close() {
  if (!enabled_) return;
  clear();
  if (waiting_) print(pending_);
  waiting_ = false;
}

void StepLog::print(const SimulationStep& s) {
  if (!header_)
    print_note("{:>8} {:>13} {:>9} {:>5} {:>6} {:>9} {:>9} {:>7} {:>6}\n", "step", "time", "h", "order", "newton",
               "residual", "error", "factors", "failed");
  header_ = true;
  print_note("{:>8} {:>13.7g} {:>9.2e} {:>5} {:>6} {:>9.1e} {:>9.2g} {:>7} {:>6}\n", s.index, s.t, s.h, s.order,
             s.newton_iterations, s.residual, s.error, s.factorizations, s.failures);
}

void StepLog::paint(double t) {
  constexpr int width = 24;
  const double share = std::clamp((t - t_begin_) / (t_end_ - t_begin_), 0.0, 1.0);
  const double elapsed = seconds(Clock::now() - start_);
  const int filled = static_cast<int>(width * share);
  const std::string left = share > 0 ? duration(elapsed * (1 - share) / share) + " to go" : "";
  print_note("\r\x1b[K[{:=<{}}{:{}}] {:3.0f} %  t = {:g}  {}", "", filled, "", width - filled, 100 * share, t, left);
  std::fflush(stderr);
  painted_ = true;
}

void StepLog::clear() {
  if (painted_) print_note("\r\x1b[K");
  painted_ = false;
}

}  // namespace espalier::cli
