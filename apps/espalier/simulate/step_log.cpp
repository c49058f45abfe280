#include "simulate/step_log.hpp"

#include <fmt/format.h>

#include <algorithm>

namespace espalier::cli {

namespace {

using Clock = std::chrono::steady_clock;

double seconds(Clock::duration d) { return std::chrono::duration<double>(d).count(); }

}  // namespace

StepLog::StepLog(bool enabled, bool all, Progress& progress)
    : enabled_(enabled), all_(all), progress_(progress), start_(Clock::now()) {
  last_line_ = last_note_ = start_ - std::chrono::hours(1);
}

void StepLog::add(const SimulationStep& step) {
  constexpr double kNoteEvery = 0.1;
  const auto now = Clock::now();
  if (seconds(now - last_note_) > kNoteEvery) {
    progress_.note_step({step.t, step.index, step.newton_iterations});
    if (enabled_) progress_.follow(fmt::format("t = {:.6g}, step {}", step.t, step.index));
    last_note_ = now;
  }
  pending_ = step;
  if (!enabled_) return;
  const double wait = progress_.live() ? 0.25 : 1.0;
  waiting_ = !all_ && seconds(now - last_line_) < wait;
  if (waiting_) return;
  print(step);
  last_line_ = now;
}

void StepLog::search(const SimulationSearch& s) {
  constexpr double kSilence = 5;
  const auto now = Clock::now();
  if (!enabled_ || seconds(now - std::max(last_line_, start_)) < kSilence) return;
  progress_.say(fmt::format(
      "statics: {} steps to load factor {:.6g}, trial at {:.6g}, {} factorizations, {:.1e} of the loads out "
      "of balance\n",
      s.steps, s.load, s.trial, s.factorizations, s.residual));
  last_line_ = now;
}

void StepLog::close() {
  if (pending_.index > 0) progress_.note_step({pending_.t, pending_.index, pending_.newton_iterations});
  if (!enabled_) return;
  progress_.abandon();
  if (waiting_) print(pending_);
  waiting_ = false;
}

void StepLog::print(const SimulationStep& s) {
  if (!header_)
    progress_.say(fmt::format("{:>8} {:>13} {:>9} {:>5} {:>6} {:>9} {:>9} {:>7} {:>6}\n", "step", "time", "h", "order",
                              "newton", "residual", "error", "factors", "failed"));
  header_ = true;
  progress_.say(fmt::format("{:>8} {:>13.7g} {:>9.2e} {:>5} {:>6} {:>9.1e} {:>9.2g} {:>7} {:>6}\n", s.index, s.t, s.h,
                            s.order, s.newton_iterations, s.residual, s.error, s.factorizations, s.failures));
}

}  // namespace espalier::cli
